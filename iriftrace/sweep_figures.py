"""All figures of a sweep that Matplotlib draws, as PNG and as PDF."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from iriftrace.exr import read_exr
from iriftrace.figure_file import write_pdf, write_png
from iriftrace.figures import displacement_figure
from iriftrace.sweep_charts import histogram_figure, normalised_figure, pareto_figure, rays_figure
from iriftrace.sweep_maps import map_figure
from iriftrace.sweep_quantities import SweepSummary

if TYPE_CHECKING:
    import xarray as xr


def sweep_figures(summary: SweepSummary, folder: str | Path) -> list[Path]:
    """Draw maps, histograms, counts and Pareto front of a sweep.

    Parameters
    ----------
    summary
        What :func:`iriftrace.sweep_quantities.summarise` found in the sweep.
    folder
        An existing folder; files of the same names are replaced.

    Returns
    -------
    list of Path
        ``map_displacement``, ``map_coverage``, ``map_axial``, ``map_lateral``, ``map_score``,
        ``histograms``, ``histograms_normalised``, ``rays`` and ``pareto``, each as ``.png`` and
        ``.pdf``.

    Raises
    ------
    InputError
        A file cannot be written.
    """
    written = []
    for name, figure in _figures(summary).items():
        for suffix, write in ((".png", write_png), (".pdf", write_pdf)):
            path = Path(folder) / f"{name}{suffix}"
            write(figure, path)
            written.append(path)
    return written


def extreme_views(
    dataset: xr.Dataset, summary: SweepSummary, beside: Path, folder: str | Path
) -> list[Path]:
    """Draw what the poses of smallest and largest displacement see, where their EXRs were kept.

    Parameters
    ----------
    dataset, summary
        The sweep.
    beside
        Folder that the names of the EXRs start from.
    folder
        An existing folder for ``view_smallest_displacement.png`` and
        ``view_largest_displacement.png``.

    Raises
    ------
    InputError
        An EXR is damaged, or a file cannot be written.
    """
    values = summary.displacement.values
    written = []
    for name, pose in (("smallest", np.nanargmin(values)), ("largest", np.nanargmax(values))):
        file = str(dataset["exr"].values[pose]) if "exr" in dataset else ""
        if file and (beside / file).is_file():
            path = Path(folder) / f"view_{name}_displacement.png"
            displacement_figure(read_exr(beside / file), path)
            written.append(path)
    return written


def _figures(summary: SweepSummary) -> dict[str, Figure]:
    return {
        **{f"map_{q.key}": map_figure(summary, q) for q in summary.quantities},
        "histograms": histogram_figure(summary),
        "histograms_normalised": normalised_figure(summary),
        "rays": rays_figure(summary),
        "pareto": pareto_figure(summary),
    }
