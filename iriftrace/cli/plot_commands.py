"""The command ``iriftrace plot``: pictures of a sweep or of one pose."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from iriftrace.cli.checks import check_folder, check_input, removed_on_failure
from iriftrace.cli.console import notes, out, show_warning, working
from iriftrace.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.sweep_quantities import SweepSummary


def plot(
    file: Path,
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"])] = Path("figures"),
    displacement: float = 0.5,
    coverage: float = 0.2,
    axial: float = 0.15,
    lateral: float = 0.15,
    statistic: Literal["mean", "median", "p95"] = "mean",
    resolution: Literal["step", "nn3d", "nnxy"] = "step",
    region: str = "part",
    percentile: float = 95.0,
    min_hits: int = 100,
) -> None:
    """Draw a sweep or one pose.

    Of a sweep: the poses in space, coloured by each metric; maps over azimuth and elevation;
    histograms; rays of each pose; the Pareto front. Of a pose: the displacement picture.

    Example: ``iriftrace plot sweep.nc -o figures``

    Parameters
    ----------
    file
        A sweep (.nc) that ``iriftrace sweep`` wrote, or an AOV image (.exr).
    output
        Folder for the pictures (PNG, and PDF where there are vectors).
    displacement, coverage, axial, lateral
        Weights of the score, as for ``iriftrace plan``; only for sweeps, as are all options below.
    statistic
        Which displacement.
    resolution
        Reading of the resolution.
    region
        Region of the part.
    percentile
        Upper end of the normalisation and of the colours.
    min_hits
        Poses with fewer good rays are drawn without a number.
    """
    suffix = file.suffix.lower()
    if suffix not in (".nc", ".exr"):
        raise InputError(
            f"{file} ends in neither .nc nor .exr; give a sweep or the AOV image of a pose."
        )
    check_input(file)
    if not output.absolute().parent.is_dir():
        raise InputError(f"The folder {output.parent} does not exist; create it first.")
    check_folder(output)
    if suffix == ".exr":
        pictures = _plot_pose(file, output)
    else:
        from iriftrace.plan_weights import Weights
        from iriftrace.sweep_quantities import summarise
        from iriftrace.sweep_store import read_sweep

        dataset = read_sweep(file)
        summary = summarise(
            dataset,
            weights=Weights(displacement, coverage, axial, lateral),
            statistic=statistic,
            resolution=resolution,
            region=region,
            percentile=percentile,
            min_hits=min_hits,
        )
        pictures = _plot_sweep(file, dataset, summary, output)
    out.print(
        f"Pictures in {output}: {', '.join(path.name for path in pictures)}",
        markup=False,
        soft_wrap=True,
    )


def _plot_pose(file: Path, folder: Path) -> list[Path]:
    from iriftrace.exr import read_exr
    from iriftrace.figures import displacement_figure

    image = read_exr(file)
    picture = folder / f"{file.stem}.png"
    with removed_on_failure(folder), working("Drawing"):
        folder.mkdir(exist_ok=True)
        displacement_figure(image, picture)
    return [picture]


def _plot_sweep(file: Path, dataset: xr.Dataset, summary: SweepSummary, folder: Path) -> list[Path]:
    from iriftrace.sweep_figures import extreme_views, sweep_figures

    with removed_on_failure(folder):
        folder.mkdir(exist_ok=True)
        with working("Drawing"):
            pictures = sweep_figures(summary, folder)
            pictures += extreme_views(dataset, summary, file.parent, folder)
        pictures += _plot_in_space(dataset, summary, folder)
    return pictures


def _plot_in_space(dataset: xr.Dataset, summary: SweepSummary, folder: Path) -> list[Path]:
    """Draw the poses around the part, where this machine can draw."""
    from iriftrace.doctor import drawing_trouble

    with working("Drawing in space"):
        trouble = drawing_trouble()
        if trouble:
            show_warning(
                f"The 3-D pictures are left out, because VTK cannot draw here ({trouble}); "
                "`iriftrace doctor` says how to mend it.",
                UserWarning,
            )
            return []
        from iriftrace.sweep_scene_figure import sweep_scene_figure
        from iriftrace.sweep_surroundings import surroundings_of

        surroundings = surroundings_of(dataset)
        pictures = []
        for quantity in summary.quantities:
            pictures.append(folder / f"scene_{quantity.key}.png")
            sweep_scene_figure(summary, quantity, surroundings, pictures[-1])
    if surroundings.missing:
        notes.print(
            f"note: the 3-D pictures lack {' and '.join(surroundings.missing)}.",
            markup=False,
            soft_wrap=True,
        )
    return pictures
