"""Uncertainty of a measurement and its correction, from several fields or a stated one.

Against each member by itself, NumPy's standard deviations, and proportionality to the contrast.
"""

import json
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.measuring.features.fit import fit_feature
from iriftrace.measuring.features.quantity import Quantity, WorstMember
from iriftrace.measuring.two_devices.correct import correct
from iriftrace.measuring.two_devices.correction_status import CorrectionStatus
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.measuring.two_devices.scan import ScanStatus
from iriftrace.measuring.uncertainty.air_groups import AIR, CONTRAST, UNSTEADY, AirGroups
from iriftrace.measuring.uncertainty.inputs import Inputs
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.shells.stack import ShellStack
from iriftrace.medium.shells.table import AirStatement
from iriftrace.medium.source import FieldFacts, FieldKind
from iriftrace.part.part import Part
from iriftrace.scenes.analytic import concentric_cylinders, slab
from iriftrace.tracing.compiled import Held
from iriftrace.tracing.hot_air import AirState
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.scene import Scene
from iriftrace.tracing.write import write_ensemble_scene
from iriftrace.tracing.xml import SceneSettings
from validation.inputs.cameras import camera_at
from validation.inputs.shell_fields import scaled

SHARES = np.array((-0.1, 0.0, 0.15))
"""Relative change of the contrast in each member from the undisturbed one."""

CAMERA, PROJECTOR = (
    camera_at((x, 1.0, 150.0), up=(0.0, 1.0, 0.0), focal_length_mm=20.0, resolution=(30, 25))
    for x in (-60.0, 40.0)
)
TWO = SceneSettings(scale=1.0, second=PROJECTOR)


@pytest.fixture(scope="module")
def three(variant: str, tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """A plate under hot layers in three states, seen by a camera and a projector."""
    part, stack = slab(5)
    airs = (AirState(None, f"share {share}", ready=scaled(stack, share)) for share in SHARES)
    xml, _ = write_ensemble_scene(tmp_path_factory.mktemp("three"), part, airs, CAMERA, TWO)
    return load_scene(xml, variant=variant)


def member(scene: Scene, number: int) -> Scene:
    return load_scene(scene.path, {"member": number}, variant=scene.variant)


def test_a_measurement_is_the_mean_of_the_members(three: Scene) -> None:
    scan = measure(three)
    alone = [measure(member(three, number)) for number in (1, 2, 3)]
    everywhere = np.all([one.status == ScanStatus.MEASURED for one in alone], axis=0)
    assert (scan.status[everywhere] == ScanStatus.MEASURED).all()
    assert len(scan.points) == everywhere.sum() > 300
    assert scan.errors is not None
    errors = np.array([one.error[everywhere[one.status == 0]] for one in alone])
    np.testing.assert_allclose(scan.errors, errors, atol=1e-12)
    np.testing.assert_allclose(scan.error, errors.mean(axis=0), atol=1e-12)
    # To first order the error is proportional to the contrast.
    ratio = scan.scatter_normal / np.abs(scan.error_normal)
    np.testing.assert_allclose(ratio, SHARES.std(ddof=1) / (1.0 + SHARES.mean()), rtol=2e-3)


def test_a_correction_is_the_mean_of_the_members(three: Scene) -> None:
    """Points as they are in the second member's air, corrected by each."""
    cloud = measure(member(three, 2)).points
    found = correct(cloud, three, inputs=Inputs(mesh=0.05))
    alone = [correct(cloud, member(three, number)) for number in (1, 2, 3)]
    good = found.status == CorrectionStatus.CORRECTED
    assert good.mean() > 0.9
    assert found.errors is not None
    for errors, one in zip(found.errors, alone, strict=True):
        np.testing.assert_allclose(errors[good], one.error[good], atol=1e-12)
    np.testing.assert_allclose(found.error, found.errors.mean(axis=0), atol=1e-15)
    along = np.einsum("kij,ij->ki", found.errors, found.normal)
    # Any state like three members or between: their variance times (3 - 1) / (3 + 1).
    air = along.std(axis=0) / np.sqrt(2.0)
    expected = np.hypot(air, 0.05 * np.hypot(along.mean(axis=0), air))
    assert found.u_normal is not None
    np.testing.assert_allclose(found.u_normal[good], expected[good], rtol=1e-9)
    assert np.isnan(found.u_normal[~good]).all()
    assert "3 fields" in found.provenance["assumptions"]["ensemble"]


def test_weights_on_disk_are_those_of_the_mean(variant: str, tmp_path: Path) -> None:
    """Fitted weights in the scene's table: mean by NumPy, u of what air does by x C x."""
    part, stack = slab(5)
    given, folder = np.array((0.2, 0.3, 0.5)), tmp_path / "weighted"
    airs = [
        AirState(None, "a", weight=2 * weight, ready=scaled(stack, share))
        for share, weight in zip(SHARES, given, strict=True)
    ]
    xml, _ = write_ensemble_scene(folder, part, airs, CAMERA, TWO)
    table = folder / "members" / "members.json"
    listed = json.loads(table.read_text())
    assert [row["weight"] for row in listed["members"]] == pytest.approx(given.tolist())
    # Its last column scales the air as a whole.
    factor = np.column_stack(((0.1, -0.2, 0.1), (0.0, 0.1, -0.1), 0.2 * given))
    for row, values in zip(listed["members"], (factor @ factor.T).tolist(), strict=True):
        row["covariance"] = values
    table.write_text(json.dumps(listed))
    scene = load_scene(xml, variant=variant)
    scan = measure(scene)
    assert scan.errors is not None
    np.testing.assert_allclose(scan.error, np.average(scan.errors, 0, given), atol=1e-12)
    values = scan.as_dict()
    assert values["worst_member"] == 3
    assert values["members"][0]["weight"] == pytest.approx(0.2)
    origin = "50.0% synthetic: slab; 30.0% synthetic: slab; and 1 more"
    assert values["assumptions"]["field_origin"] == origin
    size = scan._with_scatter(Quantity("mm", {"cold": 10.0}, {}, (9.7, 10.0, 10.2)))
    assert size.worst == WorstMember(1, 9.7)
    spread = np.sqrt(np.cov((9.7, 10.0, 10.2), aweights=given))
    assert size.scatter == pytest.approx(float(spread))
    found = correct(scan.points, scene)
    good = found.status == CorrectionStatus.CORRECTED
    assert found.errors is not None
    assert found.u_normal is not None
    along = np.einsum("kij,ij->ki", found.errors, found.normal)
    expected = np.linalg.norm(along.T @ factor, axis=1)
    np.testing.assert_allclose(found.u_normal[good], expected[good], rtol=1e-9)
    clouds = {"measured": 10.1, "corrected": 10.0}
    sizes = Quantity("mm", clouds, {"corrected": 1e-3}, (9.7, 10.0, 10.2))
    real = evolve(found, groups=evolve(found.groups, source="fitted"))
    stated = real._with_uncertainty(sizes, doubts=()).uncertainty
    assert stated is not None
    assert stated.coverage_factor == pytest.approx(2.0)
    assert stated.parts[AIR] == pytest.approx(np.linalg.norm((-0.4, -0.1, 0.1) @ factor))
    assert stated.expanded == pytest.approx(2 * np.hypot(stated.parts[AIR], 1e-3))
    listed["members"][1]["weight"] = -1.0
    table.write_text(json.dumps(listed))
    with pytest.raises(InputError, match="weights"):
        load_scene(xml, variant=variant)


@pytest.mark.parametrize(
    ("contrasts", "make", "kind"),
    [
        ((1.0, 0.03), slab, "plane"),
        ((-1.0, 0.1, 1.2), slab, "plane"),
        ((1.0, 0.03), concentric_cylinders, "cylinder"),
    ],
)
def test_however_vague_a_point_is_corrected_by_the_mean(
    variant: str,
    tmp_path: Path,
    contrasts: tuple[float, ...],
    make: Callable[[int], tuple[Part, ShellStack]],
    kind: str,
) -> None:
    """Members of 100 and 3 % of the contrast, or of both signs, in air that is their mean.

    Each point is corrected, if by less than its uncertainty with a remark, and less than a tenth is
    left of the error, and of what the air does to a diameter.
    """
    part, stack = make(20)
    mean = float(np.mean(contrasts))
    airs = (AirState(None, f"{c}", ready=scaled(stack, c - 1.0)) for c in contrasts)
    xml, _ = write_ensemble_scene(tmp_path / "vague", part, airs, CAMERA, TWO)
    true = (AirState(None, "true", ready=scaled(stack, mean - 1.0)) for _ in range(2))
    truth, _ = write_ensemble_scene(tmp_path / "true", part, true, CAMERA, TWO)
    scan = measure(load_scene(truth, variant=variant))
    vague = min(contrasts) < 0.0
    said = (
        pytest.warns(IriftraceWarning, match="100% of the points are corrected by the members")
        if vague
        else nullcontext()
    )
    with said:
        found = correct(scan.points, load_scene(xml, variant=variant))
    expected = CorrectionStatus.UNCERTAIN if vague else CorrectionStatus.CORRECTED
    assert (found.status == expected).mean() > 0.97
    assert found.corrected.mean() > 0.97
    left = np.linalg.norm(found.points - scan.true, axis=1)[found.corrected]
    assert np.sqrt(np.mean(left**2)) < 0.1 * np.sqrt(np.mean(scan.error**2) * 3)
    assert found.u_normal is not None
    assert np.isfinite(found.u_normal[found.corrected]).all()
    counts = found.as_dict()["points"]
    assert counts["corrected"] == found.corrected.sum()
    assert counts["uncertain"] == (found.status == CorrectionStatus.UNCERTAIN).sum()
    (feature, *_) = found.features(part, [kind], gate=None)
    assert feature.points + feature.left_out <= found.corrected.sum()
    if kind == "cylinder":
        true_size = fit_feature(scan.true[found.corrected], kind).size_mm
        measured, corrected = (feature.size.by_cloud[key] for key in ("measured", "corrected"))
        assert abs(corrected - true_size) < 0.1 * abs(measured - true_size)


def test_nothing_is_known_of_one_field_alone(three: Scene) -> None:
    one = member(three, 2)
    assert measure(one).scatter_normal is None
    assert correct(measure(one).points, one).u_normal is None
    with pytest.raises(InputError) as error:
        Inputs(air=5.0)
    assert (error.value.code, error.value.argument) == ("uncertainty.no_fraction", "uncertainty")


def with_facts(scene: Scene, facts: FieldFacts) -> Scene:
    """A scene whose field states these facts."""
    source = scene.compiled.stated.source
    assert source is not None
    return with_stated(scene, evolve(scene.compiled.stated, source=evolve(source, facts=facts)))


def with_stated(scene: Scene, stated: AirStatement) -> Scene:
    """A scene whose files state other air."""
    other = evolve(scene, held=Held())
    other._held.compiled = evolve(scene.compiled, stated=stated)
    return other


@pytest.mark.parametrize(
    ("facts", "change"),
    [
        (FieldFacts(FieldKind.STEADY, 0.001, 1.0), None),
        (FieldFacts(FieldKind.UNSTEADY, 0.12, 27.0), 0.12 / np.sqrt(12)),
        (FieldFacts(FieldKind.UNSTEADY, 0.021, 180.0), 0.2 / np.sqrt(12)),
        (FieldFacts(FieldKind.UNSTEADY), None),
        (FieldFacts(time="snapshot"), None),
        (FieldFacts(time="mean"), None),
        (FieldFacts(FieldKind.STEADY, time="mean"), None),
        (FieldFacts(), None),
    ],
)
def test_air_that_changes_in_time_is_uncertain(
    three: Scene, facts: FieldFacts, change: float | None
) -> None:
    """Of a range of 20 % the standard deviation is 20 % / root 12, as of a rectangular one."""
    scene = with_facts(member(three, 2), facts)
    air = Air(temperature_k=293.15)
    wall = float(air.refractivity(1193.15))
    *others, last = scene.compiled.stated.shells
    shells = [evolve(row, **{"int": max(row.int_, wall)}) for row in others]
    shells.append(evolve(last, **{"int": wall}))
    stated = evolve(scene.compiled.stated, shells=shells, air=air)
    scene = with_stated(scene, stated)
    groups = AirGroups.of(scene, Inputs(air=0.05))
    assert groups.parts(1.0, None) == {
        CONTRAST: 0.05,
        **({} if change is None else {UNSTEADY: pytest.approx(change)}),
    }
    # Unsteady air of which no range is known is not covered.
    unsteady = facts.kind is FieldKind.UNSTEADY or (
        facts.kind is not FieldKind.STEADY and facts.time != ""
    )
    unknown = unsteady and change is None
    assert groups.missing == ((UNSTEADY,) if unknown else ())


def test_states_that_average_nothing_are_said(three: Scene) -> None:
    """Several snapshots have the air's changes in their scatter, and this air states no range."""
    with pytest.warns(IriftraceWarning, match="The 20 states that are averaged change nothing"):
        groups = AirGroups.of(three, Inputs(states=20.0))
    assert UNSTEADY not in groups.scaled
    AirGroups.of(three, Inputs(states=1.0))


def test_unsteady_means_are_uncertain_and_snapshots_scatter(three: Scene) -> None:
    """The mean range of several fields counts; several snapshots have it in their scatter."""
    mean = FieldFacts(FieldKind.UNSTEADY, 0.12, 0.0, time="mean")
    for facts, expected in (
        ([mean, FieldFacts(FieldKind.STEADY), mean], 0.08 / np.sqrt(12.0)),
        ([FieldFacts(time="snapshot")] * 3, None),
    ):
        states = [
            evolve(state, ready=evolve(shells, source=evolve(shells.source, facts=one)))
            for state, one in zip(three.air.states, facts, strict=True)
            for shells in (state.shells,)
        ]
        states = [evolve(state, files=None) for state in states]
        groups = AirGroups.of(evolve(three, air=three.air.with_states(states)).ready, Inputs())
        assert groups.missing == ()
        found = groups.scaled.get(UNSTEADY)
        assert (None if found is None else found.relative) == (
            None if expected is None else pytest.approx(expected)
        )


def test_a_stated_contrast_adds_to_what_members_say(three: Scene) -> None:
    """It does not take their place, so U cannot become smaller by stating more."""
    by_member = np.array((1.0, 2.0, 4.0))
    alone, both = (AirGroups.of(three, one) for one in (Inputs(), Inputs(air=0.05)))
    effect = float(alone.weights.mean(by_member))
    assert both.parts(effect, by_member) == {
        **alone.parts(effect, by_member),
        CONTRAST: pytest.approx(0.05 * np.hypot(effect, alone.weights.uncertainty(by_member))),
    }
    assert both.mixture(by_member) is not None
