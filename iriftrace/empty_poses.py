"""Poses of a sweep that see next to nothing, and why."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from iriftrace.errors import IriftraceWarning
from iriftrace.ray_statistics import FEWEST_RAYS

if TYPE_CHECKING:
    import xarray as xr


def warn_of_empty_poses(dataset: xr.Dataset) -> None:
    """Say why, when more than half of the poses are empty.

    Warns
    -----
    IriftraceWarning
    """
    good = dataset["rays_good"].sel(region="part").values
    empty: NDArray[np.bool_] = good < FEWEST_RAYS
    if 2 * empty.sum() <= len(empty):
        return
    hits = dataset["rays_hit"].sel(region="part").values
    reasons = {
        "the camera stands in the hot air or the part, or failed": (good < 0).sum(),
        "the part is out of focus": _most(dataset, "rays_out_of_focus", empty),
        "the part is hidden by another object": _most(dataset, "rays_blocked", empty),
        "the part is out of the picture": (empty & (hits == 0)).sum(),
        f"the part covers fewer than {FEWEST_RAYS} pixels": (
            empty & (hits > 0) & (hits < FEWEST_RAYS)
        ).sum(),
    }
    reason = max(reasons, key=lambda text: reasons[text])
    warnings.warn(
        f"{empty.sum()} of {len(empty)} poses see fewer than {FEWEST_RAYS} good rays, mostly "
        f"because {reason}; change the orbit, the focus interval, the focal length or the number "
        "of pixels.",
        IriftraceWarning,
        stacklevel=4,
    )


def _most(dataset: xr.Dataset, name: str, empty: NDArray[np.bool_]) -> int:
    counts = dataset[name].sel(region="part").values
    return int((empty & (counts >= FEWEST_RAYS)).sum())
