"""What the poses of smallest and largest displacement of a sweep see."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from iriftrace.exr import AovImage, read_exr
from iriftrace.sweep_summary import SweepSummary

if TYPE_CHECKING:
    import xarray as xr


def extreme_poses(summary: SweepSummary) -> dict[str, int]:
    """Numbers of the poses of ``smallest`` and ``largest`` displacement."""
    values = summary.displacement.values
    return {"smallest": int(np.nanargmin(values)), "largest": int(np.nanargmax(values))}


def extreme_images(
    dataset: xr.Dataset, summary: SweepSummary, beside: Path
) -> Iterator[tuple[str, AovImage]]:
    """Images of the poses of smallest and largest displacement, with their names.

    Read where the sweep kept them, else rendered again.

    Parameters
    ----------
    dataset, summary
        The sweep.
    beside
        Folder that the names of the EXRs start from.

    Raises
    ------
    InputError
        An EXR is damaged, or there is none and the scene is gone or has changed.
    SetupError
        There is no EXR, and no usable LLVM or CUDA either.
    """
    from iriftrace.swept_scene import load_swept_scene

    for name, pose in extreme_poses(summary).items():
        file = str(dataset["exr"].values[pose]) if "exr" in dataset else ""
        if file and (beside / file).is_file():
            yield name, read_exr(beside / file)
        else:
            yield name, load_swept_scene(dataset, pose).render(summary.matrices[pose]).image
