"""The command ``iriftrace plot``: pictures of a sweep, a study or one pose."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from iriftrace.cli.console import notes, out, working
from iriftrace.cli.options import Whole, check_folder, check_input, check_output, removed_on_failure
from iriftrace.cli.plan import THE_PAPERS, RankingOptions
from iriftrace.cli.trace_options import check_light
from iriftrace.core.errors import InputError


def plot(
    file: Path,
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"])] = Path("figures"),
    ranking: RankingOptions = THE_PAPERS,
    wavelength: str | None = None,
) -> None:
    """Draw a sweep, a study or one pose.

    Of a sweep: the poses in space, coloured by each metric; maps over azimuth and elevation;
    histograms; rays of each pose; the Pareto front; the views of smallest and largest
    displacement; the faces of the part, coloured by how well they are seen. Of a study: its figure.
    Of a pose: the displacement picture, and of an ensemble the scatter's.

    Example: ``iriftrace plot sweep.nc -o figures``

    Parameters
    ----------
    file
        A sweep (.nc) that ``iriftrace sweep`` wrote; or a study (.nc) or an AOV image (.exr), to
        which the options for the ranking do not apply.
    output
        Folder for the pictures (PNG, and PDF where there are vectors).
    wavelength
        Wavelength that the file must be of, "450 nm"; one of other light is refused.
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
        pictures = _plot_pose(file, wavelength, output)
    elif _is_study(file):
        pictures = _plot_study(file, wavelength, output)
    else:
        pictures = _plot_sweep(file, ranking, wavelength, output)
    out.print(
        f"Pictures in {output}: {', '.join(path.name for path in pictures)}",
        markup=False,
        soft_wrap=True,
    )


def _plot_pose(file: Path, wavelength: str | None, folder: Path) -> list[Path]:
    from iriftrace.figures.pose import displacement_figure, scatter_figure
    from iriftrace.image.aov_image import read_exr
    from iriftrace.image.metrics import has_ensemble

    image = read_exr(file)
    check_light(wavelength, image.header, file)
    pictures = [folder / f"{file.stem}.png"]
    with removed_on_failure(folder), working("Drawing"):
        folder.mkdir(exist_ok=True)
        displacement_figure(image, pictures[0])
        if has_ensemble(image):
            pictures.append(folder / f"{file.stem}_scatter.png")
            scatter_figure(image, pictures[1])
    return pictures


def _is_study(file: Path) -> bool:
    from iriftrace.studies.cases import is_study

    return is_study(file)


def _plot_study(file: Path, wavelength: str | None, folder: Path) -> list[Path]:
    from iriftrace.figures.studies import study_figure
    from iriftrace.figures.style import write_png
    from iriftrace.studies.cases import read_study

    dataset = read_study(file)
    check_light(wavelength, dataset.attrs, file)
    picture = folder / f"{file.stem}.png"
    with removed_on_failure(folder), working("Drawing"):
        folder.mkdir(exist_ok=True)
        write_png(study_figure(dataset), picture)
    return [picture]


def _plot_sweep(
    file: Path, ranking: RankingOptions, wavelength: str | None, folder: Path
) -> list[Path]:
    from iriftrace.sweep.store import read_sweep

    dataset = read_sweep(file)
    check_light(wavelength, dataset.attrs, file)
    summary = ranking.summary_of(dataset)
    from iriftrace.figures.sweep import draw_sweep

    with removed_on_failure(folder):
        folder.mkdir(exist_ok=True)
        with working("Drawing"):
            pictures = draw_sweep(dataset, summary, file.parent, folder)
    for text in pictures.missing:
        notes.print(f"note: {text}", markup=False, soft_wrap=True)
    return list(pictures.files)


# MERGE cli.report_commands: The command ``iriftrace report``: what a sweep found out, as one HTML


def report(
    sweep: Path,
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"])] = Path("report.html"),
    ranking: RankingOptions = THE_PAPERS,
    top: Whole = 10,
    wavelength: str | None = None,
) -> None:
    """Write what a sweep found out as one HTML page that needs neither Python nor a network.

    Example: ``iriftrace report sweep.nc -o report.html``

    Parameters
    ----------
    sweep
        A file that ``iriftrace sweep`` wrote.
    output
        The HTML file.
    top
        Rows of the ranking.
    wavelength
        Wavelength that the sweep must be of, "450 nm"; one of other light is refused.
    """
    from iriftrace.figures.report import write_report
    from iriftrace.sweep.store import read_sweep

    check_output(output, ".html", "report.html", make=False)
    check_input(sweep)
    dataset = read_sweep(sweep)
    check_light(wavelength, dataset.attrs, sweep)
    summary = ranking.summary_of(dataset)
    with working("Writing the report"):
        missing = write_report(output, sweep, dataset, summary, top=top)
    for text in missing:
        notes.print(f"note: {text}", markup=False, soft_wrap=True)
    out.print(f"Report in {output}", markup=False, soft_wrap=True)
