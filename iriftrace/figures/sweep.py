"""All pictures of a sweep, as far as this machine can draw them and the files are still there."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from attrs import frozen
from matplotlib.figure import Figure

from iriftrace.core.errors import InputError, SetupError
from iriftrace.figures.pose import displacement_figure
from iriftrace.figures.style import number, write_pdf, write_png
from iriftrace.figures.sweep_charts import (
    histogram_figure,
    normalised_figure,
    pareto_figure,
    rays_figure,
)
from iriftrace.figures.sweep_maps import map_figure
from iriftrace.planning.summary import SweepSummary, extreme_images, extreme_poses
from iriftrace.sweep.faces import face_maps_of

if TYPE_CHECKING:
    import xarray as xr


# MERGE sweep_figures: All figures of a sweep that Matplotlib draws, as PNG and as PDF.


def sweep_figures(summary: SweepSummary, folder: str | Path, *, vectors: bool = True) -> list[Path]:
    """Draw maps, histograms, counts and Pareto front of a sweep.

    Parameters
    ----------
    summary
        What :func:`iriftrace.planning.summary.summarise` found in the sweep.
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


@frozen(eq=False)
class Pictures:
    """What was drawn.

    Attributes
    ----------
    files : tuple of Path
    missing : tuple of str
        What was not drawn and why, a sentence each.
    """

    files: tuple[Path, ...]
    missing: tuple[str, ...]


def draw_sweep(
    dataset: xr.Dataset,
    summary: SweepSummary,
    beside: Path,
    folder: Path,
    *,
    vectors: bool = True,
) -> Pictures:
    """Draw charts, maps, extreme views and pictures in space.

    Parameters
    ----------
    dataset, summary
        The sweep.
    beside
        Folder of the sweep's file, from which the names of its EXRs start.
    folder
        An existing folder for the pictures; files of the same names are replaced.
    vectors
        Whether to write a PDF beside the PNG of each chart.

    Raises
    ------
    InputError
        A file cannot be written.
    """
    files = sweep_figures(summary, folder, vectors=vectors)
    missing: list[str] = []
    try:
        poses = extreme_poses(summary)
        for name, image in extreme_images(dataset, summary, beside):
            path = folder / f"view_{name}_displacement.png"
            displacement_figure(image, path, view=_view(summary, poses[name]))
            files.append(path)
    except (InputError, SetupError) as error:
        numbers = " and ".join(str(pose) for pose in extreme_poses(summary).values())
        missing.append(
            f"The views from poses {numbers} (smallest and largest displacement) are left out, "
            f"because no image of them was kept and they cannot be rendered again: "
            f"{str(error).rstrip('.')}."
        )
    files += _in_space(dataset, summary, folder, missing)
    return Pictures(tuple(files), tuple(missing))


def _view(summary: SweepSummary, pose: int) -> str:
    azimuth, elevation = (
        f"{number(round(float(angles[pose]), 1))}°"
        for angles in (summary.azimuth, summary.elevation)
    )
    return f"Pose {pose}, azimuth {azimuth}, elevation {elevation}"


def _in_space(
    dataset: xr.Dataset, summary: SweepSummary, folder: Path, missing: list[str]
) -> list[Path]:
    """Poses around the part and faces of the part, where this machine can draw them."""
    from iriftrace.runtime.doctor import drawing_trouble

    trouble = drawing_trouble()
    if trouble:
        missing.append(
            f"The 3-D pictures are left out, because VTK cannot draw here ({trouble}); "
            "`iriftrace doctor` says how to mend it."
        )
        return []
    from iriftrace.figures.sweep_space import sweep_face_figure, sweep_scene_figure
    from iriftrace.sweep.reload import surroundings_of

    surroundings = surroundings_of(dataset)
    if surroundings.missing:
        missing.append(f"The 3-D pictures lack {' and '.join(surroundings.missing)}.")
    files = []
    for quantity in summary.quantities:
        files.append(folder / f"scene_{quantity.key}.png")
        sweep_scene_figure(summary, quantity, surroundings, files[-1])
    if surroundings.part is not None:
        for values in face_maps_of(dataset):
            files.append(folder / f"faces_{values.key}.png")
            sweep_face_figure(summary, surroundings.part, values, files[-1])
    return files
