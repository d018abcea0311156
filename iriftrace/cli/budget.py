"""The command ``iriftrace budget``: U of a measurement before it is made, by group of inputs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from iriftrace.cli import checks
from iriftrace.cli.answer import Answers, print_groups, say_pose, say_results
from iriftrace.cli.console import field_progress, say, working
from iriftrace.cli.measure import Devices
from iriftrace.cli.options import Output
from iriftrace.cli.trace_options import Tracing, load
from iriftrace.measuring.options import USUAL_DEVICES
from iriftrace.measuring.uncertainty.options import NOTHING_ASKED
from iriftrace.tracing.options import TRACE_AS_STATED

if TYPE_CHECKING:
    from iriftrace.core.plain import JsonObject
    from iriftrace.measuring.options import MeasureOptions
    from iriftrace.measuring.uncertainty.inputs import Inputs
    from iriftrace.measuring.uncertainty.options import AnswerOptions
    from iriftrace.tracing.scene import Scene


def budget(
    scene: Path,
    *,
    output: Output | None = None,
    answers: Answers = NOTHING_ASKED,
    devices: Devices = USUAL_DEVICES,
    trace: Tracing = TRACE_AS_STATED,
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

    checks.scenes(scene)
    checks.output(output, "budget.json")
    loaded = load(scene, trace)
    if loaded.second is None:
        values = _of_camera(loaded, answers.inputs)
    else:
        values = _of_features(loaded, answers, devices)
    if output is not None:
        write_json(output, values)
        say(f"Files: {output}")


def _of_features(scene: Scene, answers: AnswerOptions, devices: MeasureOptions) -> JsonObject:
    from iriftrace.cli.triangulation_text import placed_names, say_group
    from iriftrace.figures.describe_scan import describe
    from iriftrace.measuring.features.choice import checked_choices
    from iriftrace.measuring.two_devices.budget import feature_budget

    inputs, tolerances = answers.inputs, answers.tolerances
    chosen = checked_choices(devices.feature or (), scene.part)
    with field_progress() as progress:
        found = feature_budget(
            scene,
            inputs,
            choices=chosen,
            tolerances=tolerances,
            gate=devices.gate,
            system=devices.system,
            phase=devices.phase,
            progress=progress,
        )
    values = {
        **found.correction.as_dict(),
        "features": [one.as_dict() for one in found.features],
        "relations": [one.as_dict() for one in found.relations],
    }
    rows = describe(values, placed_names(scene.part))
    say_results(rows)
    say_group(rows, "warning")
    asked = [one for one in found.features if one.name in tolerances]
    for one in (asked or found.features)[: max(1, len(asked))]:
        if one.size.uncertainty is not None:
            print_groups(f"U of {one.name} by group", one.size.uncertainty, one.size.unit)
    unchecked = found.mixture_unchecked
    if unchecked:
        say(f"Mixture of members not checked by traces: {unchecked}")
    return {**values, "mixture_unchecked": unchecked, "schema": SCHEMA}


def _of_camera(scene: Scene, inputs: Inputs) -> JsonObject:
    from iriftrace.core.plain import plain
    from iriftrace.measuring.uncertainty.displacement import render_with_uncertainty

    with working("Tracing"):
        found = render_with_uncertainty(scene, inputs)
    say_pose(found)
    median = found.displacement_mm["median"]
    print_groups("Median displacement: U by group", median, "mm")
    header = found.rendering.image.header
    return {
        **{key: header[key] for key in ORIGIN if key in header},
        "schema": SCHEMA,
        "inputs": plain(inputs),
        "displacement": {k: one.as_dict("mm") for k, one in found.displacement_mm.items()},
        "shift": {k: one.as_dict("px") for k, one in found.shift_px.items()},
    }


ORIGIN = ("version", "scene", "engine", "wavelength_nm", "field", "ensemble", "part", "assumptions")
"""Keys of a picture's header that say what a budget rests on."""

SCHEMA = "iriftrace.budget/1"
"""Value of ``schema`` in the JSON."""
