"""The command ``iriftrace budget``: what U a measurement will have, and of what it consists."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from iriftrace.cli import checks
from iriftrace.cli.answer import (
    Stated,
    Tolerances,
    print_groups,
    say_answers,
    say_influences,
)
from iriftrace.cli.console import say, working
from iriftrace.cli.measure import Features, Gate
from iriftrace.cli.options import Output
from iriftrace.cli.trace_options import TraceOptions

if TYPE_CHECKING:
    from iriftrace.core.plain import JsonObject
    from iriftrace.measuring.uncertainty.inputs import Inputs
    from iriftrace.tracing.scene import Scene

MOST = 8
"""Number of features that are printed."""


def budget(
    scene: Path,
    *,
    output: Output | None = None,
    uncertainty: Stated = "",
    feature: Features = None,
    tolerance: Tolerances = None,
    gate: Gate = 3.5,
    trace: TraceOptions = TraceOptions(),
) -> None:
    """State the uncertainty of a measurement before it is made, by group of inputs.

    For two devices: of the diameters and distances that a simulated measurement has after its
    correction, with the verdict on a tolerance. For one camera: of the displacement and the shift.
    The air's group comes from the scene's members; wall, ambient air and pressure from members
    that were solved again (``iriftrace field simulate``), or else from the similarity of a wall's
    layer.

    Example: ``iriftrace budget scene/scene.xml --uncertainty "wall 10 K, sensor 8 um"``

    Parameters
    ----------
    scene
        The scene's XML file.
    output
        The numbers, .json; by default they are only printed.
    """
    from iriftrace.core.files import write_json
    from iriftrace.measuring.uncertainty.inputs import Inputs

    checks.scenes(scene)
    checks.output(output, "budget.json")
    inputs = Inputs.of(uncertainty)
    loaded = trace.load(scene)
    if loaded.second is None:
        values = _of_camera(loaded, inputs)
    else:
        values = _of_features(loaded, inputs, feature or [], tolerance or [], gate)
    if output is not None:
        write_json(output, values)
        say(f"Files: {output}")


def _of_features(
    scene: Scene, inputs: Inputs, choices: list[str], tolerance: list[str], gate: float | None
) -> JsonObject:
    from iriftrace.measuring.features.choice import checked_choices
    from iriftrace.measuring.two_devices.budget import feature_budget
    from iriftrace.measuring.uncertainty.tolerances import tolerances_of

    limits = tolerances_of(tolerance)
    chosen = checked_choices(choices, scene.part)
    with working("Measuring"):
        found = feature_budget(scene, inputs, choices=chosen, tolerances=limits, gate=gate)
    named = [(f"Diameter of {one.name}", one.size) for one in found.features]
    named += [(" and ".join(map(str, one.regions)), one.value) for one in found.relations]
    say_answers(named, MOST)
    stated = [(name, value) for name, value in named if value.uncertainty is not None]
    for name, value in stated[:1]:
        assert value.uncertainty is not None
        print_groups(f"{name}: U by group", value.uncertainty, value.unit)
        say_influences(value.uncertainty)
    return {
        **found.correction.as_dict(),
        "schema": SCHEMA,
        "features": [one.as_dict() for one in found.features],
        "relations": [one.as_dict() for one in found.relations],
    }


def _of_camera(scene: Scene, inputs: Inputs) -> JsonObject:
    from iriftrace.core.plain import plain
    from iriftrace.measuring.uncertainty.displacement import render_with_uncertainty

    with working("Tracing"):
        found = render_with_uncertainty(scene, inputs)
    for name, one in found.displacement_mm.items():
        say(
            f"Displacement, {name}: {1e3 * one.value:.4g} um, U = "
            f"{'at least ' if one.missing else ''}{1e3 * one.expanded:.2g} um; shift "
            f"{found.shift_px[name].value:.3g} px, U = {found.shift_px[name].expanded:.2g} px."
        )
    median = found.displacement_mm["median"]
    print_groups("Median displacement: U by group", median, "mm")
    say_influences(median)
    return {
        "schema": SCHEMA,
        "scene": found.rendering.image.header["scene"],
        "inputs": plain(inputs),
        "displacement": {k: one.as_dict("mm") for k, one in found.displacement_mm.items()},
        "shift": {k: one.as_dict("px") for k, one in found.shift_px.items()},
    }


SCHEMA = "iriftrace.budget/1"
"""Value of ``schema`` in the JSON."""
