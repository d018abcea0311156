"""The commands ``iriftrace measure`` and ``correct``: clouds of points of two devices."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from iriftrace.cli.console import say, working
from iriftrace.cli.options import (
    Share,
    check_input,
    check_kept,
    check_numbers,
    check_output,
    numbers,
    word_parameter,
)
from iriftrace.cli.trace_options import TraceOptions

if TYPE_CHECKING:
    from iriftrace.scene.load import LoadedScene

System = Annotated[
    Literal["stereo", "fringe", "laser"] | None,
    Parameter(help="Kind of sensor; by default what the id of the scene's second sensor says."),
]
Phase = Annotated[
    Literal["columns", "rows", "both"] | None,
    Parameter(
        help="Lines of the projector that a fringe system measures by; by default those that run "
        "more across the way to the camera."
    ),
]
Features = Annotated[
    list[str] | None,
    Parameter(
        name="--feature",
        negative=(),
        help='Feature to fit: "cylinder:lateral", or "cylinder" for all regions that are one; '
        "repeatable. By default all regions that are planes, cylinders, cones or spheres.",
    ),
]


def _read_gate(text: str, option: str) -> float | None:
    from iriftrace.triangulation.features import check_gate

    gate = None if text.strip().lower() == "none" else numbers(text, 1, option)[0]
    check_gate(gate)
    return gate


Gate = Annotated[
    float | None,
    word_parameter("NUMBER|none", _read_gate),
    Parameter(
        help="Points farther from a fitted feature than this many robust standard deviations are "
        "left out as outliers; none fits all points.",
    ),
]


def measure(
    scene: Path,
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"])] = Path("scan.vtp"),
    system: System = None,
    phase: Phase = None,
    feature: Features = None,
    gate: Gate = 3.5,
    acceptance: Annotated[bool, Parameter(negative=())] = False,
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
        The cloud, .vtp or .ply; its numbers (.json) and picture (.png) go beside it.
    acceptance
        Say the errors that VDI/VDE 2634 tests on the part's spheres and planes: probing error of
        form and of size, sphere-spacing error, flatness error.
    figures
        Draw the errors along the part's normal.
    """
    from iriftrace.scene.file import require_scene

    check_input(scene)
    require_scene(scene)
    check_output(output, "scan.vtp", ".ply")
    check_numbers(output, "iriftrace.scan")
    loaded = trace.load(scene)
    check_kept(output, loaded.part.path)
    write_scan(loaded, output, system, phase, feature, acceptance, figures, gate)


def write_scan(
    loaded: LoadedScene,
    output: Path,
    system: System = None,
    phase: Phase = None,
    feature: Features = None,
    acceptance: bool = False,
    figures: bool = True,
    gate: float | None = 3.5,
) -> None:
    """Simulate the measurement of a scene's two devices, write its files and say what it found."""
    from iriftrace.triangulation.acceptance import acceptance as accepted
    from iriftrace.triangulation.features import check_choices
    from iriftrace.triangulation.scan import measure as simulate

    check_choices(feature or (), loaded.part)
    with working("Measuring"):
        scan = simulate(loaded, system=system, phase=phase)
    features = scan.features(loaded.part, feature or (), gate)
    errors = accepted(features, loaded.part) if acceptance else []
    files = list(scan.save(output, features, errors))
    values = scan.as_dict()
    if figures:
        from iriftrace.figures.scan import scan_figure
        from iriftrace.figures.style import write_figure

        with working("Drawing"):
            write_figure(scan_figure(scan), output.with_suffix(".png"))
        files.append(output.with_suffix(".png"))
    points, error, fit = values["points"], values["error_normal_mm"], values["best_fit"]
    say(
        f"{points['measured']:,} points of {points['pixels']:,} pixels were measured: "
        f"{points['shadow']:,} in shadow, {points['outside_picture']:,} outside the second "
        f"device's picture, {points['out_of_focus']:,} out of its focus, "
        f"{points['several_images']:,} with several images, {points['lost']:,} lost on the way."
    )
    say(
        f"Error along the normal: median {_um(error['median'])}, rms {_um(error['rms'])}, after a "
        f"rigid best fit rms {_um(fit['error_normal_mm']['rms'])}; size of the whole error: 95th "
        f"percentile {_um(values['error_mm']['p95'])}."
    )
    if "members" in values:
        worst = next(m for m in values["members"] if m["number"] == values["worst_member"])
        scatter = values["scatter_normal_mm"]
        say(
            f"These are means over {len(values['members'])} fields; standard deviation from field "
            f"to field: median {_um(scatter['median'])}, 95th percentile {_um(scatter['p95'])}. "
            f"Worst member: {worst['number']} ({worst['label']}), rms "
            f"{_um(worst['error_normal_mm']['rms'])}."
        )
    if scan.system == "stereo":
        say(f"The two lines miss each other by {_um(values['gap_mm']['median'])} (median).")
    _say_field(scan.provenance)
    say("Files: " + ", ".join(map(str, files)))
    _say_features(features, "cold", gate)
    for row in errors:
        value = row["error_mm"]
        say(
            f"{row['error'].capitalize()} ({row['region'] or 'all points'}): "
            f"{_um(value['measured'])} through hot air, {_um(value['cold'])} cold."
        )


def correct(
    cloud: Path,
    scene: Path,
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"])] = Path("corrected.vtp"),
    length_unit: str | None = None,
    columns: Annotated[str | None, Parameter(negative=())] = None,
    cloud_to_part: Path | None = None,
    system: System = None,
    phase: Phase = None,
    feature: Features = None,
    gate: Gate = 3.5,
    field_uncertainty: Share = 0.0,
    trace: TraceOptions = TraceOptions(),
) -> None:
    """Take the air's share out of a measured cloud.

    Correct each scan by itself, before it is merged with others. The scene has the two devices
    where they stood. What was added to each point is written beside it. Of an ensemble of fields
    the mean correction is taken, and its scatter is an uncertainty.

    Example: ``iriftrace correct scan.vtp scene/scene.xml -o corrected.vtp --feature cylinder``

    Parameters
    ----------
    cloud
        Measured points: .ply, .stl, .obj, .vtp, .e57, .xyz, .asc, .txt, .csv or .pts.
    scene
        The scene's XML file.
    output
        The corrected cloud, .vtp or .ply, in mm in the scene's frame; its numbers (.json) go
        beside it.
    length_unit
        Unit of the cloud; by default that in the names of its columns, metre of an .e57, else mm.
    columns
        Columns x, y and z of a text file, .ply or .vtp, by name or by number from 1: "Actual
        X,Actual Y,Actual Z" or "2,3,4". By default those whose names are x, y and z.
    cloud_to_part
        Text file of a 4 x 4 rigid motion from the cloud's frame, in mm, to the scene's.
    field_uncertainty
        Standard uncertainty of the field, as a share of the air's contrast in refractive index,
        "5 %"; the corrections' is the same share of them.
    """
    from iriftrace.geometry.transform import apply, parse_transform, rigid_motion
    from iriftrace.scene.file import require_scene
    from iriftrace.triangulation.cloud import read_cloud
    from iriftrace.triangulation.correct import correct as take_out
    from iriftrace.triangulation.features import check_choices

    check_input(cloud, scene, cloud_to_part)
    require_scene(scene)
    check_output(output, "corrected.vtp", ".ply")
    check_kept(output, cloud)
    check_numbers(output, "iriftrace.correction")
    chosen = None if columns is None else columns.split(",")
    points = read_cloud(cloud, length_unit=length_unit, columns=chosen)
    if cloud_to_part is not None:
        motion = parse_transform(str(cloud_to_part))
        points = apply(rigid_motion(motion, str(cloud_to_part)), points)
    loaded = trace.load(scene)
    check_kept(output, loaded.part.path)
    check_choices(feature or (), loaded.part)
    with working("Correcting"):
        found = take_out(
            points, loaded, system=system, phase=phase, field_uncertainty=field_uncertainty
        )
    features = found.features(loaded.part, feature or (), gate)
    files = found.save(output, features)
    values = found.as_dict()
    counts, error = values["points"], values["error_mm"]
    say(
        f"{counts['corrected']:,} of {counts['measured']:,} points are corrected, by "
        f"{_um(error['median'])} (median; 95th percentile {_um(error['p95'])}). As measured stay "
        f"{counts['far_from_part']:,} far from the part or on its outline, {counts['hidden']:,} "
        f"hidden from a device, {counts['several_images']:,} with several images, "
        f"{counts['outside_field']:,} seen through no hot air, {counts['lost']:,} whose rays were "
        f"lost on the way and {counts['uncertain']:,} whose correction is uncertain by more than "
        "itself. As measured, the cloud lies "
        f"{_um(values['to_part_mm']['median'])} beside the part (median; 95th percentile "
        f"{_um(values['to_part_mm']['p95'])})."
    )
    _say_features(features, "corrected", gate, synthetic=found.state.synthetic)
    if found.state.synthetic:
        say(
            "The air is synthetic, so that the corrections of sizes have no uncertainty: use a "
            "flow solution (iriftrace field simulate)."
        )
    elif found.u_normal is None:
        say(
            "No uncertainty of the correction is stated, because that of the field is not known: "
            'give --field-uncertainty "5 %", or a scene of several states of the air (iriftrace '
            "scene --member)."
        )
    if found.u_normal is not None:
        say(
            "Standard uncertainty of the correction along the normal: "
            f"{_um(values['u_normal_mm']['median'])} (median). That of the air follows from what "
            "is known of the field, that of the fit from the scatter of the points; the sensor's "
            "systematic errors, and what shells and mesh leave, come on top."
        )
    _say_unsteadiness(found.state.unsteadiness, known=bool(found.u_contrast))
    if found.weights is not None and found.weights.covariance is not None:
        say(
            f"The weights of {len(found.weights.weights)} fields were fitted to measured shifts; U "
            "includes their covariance and what the fit left."
        )
    elif found.weights is not None:
        say(
            f"It rests on the scatter of {len(found.weights.weights)} fields; k allows for so few "
            "by Student's t."
        )
    _say_field(found.provenance)
    say("Files: " + ", ".join(map(str, files)))


def _say_field(provenance: dict[str, Any]) -> None:
    """On which field the numbers rest, and what does not fit."""
    assumed = provenance["assumptions"]
    say(f"Field: {assumed['field_origin']}; {assumed['field_source']}.")
    if "field_fit" in assumed:
        say(assumed["field_fit"])


def _say_unsteadiness(unsteadiness: float | None, known: bool) -> None:
    """Whether the uncertainties have that of a field that is not steady."""
    if unsteadiness is None:
        say(
            "The field is NOT STEADY and does not say how much it changes, which is missing from "
            "U: use several states of it (iriftrace scene --member)."
        )
    elif unsteadiness and known:
        say(
            f"The field is NOT STEADY: U includes {unsteadiness:.2g} of the air's contrast "
            "(standard uncertainty) for it."
        )


def _say_features(
    features: list[dict[str, Any]], true: str, gate: float | None, synthetic: bool = False
) -> None:
    """Form and size of features as measured through hot air, and cold or corrected."""
    for row in features:
        where = f" ({row['region']})" if row["region"] else ""
        hot_form, true_form = _um(row["form_mm"]["measured"]), _um(row["form_mm"][true])
        form = f"form deviation {hot_form}, {true} {true_form}"
        if row["left_out"]:
            count = row["points"] + row["left_out"]
            form += (
                f"; {row['left_out']:,} of {count:,} points lie beyond {gate:g} robust standard "
                "deviations and are left out"
            )
        hot, size = row["size_mm"]["measured"], row["size_mm"][true]
        if hot is None:
            say(f"{row['kind'].capitalize()}{where}: {form}.")
            continue
        scatter = row.get("size_scatter_mm")
        more = _uncertainty(row, synthetic) if "fit_uncertainty_mm" in row else ""
        if scatter is not None:
            more = (
                f", with a standard deviation of {_um(scatter)} from field to field and "
                f"{row['worst_size_mm']:.4f} mm by the worst, member {row['worst_member']}"
            )
        say(
            f"{row['kind'].capitalize()}{where}: diameter {hot:.4f} mm as measured through hot "
            f"air, {size:.4f} mm {true}: the air makes it {_um(abs(hot - size))} "
            f"{'smaller' if hot < size else 'larger'}{more}; {form}."
        )


def _uncertainty(row: dict[str, Any], synthetic: bool) -> str:
    """Uncertainties of a corrected size: of the air, of the fit and of both."""
    air, fit, size = row["size_uncertainty_mm"], row["fit_uncertainty_mm"], row["size_mm"]
    if air is not None:
        text = (
            f", U = {_um(air)} (k = {row['coverage_factor']:.3g}) of the air, {_um(fit)} (k = 2) "
            f"of the fit, {_um(row['total_uncertainty_mm'])} together"
        )
    elif synthetic:
        text = f", no uncertainty: synthetic air; U = {_um(fit)} (k = 2) of the fit alone"
    else:
        text = f", U = {_um(fit)} (k = 2) of the fit alone"
    if abs(size["measured"] - size["corrected"]) < fit:
        text += ", more than the air's effect"
    return text


def _um(millimetres: float) -> str:
    return f"{round(1e3 * millimetres, 4):.3g} um"
