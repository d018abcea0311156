"""The commands ``iriftrace compare`` and ``fit``: measured shifts against renderings."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter
from rich.markup import escape
from rich.table import Table

from iriftrace.cli.console import command_line, drawn, out, print_table, say, working
from iriftrace.cli.options import (
    Flag,
    LightOf,
    Statuses,
    check_input,
    check_output,
    refuse_given,
    statuses,
)
from iriftrace.cli.trace_options import TraceOptions, check_light
from iriftrace.core.errors import InputError, warn
from iriftrace.core.plain import JsonObject

if TYPE_CHECKING:
    from iriftrace.trace.member_fit import MemberFit


def compare(
    image: Path,
    measured: Path,
    *,
    output: Annotated[Path | None, Parameter(name=["-o", "--output"])] = None,
    positions: Literal["cold", "hot"] = "cold",
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
        the columns u, v, du, dv; pixel centres are whole numbers, as OpenCV counts).
    output
        The JSON file; by default next to the EXR and named after both, such as
        out_against_markers.json. The picture is written next to it.
    positions
        The picture in which the places were measured; most programs use the first, cold one.
    figures
        Draw measured and simulated shifts and residuals.
    """
    from iriftrace.image.aov_image import read_exr
    from iriftrace.image.comparison import compare as compare_files

    check_input(image, measured)
    header = read_exr(image).header
    target = output or image.with_name(f"{image.stem}_against_{measured.stem}.json")
    check_output(target, "comparison.json")
    if target.resolve() == measured.resolve():
        raise InputError(f"The output {target} would replace the measured shift; name another one.")
    used = statuses(include)
    check_light(wavelength, header, image)
    with working("Comparing"):
        comparison = compare_files(image, measured, positions=positions, include=used)
    report = comparison.as_dict()
    written = [target]
    if figures:
        from iriftrace.figures.comparison import comparison_figure

        title = f"{measured.name} and {image.name}, {report['points']['compared']:,} places"
        figure = partial(comparison_figure, comparison, comparison.measurement.resolution, title)
        written.append(drawn(figure, target.with_suffix(".png")))
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


def fit(
    board: Path,
    measured: Path,
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"])],
    scene: Path | None = None,
    noise: float | None = None,
    camera_motion: Flag = False,
    trace: TraceOptions = TraceOptions(),
) -> None:
    """Find the measured air: weights of an ensemble's members from shifts or temperatures.

    Weights are not negative and sum to 1. They minimise the difference between the members'
    predictions and the measured values. The new scene has the members that matter, with their
    weights and the uncertainty of the fit; ``measure`` and ``correct`` use both.

    Example: ``iriftrace fit board/scene.xml shifts.csv -o fitted/scene.xml``

    Parameters
    ----------
    board
        The scene of the measurement: an ensemble (--member) whose part is the board, with the hot
        part as the first --blocker; or the hot part, for marks on it and for thermocouples.
    measured
        Dots in the cold picture and their shifts to the hot one: .csv with the columns u, v, du, dv
        in pixels of the camera's full resolution (pixel centres are whole numbers, as OpenCV
        counts), or a map as for ``compare``. Or temperatures in the air: .csv with the columns x,
        y, z (mm), T (K) or T (degC), and U, their expanded uncertainty, if it is known.
    output
        XML file of the weighted scene, in a folder of its own; the fit's numbers (fit.json) go
        next to it.
    scene
        Scene of the hot part with the same fields and the measuring devices, to be weighted; by
        default that of the board, in which the hot part replaces the board.
    noise
        Standard deviation of a component of shifts, px; by default estimated from the differences
        between the residuals of neighbouring dots.
    camera_motion
        Also fit a rigid motion of the camera between the two pictures.
    """
    from iriftrace.core.files import whole_file
    from iriftrace.scene.file import require_scene
    from iriftrace.scene.fitted import check_fitted_scene, write_fitted_scene

    check_input(board, measured, scene)
    for xml in (board, scene):
        if xml is not None:
            require_scene(xml)
    check_output(output, "scene.xml", make=True)
    check_fitted_scene(scene or board, output)
    found = _fitted(board, measured, noise, camera_motion, trace)
    _print_fit(found)
    found.require_contained()
    if not found.contained:
        warn(
            f"{found.verdict} The uncertainty of corrections includes the residual; closer members "
            "(other speeds and directions of the draught, finer meshes) make it smaller.",
            stacklevel=1,
        )
    with working("Writing the scene"):
        listed = write_fitted_scene(scene or board, found.serving, output, of_board=scene is None)
    numbers = output.with_name("fit.json")
    with whole_file(numbers) as temporary:
        temporary.write_text(json.dumps(found.as_dict(), indent=2) + "\n", encoding="utf-8")
    say(f"Files: {output} with {len(listed)} members, {numbers}")
    say(f"Correct a cloud with it:  {command_line('correct', 'CLOUD', output)}")


def _fitted(
    board: Path, measured: Path, noise: float | None, camera_motion: bool, trace: TraceOptions
) -> MemberFit:
    """Weights from temperatures in the air, or from shifts of dots."""
    from iriftrace.field.air_temperatures import is_air_temperatures, read_air_temperatures
    from iriftrace.image.measured_shift import read_measured_shift
    from iriftrace.trace.member_fit import fit_members
    from iriftrace.trace.temperature_fit import fit_temperatures

    if is_air_temperatures(measured):
        options = {"--noise": noise, "--camera-motion": camera_motion or None}
        refuse_given(options, f"is about shifts, but {measured} has temperatures; leave it out.")
        temperatures = read_air_temperatures(measured)
        loaded = trace.load(board)
        with working("Fitting the members"):
            return fit_temperatures(loaded, temperatures)
    shifts = read_measured_shift(measured)
    loaded = trace.load(board)
    with working("Fitting the members"):
        return fit_members(loaded, shifts, noise_px=noise, camera_motion=camera_motion)


_WHAT = {"px": "dots", "K": "temperatures"}


def _print_fit(found: MemberFit) -> None:
    """Weights by member, and the residual of the fit."""
    serving = {member.number for member in found.serving}
    members = zip(found.members, found.covariance.diagonal() ** 0.5, found.single, strict=True)
    print_table(
        "Members that reproduce what was measured",
        ("member", "field", "weight", "u", "alone"),
        [
            (one.number, one.label, f"{one.weight:.3f}", f"{u:.3f}", f"{alone:.3g} {found.unit}")
            for one, u, alone in members
            if one.number in serving
        ],
        texts=["field"],
    )
    counts = {"hidden": "hidden", "beside": "next to the board", "lost": "lost"}
    left_out = [f"{found.dots[key]:,} {text}" for key, text in counts.items() if key in found.dots]
    left_out.append(f"{found.dots['outliers']:,} outliers")
    say(
        f"{found.dots['used']:,} of {found.dots['measured']:,} {_WHAT[found.unit]} were used "
        f"({', '.join(left_out)}). Measured rms {found.measured:.3g} {found.unit}, residual "
        f"{found.residual:.3g} {found.unit}, noise {found.noise:.3g} {found.unit}. Effective "
        f"number of members: {found.weights.effective:.3g}."
    )
    if found.motion is not None:
        moved, turned = 1e3 * found.motion[:3], 1e6 * found.motion[3:]
        listed = ", ".join(f"{value:.3g}" for value in moved)
        angles = ", ".join(f"{value:.3g}" for value in turned)
        say(f"Camera between the pictures: moved by {listed} um, turned by {angles} urad.")
    if found.contained:
        say(found.verdict)
