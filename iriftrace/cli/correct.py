"""The command ``iriftrace correct``: a measured cloud without the refraction error."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from iriftrace.cli import checks
from iriftrace.cli.answer import Answers, say_results
from iriftrace.cli.console import say, working, written_figure
from iriftrace.cli.measure import Devices
from iriftrace.cli.options import Flag, Output
from iriftrace.cli.trace_options import Tracing, load
from iriftrace.core.errors import InputError
from iriftrace.measuring.options import USUAL_DEVICES
from iriftrace.measuring.uncertainty.options import NOTHING_ASKED
from iriftrace.tracing.options import TRACE_AS_STATED

if TYPE_CHECKING:
    from iriftrace.measuring.two_devices.correction import Correction


def correct(
    cloud: Path,
    scene: Path,
    *,
    output: Output = Path("corrected.vtp"),
    length_unit: str | None = None,
    columns: str | None = None,
    cloud_to_part: Path | None = None,
    in_cloud_frame: Flag = False,
    devices: Devices = USUAL_DEVICES,
    answers: Answers = NOTHING_ASKED,
    trace: Tracing = TRACE_AS_STATED,
    figures: bool = True,
) -> None:
    """Remove the refraction error from a measured cloud.

    Correct each scan by itself, before it is merged with others. The scene has the two devices
    where they stood. The correction of each point is written as well. For an ensemble of fields
    the correction is the mean over its members, and its scatter is an uncertainty.

    Example: ``iriftrace correct scan.vtp scene/scene.xml -o corrected.vtp --feature cylinder``

    Parameters
    ----------
    cloud
        Measured points: .ply, .pcd, .stl, .obj, .vtp, .e57, .xyz, .asc, .txt, .csv or .pts.
    scene
        The scene's XML file.
    output
        The corrected cloud, .vtp, .ply, .e57, .asc, .xyz, .txt or .csv, in mm in the scene's frame:
        all rows of the measured cloud in their order, with their further columns and the correction
        of each; its numbers (.json) are written next to it.
    length_unit
        Unit of the cloud; by default that which it states, metre for an .e57, else mm (a .pcd of a
        robot is often in m).
    columns
        Columns x, y and z of a text file, .ply, .pcd or .vtp, by name or by number from 1: "Actual
        X,Actual Y,Actual Z" or "2,3,4". By default those whose names are x, y and z, or the first
        three of an .xyz, .asc or .pts without names.
    cloud_to_part
        Text file of a 4 x 4 rigid motion from the cloud's frame, in mm, to the scene's.
    in_cloud_frame
        Write the corrected points in the frame and unit of the measured cloud.
    figures
        Draw the corrections, and the deviation from the part, into a .png next to the output.
    """
    from iriftrace.cli.triangulation_text import placed_names, say_group
    from iriftrace.core.mesh.transform import apply, read_motion
    from iriftrace.figures.describe_scan import describe
    from iriftrace.io.clouds import read_cloud
    from iriftrace.measuring.features.choice import checked_choices
    from iriftrace.measuring.two_devices.correct import correct as take_out
    from iriftrace.measuring.two_devices.placement import remedy

    checks.inputs(cloud)
    checks.scenes(scene)
    checks.inputs(cloud_to_part)
    motion = None if cloud_to_part is None else read_motion(cloud_to_part)
    checks.cloud_output(output, "corrected.vtp")
    checks.kept(output, cloud)
    checks.numbers(output, "iriftrace.correction")
    chosen = None if columns is None else columns.split(",")
    read = read_cloud(cloud, length_unit=length_unit, columns=chosen)
    points = read.points if motion is None else apply(motion, read.points)
    loaded = load(scene, trace)
    checks.kept(output, loaded.part.path)
    choices = checked_choices(devices.feature or (), loaded.part)
    inputs, tolerances = answers.inputs, answers.tolerances
    try:
        with working("Correcting"):
            found = take_out(
                points,
                loaded,
                system=devices.system,
                phase=devices.phase,
                inputs=inputs,
                pixels=read.pixels,
            )
    except InputError as error:
        if advice := remedy(read.points, read.unit, motion, loaded.part):
            raise InputError(
                f"{cloud} does not lie on the part, but would with {advice}.", code=error.code
            ) from None
        raise
    features = found.features(loaded.part, choices, devices.gate, tolerances=tolerances)
    related = found.relations(features)
    regions = found.regions(loaded.part)
    saved, numbers = found.save(
        output, features, regions, related, cloud=read, motion=motion, in_cloud_frame=in_cloud_frame
    )
    files = [saved, numbers]
    if figures:
        from iriftrace.figures.scan import correction_figure

        figure = partial(correction_figure, found, loaded.part, loaded.camera)
        files.append(written_figure(figure, output.with_suffix(".png")))
    values = found.values(features, regions, related, cloud=read, in_cloud_frame=in_cloud_frame)
    rows = describe(values, placed_names(loaded.part))
    say_group(rows, "points moved")
    say_results(rows)
    say_group(rows, "warning")
    _say_how_to_know(found)
    say("Files: " + ", ".join(map(str, files)))


def _say_how_to_know(found: Correction) -> None:
    """State with what the air's part of U would be known."""
    from iriftrace.measuring.uncertainty.air_groups import AIR

    if AIR not in found.groups.missing:
        return
    if found.groups.synthetic:
        say(
            "The air comes from a formula, so its part of U is not known, even with stated "
            "uncertainties: use a flow solution."
        )
    else:
        say(
            "The air's part of U is not known, and nothing is decided: solve the flow in several "
            "states of the hall (iriftrace field simulate --draughts), make the scene of them "
            '(iriftrace scene --member), or state it (--uncertainty "air 5 %").'
        )
