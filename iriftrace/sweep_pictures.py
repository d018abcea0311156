"""All pictures of a sweep, as far as this machine can draw them and the files are still there."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from attrs import frozen

from iriftrace.errors import InputError, SetupError
from iriftrace.figures import displacement_figure
from iriftrace.sweep_extremes import extreme_images, extreme_poses
from iriftrace.sweep_faces import face_maps_of
from iriftrace.sweep_figures import sweep_figures
from iriftrace.sweep_style import number
from iriftrace.sweep_summary import SweepSummary

if TYPE_CHECKING:
    import xarray as xr


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
    from iriftrace.doctor import drawing_trouble

    trouble = drawing_trouble()
    if trouble:
        missing.append(
            f"The 3-D pictures are left out, because VTK cannot draw here ({trouble}); "
            "`iriftrace doctor` says how to mend it."
        )
        return []
    from iriftrace.sweep_face_figure import sweep_face_figure
    from iriftrace.sweep_scene_figure import sweep_scene_figure
    from iriftrace.sweep_surroundings import surroundings_of

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
