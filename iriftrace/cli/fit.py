"""The command ``iriftrace fit``: weights of an ensemble's members from measurements."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from iriftrace.cli import checks
from iriftrace.cli.console import command_line, print_table, say, working
from iriftrace.cli.options import Flag, Output
from iriftrace.cli.shift_options import WithoutZeros, left_out, read_shifts
from iriftrace.cli.trace_options import Tracing, load
from iriftrace.core.errors import refuse_given, warn
from iriftrace.core.units import counted
from iriftrace.tracing.options import TRACE_AS_STATED, TraceOptions

if TYPE_CHECKING:
    from iriftrace.measuring.fit.member_fit import MemberFit
    from iriftrace.tracing.scene import Scene


def fit(
    board: Path,
    measured: Path,
    *,
    output: Output,
    view: list[tuple[Path, Path]] | None = None,
    scene: Path | None = None,
    noise: float | None = None,
    camera_motion: Flag = False,
    free: str | None = None,
    without_zeros: WithoutZeros = False,
    trace: Tracing = TRACE_AS_STATED,
) -> None:
    """Find the measured air: weights of an ensemble's members from shifts or temperatures.

    Weights are not negative and sum to 1. They minimise the difference between the members'
    predictions and the measured values. The new scene has the members that matter, with their
    weights and the uncertainty of the fit; ``measure`` and ``correct`` use both. If the measured
    air is outside the members, the uncertainty grows, and results and a warning say so.

    Example: ``iriftrace fit board/scene.xml shifts.csv -o fitted/scene.xml``

    Parameters
    ----------
    board
        The scene of the measurement: an ensemble (--member) whose part is the board, with the hot
        part as the first --blocker; or the hot part, for marks on it and for thermocouples.
    measured
        Dots in the cold picture and their shifts to the hot one: .csv with the columns u, v, du, dv
        in pixels of the camera's full resolution (pixel centres are whole numbers, as OpenCV
        counts), or a map as for ``compare``, which says how places are marked that were not found.
        Or temperatures in the air: .csv with the columns x,
        y, z (mm), T (K) or T (degC), and U, their expanded uncertainty, if it is known.
    output
        XML file of the weighted scene, in a folder of its own; the fit's numbers (fit.json), and
        what it leaves of the shift of each dot (fit.vtp, fit_2.vtp of a second view ...), go next
        to it.
    view
        Scene and shifts of a further board or camera in the same air, with the same members
        (--view BOARD_2 SHIFTS_2); repeatable. One view hardly sees how far a plume leans along its
        own line of sight.
    scene
        Scene of the hot part with the same fields and the measuring devices, to be weighted; by
        default that of the first argument. If its part is a board, outside the hot air, the hot
        part replaces it.
    noise
        Standard deviation of a component of shifts, px; by default estimated from the differences
        between the residuals of neighbouring dots.
    camera_motion
        Also fit a rigid motion of the camera between the two pictures.
    free
        Numbers of the air that are fitted next to the weights, for shifts: contrast (a fraction),
        lean (of the air above the hot part, mm/mm) and wall (K, by a member that varies it), such
        as contrast,lean. The scene may have a single field then.
    """
    from iriftrace.core.files import write_json
    from iriftrace.medium.part_fit import in_air
    from iriftrace.tracing.fitted import check_fitted_output, check_fitted_scene, write_fitted_scene

    views = [(board, measured), *(view or [])]
    checks.inputs(*(shifts for _, shifts in views))
    checks.scenes(*(xml for xml, _ in views), scene)
    checks.output(output, "scene.xml", make=True)
    check_fitted_output(scene or board, output)
    if free is not None:
        _fit_free(free, views, scene, output, noise, camera_motion, without_zeros, trace)
        return
    check_fitted_scene(scene or board)
    found, loaded = _fitted(views, noise, camera_motion, without_zeros, trace)
    _print_fit(found)
    if not found.contained:
        warn(f"{found.verdict} {found.solve_next}")
    blocked = scene is None and bool(loaded.blockers)
    of_board = blocked and not in_air(loaded.air.states[0].cells, loaded.part)
    with working("Writing the scene"):
        listed = write_fitted_scene(
            scene or board,
            found.serving,
            output,
            of_board=of_board,
            outside=found.weights.outside,
        )
    if of_board:
        say("The board's first blocker, the hot part, is the part of the fitted scene.")
    numbers, values = output.with_name("fit.json"), found.as_dict()
    write_json(numbers, values)
    files = [numbers]
    for place, dots in enumerate(filter(None, (one.dots for one in found.views)), start=1):
        cloud = output.with_name("fit.vtp" if place == 1 else f"fit_{place}.vtp")
        files += dots.save(cloud, values)
    listing = ", ".join(dict.fromkeys(map(str, files)))
    say(f"Files: {output} with {len(listed)} members, {listing}")
    say(f"Correct a cloud with it:  {command_line('correct', 'CLOUD', output)}")


def _fit_free(
    free: str,
    views: list[tuple[Path, Path]],
    scene: Path | None,
    output: Path,
    noise: float | None,
    camera_motion: bool,
    without_zeros: bool,
    trace: TraceOptions,
) -> None:
    """Fit numbers of the air, write the scene of the changed air, and print the numbers."""
    from attrs import evolve

    from iriftrace.core.files import write_json
    from iriftrace.measuring.fit.free_fit import UNITS, fit_free
    from iriftrace.medium.part_fit import in_air
    from iriftrace.tracing.file import parameters_of, read_xml
    from iriftrace.tracing.scene import Scene

    names = [name.strip() for name in free.split(",")]
    (board, measured), *others = [
        (load(one, trace), read_shifts(shifts, without_zeros)) for one, shifts in views
    ]
    path, whole = scene or views[0][0], trace
    if "scale" in parameters_of(read_xml(path)):
        whole = evolve(trace, define=[*(trace.define or ()), "scale=1"])
    seen, target = board if scene is None else load(path, trace), load(path, whole)
    with working("Fitting the air"):
        found = fit_free(
            board, measured, names, others=others, noise_px=noise, camera_motion=camera_motion
        )
    changed = Scene(
        part=target.part,
        air=found.air,
        camera=target.camera,
        second=target.second,
        second_id=target.second_id,
        wavelength_nm=target.wavelength_nm,
        blockers=target.blockers,
        variant=target.variant,
    )
    if scene is None and board.blockers and not in_air(board.air.states[0].cells, board.part):
        changed = evolve(changed, part=board.blockers[0], blockers=board.blockers[1:])
        say("The board's first blocker, the hot part, is the part of the fitted scene.")
    with working("Writing the scene"):
        changed.save(output, scale=seen.camera.resolution[0] / target.camera.resolution[0])
    numbers = output.with_name("fit.json")
    write_json(numbers, found.as_dict())
    rows = [
        (name, f"{value:.4g}", f"{found.u[name]:.2g}", UNITS[name])
        for name, value in found.values.items()
    ]
    print_table("Numbers of the air closest to what was measured", _HEADINGS, rows)
    say(
        f"Residual {found.before:.3g} px without these numbers, {found.residual:.3g} px with them, "
        f"noise {found.noise:.3g} px."
    )
    say(f"Files: {output}, {numbers}")
    say(f"Correct a cloud with it:  {command_line('correct', 'CLOUD', output)}")


_HEADINGS = ("number", "value", "u", "unit")


def _fitted(
    views: list[tuple[Path, Path]],
    noise: float | None,
    camera_motion: bool,
    without_zeros: bool,
    trace: TraceOptions,
) -> tuple[MemberFit, Scene]:
    """Weights from temperatures in the air, or from shifts of dots, and the first scene."""
    from iriftrace.io.air_temperatures import is_air_temperatures, read_air_temperatures
    from iriftrace.measuring.fit.shift_fit import fit_members
    from iriftrace.measuring.fit.temperature_fit import fit_temperatures

    board, measured = views[0]
    if is_air_temperatures(measured):
        options = {
            "noise": noise,
            "camera_motion": camera_motion or None,
            "view": views[1:] or None,
            "without_zeros": without_zeros or None,
        }
        reason = f"is about shifts, but {measured} has temperatures; leave it out."
        refuse_given(options, reason, "options.not_together")
        temperatures = read_air_temperatures(measured)
        loaded = load(board, trace)
        with working("Fitting the members"):
            return fit_temperatures(loaded, temperatures), loaded
    first, *others = [
        (load(one, trace), read_shifts(shifts, without_zeros)) for one, shifts in views
    ]
    with working("Fitting the members"):
        found = fit_members(*first, others=others, noise_px=noise, camera_motion=camera_motion)
    return found, first[0]


def _print_fit(found: MemberFit) -> None:
    """Weights by member, and the residual of the fit."""
    serving = {member.number for member in found.serving}
    members = zip(found.members, found.covariance.diagonal() ** 0.5, found.single, strict=True)
    print_table(
        "Members of the mixture closest to what was measured",
        ("member", "field", "weight", "u", "alone"),
        [
            (one.number, one.label, f"{one.weight:.3f}", f"{u:.3f}", f"{alone:.3g} {found.unit}")
            for one, u, alone in members
            if one.number in serving and one.variation is None
        ],
        texts=["field"],
    )
    dots = found.dots
    counts = {"hidden": "hidden", "beside": "next to the board", "lost": "lost"}
    unused = [left_out(dots["failed"], dots["zeros"])] if "failed" in dots else []
    unused += [f"{dots[key]:,} {text}" for key, text in counts.items() if key in dots]
    unused.append(counted(dots["outliers"], "outlier"))
    total = dots["measured"] + dots.get("failed", 0) + dots.get("zeros", 0)
    what = "dots" if found.unit == "px" else "temperatures"
    more = found.residual > 1.001 * found.single.min()
    few = " (by its degrees of freedom, so it can exceed that of a member alone)" if more else ""
    say(
        f"{dots['used']:,} of {total:,} {what} were used "
        f"({', '.join(unused)}). Measured rms {found.measured:.3g} {found.unit}, residual "
        f"{found.residual:.3g} {found.unit}{few}, noise {found.noise:.3g} {found.unit} "
        f"({found.noise_source}), so u of the weights by noise is multiplied by {found.birge:.3g}. "
        f"Effective number of members: {found.weights.effective:.3g}."
    )
    for one in found.views:
        if len(found.views) > 1:
            say(
                f"{one.origin.path}: residual {one.residual:.3g} {found.unit}, "
                f"noise {one.noise:.3g} {found.unit}."
            )
        if one.motion is not None:
            moved, turned = 1e3 * one.motion[:3], 1e6 * one.motion[3:]
            listed = ", ".join(f"{value:.3g}" for value in moved)
            angles = ", ".join(f"{value:.3g}" for value in turned)
            say(f"Camera between the pictures: moved by {listed} um, turned by {angles} urad.")
    if found.contained:
        say(found.verdict)
