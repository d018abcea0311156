"""All figures of a sweep that this machine can draw and whose files still exist."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from iriftrace.core.errors import InputError, SetupError
from iriftrace.figures.pose import displacement_figure
from iriftrace.figures.style import number
from iriftrace.figures.sweep_charts import (
    histogram_figure,
    map_figure,
    normalised_figure,
    pareto_figure,
    rays_figure,
)
from iriftrace.planning.summary import SweepSummary, extreme_images, extreme_poses
from iriftrace.sweep.faces import face_maps_of
from iriftrace.sweep.store import included

if TYPE_CHECKING:
    import xarray as xr


def sweep_charts(summary: SweepSummary) -> dict[str, Figure]:
    """Maps, histograms, counts and Pareto front of a sweep: figures that need its numbers only.

    Parameters
    ----------
    summary
        A summary by :func:`iriftrace.planning.summary.summarise`.

    Returns
    -------
    dict
        ``map_displacement``, ``map_coverage``, ``map_axial``, ``map_lateral``, ``map_score``,
        ``histograms``, ``histograms_normalised``, ``rays`` and ``pareto``; for an ensemble also
        ``map_scatter``.
    """
    return {
        **{f"map_{q.key}": map_figure(summary, q) for q in summary.quantities},
        "histograms": histogram_figure(summary),
        "histograms_normalised": normalised_figure(summary),
        "rays": rays_figure(summary),
        "pareto": pareto_figure(summary),
    }


def sweep_pictures(
    dataset: xr.Dataset, summary: SweepSummary
) -> tuple[dict[str, Figure], tuple[str, ...]]:
    """Extreme views of a sweep, its poses in space and its faces: figures that also need its files.

    Parameters
    ----------
    dataset, summary
        The sweep; its stored images lie next to its file.

    Returns
    -------
    figures : dict
        ``view_best``, ``view_smallest_displacement``, ``scene_score``, ``faces_times_seen`` and
        the like.
    missing : tuple of str
        Missing figures and the reasons, a sentence each.
    """
    figures: dict[str, Figure] = {}
    missing: list[str] = []
    poses = extreme_poses(summary)
    try:
        for name, image in extreme_images(dataset, summary):
            view = view_name(summary, poses[name])
            figure = displacement_figure(image, included(dataset), view=view)
            figures["view_best" if name == "best" else f"view_{name}_displacement"] = figure
    except (InputError, SetupError) as error:
        numbers = " and ".join(dict.fromkeys(map(str, poses.values())))
        missing.append(
            f"The views from poses {numbers} (best, smallest and largest displacement) are left "
            f"out, because their images were not stored and they cannot be rendered again: "
            f"{str(error).rstrip('.')}."
        )
    figures |= _in_space(dataset, summary, missing)
    return figures, tuple(missing)


def view_name(summary: SweepSummary, pose: int) -> str:
    """Number and direction of a pose."""
    azimuth, elevation = (
        f"{number(round(float(angles[pose]), 1))}°"
        for angles in (summary.azimuth, summary.elevation)
    )
    return f"Pose {pose}, azimuth {azimuth}, elevation {elevation}"


def _in_space(dataset: xr.Dataset, summary: SweepSummary, missing: list[str]) -> dict[str, Figure]:
    """Poses around the part and faces of the part, if this machine can draw them."""
    from iriftrace.core.runtime.doctor import drawing_trouble

    trouble = drawing_trouble()
    if trouble:
        missing.append(
            f"The 3-D pictures are left out, because VTK cannot draw here ({trouble}); "
            "`iriftrace doctor` shows how to repair it."
        )
        return {}
    from iriftrace.figures.sweep_space import sweep_face_figure, sweep_scene_figure
    from iriftrace.sweep.reload import surroundings_of

    around = surroundings_of(dataset)
    if around.missing:
        missing.append(f"The 3-D pictures do not show {' and '.join(around.missing)}.")
    figures = {f"scene_{q.key}": sweep_scene_figure(summary, q, around) for q in summary.quantities}
    if around.part is not None:
        for values in face_maps_of(dataset):
            figures[f"faces_{values.key}"] = sweep_face_figure(summary, around.part, values)
    return figures
