"""All figures of a sweep that Matplotlib draws, as PNG and as PDF."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from iriftrace.figure_file import write_pdf, write_png
from iriftrace.sweep_charts import histogram_figure, normalised_figure, pareto_figure, rays_figure
from iriftrace.sweep_maps import map_figure
from iriftrace.sweep_summary import SweepSummary


def sweep_figures(summary: SweepSummary, folder: str | Path, *, vectors: bool = True) -> list[Path]:
    """Draw maps, histograms, counts and Pareto front of a sweep.

    Parameters
    ----------
    summary
        What :func:`iriftrace.sweep_summary.summarise` found in the sweep.
    folder
        An existing folder; files of the same names are replaced.
    vectors
        Whether to write PDF too.

    Returns
    -------
    list of Path
        ``map_displacement``, ``map_coverage``, ``map_axial``, ``map_lateral``, ``map_score``,
        ``histograms``, ``histograms_normalised``, ``rays`` and ``pareto``, each as ``.png`` and,
        if wanted, ``.pdf``.

    Raises
    ------
    InputError
        A file cannot be written.
    """
    written = []
    formats = [(".png", write_png), *([(".pdf", write_pdf)] if vectors else [])]
    for name, figure in _figures(summary).items():
        for suffix, write in formats:
            path = Path(folder) / f"{name}{suffix}"
            write(figure, path)
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
