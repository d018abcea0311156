"""The command ``iriftrace compare``: measured shifts against those of a rendering."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from iriftrace.cli import checks
from iriftrace.cli.console import out, say, working, written_figure
from iriftrace.cli.options import LightOf, Output
from iriftrace.cli.shift_options import WithoutZeros, left_out, read_shifts
from iriftrace.cli.trace_options import Statuses, check_light, statuses
from iriftrace.core.errors import InputError
from iriftrace.core.plain import JsonObject
from iriftrace.measuring.options import COLD, Picture


def compare(
    image: Path,
    measured: Path,
    *,
    output: Output | None = None,
    positions: Picture = COLD,
    without_zeros: WithoutZeros = False,
    include: Statuses = None,
    wavelength: LightOf = None,
    figures: bool = True,
) -> None:
    """Compare measured pixel shifts between a cold and a hot picture with a rendering.

    Shifts are positions in the hot picture minus positions in the cold one, u to the right and v
    down. The residual, measured minus simulated, is split into the part that a small rigid motion
    of the camera between the two pictures explains, and the rest.

    Example: ``iriftrace compare out.exr markers.csv``

    Parameters
    ----------
    image
        The AOV EXR that ``iriftrace render`` wrote, at the camera's own resolution.
    measured
        A map of two channels (.exr, or .npy with the shape height, width, 2), or markers (.csv with
        the columns u, v, du, dv; pixel centres are whole numbers, as OpenCV counts). Rows with a
        column valid of 0 or false, flags other than 0 (OpenPIV) or a negative sigma (VIC-3D) were
        not measured.
    output
        The JSON file; by default next to the EXR and named after both, such as
        out_against_markers.json. The picture is written next to it.
    positions
        The picture in which the places were measured; most programs use the first, cold one.
    figures
        Draw measured and simulated shifts and residuals.
    """
    from iriftrace.io.exr import read_exr
    from iriftrace.measuring.comparison import compare as compare_shifts

    checks.inputs(image, measured)
    rendering = read_exr(image)
    target = output or image.with_name(f"{image.stem}_against_{measured.stem}.json")
    checks.output(target, "comparison.json")
    if target.resolve() == measured.resolve():
        raise InputError(
            f"The output {target} would replace the measured shift; name another one.",
            code="output.replaces",
        )
    used = statuses(include)
    check_light(wavelength, rendering.header, image)
    shifts = read_shifts(measured, without_zeros)
    with working("Comparing"):
        comparison = compare_shifts(rendering, shifts, positions=positions, include=used)
    report = comparison.as_dict()
    written = [target]
    if figures:
        from iriftrace.figures.comparison import comparison_figure

        title = f"{measured.name} and {image.name}, {report['points']['compared']:,} places"
        figure = partial(comparison_figure, comparison, comparison.measurement.resolution, title)
        written.append(written_figure(figure, target.with_suffix(".png")))
    comparison.save(target)
    _print_report(report, image.name, comparison.image.resolution)
    say("Files: " + ", ".join(map(str, written)))


def _print_report(report: JsonObject, name: str, resolution: tuple[int, int]) -> None:
    table = Table(title="Measured shift against simulated", title_justify="left", show_header=False)
    table.add_column(style="bold")
    table.add_column()
    width, height = resolution
    table.add_row("rendering", f"{escape(name)}, {width} x {height} px")
    points = report["points"]
    table.add_row(
        "places",
        f"{points['measured']:,} measured, {points['compared']:,} compared, "
        f"{points['without_simulation']:,} not on good pixels of the part",
    )
    table.add_row("left out", left_out(points["failed"], points["zeros"]))
    for name in ("measured", "simulated", "residual"):
        values = report[f"{name}_px"]
        table.add_row(
            name, ", ".join(f"{key} {values[key]:.4g} px" for key in ("rms", "median", "p95"))
        )
    across, down = report["residual_px"]["bias"]
    table.add_row("bias", f"{across:.4g} px across, {down:.4g} px down")
    table.add_row("correlation", _number(report["correlation"]))
    motion = report["camera_motion"]
    if "reason" in motion:
        table.add_row("camera motion", f"not known: {motion['reason']}")
    else:
        for what, unit in (("translation", "um"), ("rotation", "urad")):
            values, deviations = motion[f"{what}_{unit}"], motion[f"{what}_std_{unit}"]
            table.add_row(
                f"camera {what}",
                ", ".join(
                    f"{axis} {_with_deviation(value, deviation, unit)}"
                    for axis, value, deviation in zip("xyz", values, deviations, strict=True)
                ),
            )
        table.add_row(
            "which explains",
            f"{motion['explained']:.1%} of the residual's mean square: rms "
            f"{motion['rms_before_px']:.4g} px before, {motion['rms_after_px']:.4g} px after, "
            f"correlation {_number(motion['correlation_after'])} "
            f"({motion['points']:,} places, {motion['outliers']:,} outliers left out)",
        )
    out.print(table)


def _with_deviation(value: float, deviation: float, unit: str) -> str:
    text = f"{_digits(value, 4)} +- {_digits(deviation, 2)} {unit}"
    return text if abs(value) >= deviation else f"{text} (not significant)"


def _digits(value: float, digits: int) -> str:
    """A number with so many significant digits, without an exponent."""
    from numpy import format_float_positional

    return format_float_positional(value, precision=digits, fractional=False, trim="-")


def _number(value: float | None) -> str:
    return "n/a, one of them is constant" if value is None else f"{value:.4f}"
