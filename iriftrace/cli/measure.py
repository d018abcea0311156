"""The command ``iriftrace measure``: the cloud that two devices measure through hot air."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from cyclopts import Parameter

from iriftrace.cli import checks
from iriftrace.cli.console import drawn, say, working
from iriftrace.cli.options import Flag, Output, numbers, word_parameter
from iriftrace.cli.ray import write_rays
from iriftrace.cli.trace_options import TraceOptions
from iriftrace.cli.triangulation_text import (
    placed_names,
    print_regions,
    say_features,
    say_field,
    say_relations,
    um,
)
from iriftrace.core.engines import engine_named
from iriftrace.core.units import counted

if TYPE_CHECKING:
    from iriftrace.measuring.two_devices.scan import Scan
    from iriftrace.tracing.scene import Scene

_USUAL = 0.999
"""Fraction of the points to whose largest error that of all is compared."""

_FAR = 3.0
"""Ratio of these errors from which a comparison is advised; it changes no number."""

System = Annotated[
    Literal["stereo", "fringe", "laser"] | None,
    Parameter(help="Kind of sensor; by default that of the id of the scene's second sensor."),
]
Phase = Annotated[
    Literal["columns", "rows", "both"] | None,
    Parameter(
        help="Lines of the projector that a fringe system measures by; by default those that run "
        "more across the direction to the camera."
    ),
]
Features = Annotated[
    list[str] | None,
    Parameter(
        name="--feature",
        help='Feature to fit: "cylinder:lateral", or "cylinder" for all regions that are one; '
        "repeatable. By default all regions that are planes, cylinders, cones or spheres.",
    ),
]


def _read_gate(text: str, option: str) -> float | None:
    from iriftrace.measuring.features.outliers import check_gate

    gate = None if text.strip().lower() == "none" else numbers(text, 1, option)[0]
    check_gate(gate)
    return gate


Gate = Annotated[
    float | None,
    word_parameter("NUMBER|none", _read_gate),
    Parameter(
        help="Points farther from a fitted feature than this many robust standard deviations are "
        "left out as outliers; none fits all points."
    ),
]


def measure(
    scene: Path,
    *,
    output: Output = Path("scan.vtp"),
    system: System = None,
    phase: Phase = None,
    feature: Features = None,
    gate: Gate = 3.5,
    acceptance: Flag = False,
    trace: TraceOptions = TraceOptions(),
    figures: bool = True,
) -> None:
    """Simulate what two devices measure of the part through hot air: a cloud and its errors.

    The scene's first sensor is the camera; its second one, with the id camera_2, projector or
    laser, completes a stereo, fringe or laser sensor.

    Example: ``iriftrace measure scene/scene.xml -o scan.vtp --feature cylinder``

    Parameters
    ----------
    scene
        The scene's XML file.
    output
        The cloud, .vtp, .ply, .e57, .asc, .xyz, .txt or .csv; its numbers (.json) and picture
        (.png) go next to it.
    acceptance
        Print the errors that VDI/VDE 2634 tests on the part's spheres and planes: probing error of
        form and of size, sphere-spacing error, flatness error.
    figures
        Draw the errors along the part's normal.
    """
    from iriftrace.io.lost_rays import rays_file_of

    checks.scenes(scene)
    checks.cloud_output(output, "scan.vtp")
    checks.numbers(output, "iriftrace.scan")
    checks.numbers(rays_file_of(output), "iriftrace.rays")
    loaded = trace.load(scene)
    checks.kept(output, loaded.part.path)
    write_scan(loaded, output, system, phase, feature, acceptance, figures, gate)


def write_scan(
    loaded: Scene,
    output: Path,
    system: System = None,
    phase: Phase = None,
    feature: Features = None,
    acceptance: bool = False,
    figures: bool = True,
    gate: float | None = 3.5,
) -> None:
    """Simulate the measurement of a scene's two devices, write its files and print results."""
    from iriftrace.measuring.features.choice import checked_choices
    from iriftrace.measuring.two_devices.acceptance import acceptance as accepted
    from iriftrace.measuring.two_devices.measure import measure as simulate

    choices = checked_choices(feature or (), loaded.part)
    with working("Measuring"):
        scan = simulate(loaded, system=system, phase=phase)
    features = scan.features(loaded.part, choices, gate)
    errors = accepted(features, loaded.part) if acceptance else ()
    regions = scan.regions(loaded.part)
    related = scan.relations(features)
    files = list(scan.save(output, features, errors, regions, related))
    if figures:
        from iriftrace.figures.scan import scan_figure

        files.append(drawn(lambda: scan_figure(scan, loaded.part), output.with_suffix(".png")))
    files += write_rays(output, scan.lost_rays)
    _say_errors(scan)
    say_field(scan.provenance)
    say("Files: " + ", ".join(map(str, files)))
    _say_far_points(scan)
    say_features(features, loaded.part, "cold", gate)
    say_relations(related, loaded.part, "cold")
    print_regions(regions, loaded.part, "Error along the normal by region")
    names = placed_names(loaded.part)
    for tested in errors:
        measured, cold = (um(tested.error_mm[name]) for name in ("measured", "cold"))
        # Of two regions that have a distance, the names are in the text.
        where = names.get(tested.region, tested.region or "all points")
        say(f"{tested.error.capitalize()} ({where}): {measured} through hot air, {cold} cold.")


def _say_far_points(scan: Scan) -> None:
    """Say that few points, for which shells are too coarse, determine form deviations."""
    size = np.abs(scan.error_normal)
    usual = float(np.quantile(size, _USUAL))
    engine = engine_named(scan.provenance["engine"])
    if not engine.through_cells and size.max() > _FAR * usual:
        say(
            f"{counted(int((size > _FAR * usual).sum()), 'point')} of {len(size):,} have errors of "
            f"up to {um(size.max())}, while {_USUAL:.1%} have at most {um(usual)}: the shells may "
            "be too coarse for them, and form deviations depend on such points; compare with "
            "--engine cells."
        )


def _say_errors(scan: Scan) -> None:
    """Print how many points were measured, and their errors."""
    values = scan.as_dict()
    points, error, fit = values["points"], values["error_normal_mm"], values["best_fit"]
    say(
        f"{points['measured']:,} points of {points['pixels']:,} pixels were measured: "
        f"{points['not_seen']:,} pixels see nothing of the part in focus, {points['shadow']:,} are "
        f"in shadow, {points['outside_picture']:,} outside the second device's picture, "
        f"{points['out_of_focus']:,} out of its focus, {points['several_images']:,} with several "
        f"images, {points['lost']:,} lost on the way."
    )
    say(
        f"Error along the normal: median {um(error['median'])}, rms {um(error['rms'])}, after a "
        f"rigid best fit rms {um(fit['error_normal_mm']['rms'])}; size of the whole error: 95th "
        f"percentile {um(values['error_mm']['p95'])}."
    )
    if "members" in values:
        worst = next(m for m in values["members"] if m["number"] == values["worst_member"])
        scatter = values["scatter_normal_mm"]
        say(
            f"These are means over {len(values['members'])} fields; standard deviation from field "
            f"to field: median {um(scatter['median'])}, 95th percentile {um(scatter['p95'])}. "
            f"Worst member: {worst['number']} ({worst['label']}), rms "
            f"{um(worst['error_normal_mm']['rms'])}."
        )
    if scan.system == "stereo":
        say(f"The two lines miss each other by {um(values['gap_mm']['median'])} (median).")
