"""The command ``iriftrace correct``: a measured cloud without the refraction error."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from iriftrace.cli import checks
from iriftrace.cli.console import drawn, say, working
from iriftrace.cli.groups import group
from iriftrace.cli.measure import Devices
from iriftrace.cli.options import Flag, Output, read_as_word
from iriftrace.cli.trace_options import Tracing, load
from iriftrace.core.errors import InputError
from iriftrace.measuring.options import NONE_STATED, USUAL, Kelvins, Uncertainties
from iriftrace.tracing.options import AS_STATED

if TYPE_CHECKING:
    from iriftrace.measuring.features.fitted import FittedFeature
    from iriftrace.measuring.two_devices.correction import Correction
    from iriftrace.part.growth import Growth


read_as_word(Kelvins, "NUMBER K")


def correct(
    cloud: Path,
    scene: Path,
    *,
    output: Output = Path("corrected.vtp"),
    length_unit: str | None = None,
    columns: str | None = None,
    cloud_to_part: Path | None = None,
    in_cloud_frame: Flag = False,
    devices: Devices = USUAL,
    uncertainties: Annotated[Uncertainties, group(Uncertainties)] = NONE_STATED,
    trace: Tracing = AS_STATED,
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
    from iriftrace.cli.triangulation_text import (
        placed_names,
        print_regions,
        say_features,
        say_group,
        say_points,
        say_relations,
    )
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
    try:
        with working("Correcting"):
            found = take_out(
                points,
                loaded,
                system=devices.system,
                phase=devices.phase,
                uncertainties=uncertainties,
                pixels=read.pixels,
            )
    except InputError as error:
        if advice := remedy(read.points, read.unit, motion, loaded.part):
            raise InputError(
                f"{cloud} does not lie on the part, but would with {advice}.", code=error.code
            ) from None
        raise
    features = found.features(loaded.part, choices, devices.gate)
    related = found.relations(features)
    regions = found.regions(loaded.part)
    saved, numbers = found.save(
        output, features, regions, related, cloud=read, motion=motion, in_cloud_frame=in_cloud_frame
    )
    files = [saved, numbers]
    if figures:
        from iriftrace.figures.scan import correction_figure

        figure = partial(correction_figure, found, loaded.part, loaded.camera)
        files.append(drawn(figure, output.with_suffix(".png")))
    rows = describe(json.loads(numbers.read_text(encoding="utf-8")), placed_names(loaded.part))
    say_points(rows)
    say_features(rows, "corrected", devices.gate)
    say_relations(rows, "corrected")
    print_regions(rows, "Refraction error along the normal by region, removed")
    _say_expansion(found.growth, features)
    say_group(rows, "uncertainty")
    _say_uncertainty(found)
    say_group(rows, "field")
    say("Files: " + ", ".join(map(str, files)))


def _say_expansion(growth: Growth | None, features: Sequence[FittedFeature]) -> None:
    """State the temperature for which sizes hold, and uncertainties missing at another one."""
    stated = [feature.size.uncertainty for feature in features if feature.size.uncertainty]
    if growth is None and stated:
        say(
            "Sizes hold at the temperature that the part had when it was measured; for those at 20 "
            "degC make the scene with --expansion and --hot-temperature."
        )
    if any("expansion" in u.missing for u in stated):
        say(
            "U does not contain expansion and temperature of the part: give both "
            "--expansion-uncertainty and --temperature-uncertainty."
        )


def _say_uncertainty(found: Correction) -> None:
    """State what the uncertainties contain, and with what more of them would be known."""
    if found.state.synthetic:
        say("To know it, use a flow solution (iriftrace field simulate).")
    elif found.u_normal is None:
        say(
            'To know it, give --field-uncertainty "5 %", or a scene of several states of the air '
            "(iriftrace scene --member)."
        )
    unsteadiness = found.state.unsteadiness
    if unsteadiness is None:
        say(
            "The field is NOT STEADY and does not state how much it changes, which is missing from "
            "U: use several states of it (iriftrace scene --member)."
        )
    elif unsteadiness and found.u_contrast:
        say(
            f"The field is NOT STEADY: U includes {unsteadiness:.2g} of the air's contrast "
            "(standard uncertainty) for it."
        )
    if found.weights is not None and found.weights.covariance is not None:
        say(
            f"The weights of {len(found.weights.weights)} fields were fitted to a measurement; U "
            "includes their covariance and the residual of the fit."
        )
    elif found.weights is not None:
        say(
            f"It rests on the scatter of {len(found.weights.weights)} fields; k allows for so few "
            "by Student's t."
        )
