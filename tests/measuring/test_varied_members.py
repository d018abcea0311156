"""Members that were solved again with one input changed, against closed forms of slab and cylinder.

The effect on a point is to first order proportional to J = int (n_ambient - n) ds, in closed form
for air of linear and of logarithmic temperature; the budget's parts are its changes.
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from attrs import evolve

from iriftrace.core.errors import InputError
from iriftrace.measuring.two_devices import correct as correct_room
from iriftrace.measuring.two_devices import measure as measure_room
from iriftrace.measuring.two_devices.budget import feature_budget
from iriftrace.measuring.two_devices.correct import correct
from iriftrace.measuring.two_devices.correction_status import CorrectionStatus
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.measuring.two_devices.scan import Scan, ScanStatus
from iriftrace.measuring.uncertainty.air_groups import AIR, UNSTEADY, AirGroups
from iriftrace.measuring.uncertainty.displacement import render_with_uncertainty
from iriftrace.measuring.uncertainty.inputs import Inputs
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.shells.stack import ShellStack
from iriftrace.medium.source import FieldFacts, FieldKind, FieldSource, Variation
from iriftrace.part.part import Part
from iriftrace.scenes import analytic
from iriftrace.tracing import engine
from iriftrace.tracing.engine import EngineTest
from iriftrace.tracing.hot_air import AirState, HotAir
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.rays import is_inside
from iriftrace.tracing.render import render_scene
from iriftrace.tracing.scene import Scene
from validation.inputs.cameras import camera_at

pytestmark = pytest.mark.usefixtures("variant")

WALL_K, AMBIENT_K, PRESSURE_PA = 1373.15, 293.15, 101325.0
STEPS = {"wall": 20.0, "ambient": 5.0, "pressure": 2000.0}
STATED = Inputs(wall_k=10.0, ambient_k=2.0, pressure_pa=500.0)

Make = Callable[..., tuple[Part, ShellStack]]


def slab_integral(wall: float, ambient: float, pressure: float) -> float:
    """J of a layer of linear temperature, in any unit."""
    mean = math.log(wall / ambient) / (wall - ambient)
    return pressure * (1.0 / ambient - mean)


def cylinder_integral(wall: float, ambient: float, pressure: float) -> float:
    """The limit of reference case E2: int (n_ambient - n) / r^2 dr, by Gauss and Legendre."""
    nodes, weights = np.polynomial.legendre.leggauss(80)
    inner, outer = analytic.CYLINDER_RADIUS_MM, analytic.HOT_AIR_RADIUS_MM
    r = inner + 0.5 * (outer - inner) * (nodes + 1.0)
    kelvin = wall + (ambient - wall) * np.log(r / inner) / np.log(outer / inner)
    return pressure * float(weights @ ((1.0 / ambient - 1.0 / kelvin) / r**2))


def source(name: str, sha256: str, facts: FieldFacts) -> FieldSource:
    return FieldSource(name, sha256, "n", "index", "mm", facts=facts)


def states(make: Make, monkeypatch: pytest.MonkeyPatch) -> tuple[Part, list[AirState]]:
    """The air as it is, and with each input changed."""
    part, stack = make(60)
    found = [AirState(None, "base", ready=evolve(stack, source=source("b", "0", FieldFacts())))]
    for number, (quantity, step) in enumerate(STEPS.items(), start=1):
        with monkeypatch.context() as changed:
            if quantity == "wall":
                changed.setattr(analytic, "WALL_K", WALL_K + step)
            air = Air(
                temperature_k=AMBIENT_K + step * (quantity == "ambient"),
                pressure_pa=PRESSURE_PA + step * (quantity == "pressure"),
            )
            facts = FieldFacts(variation=Variation(quantity, step, "0"))
            stack = make(60, air=air)[1]
        own = evolve(stack, source=source(quantity, f"{number}", facts))
        found.append(AirState(None, quantity, ready=own))
    return part, found


def devices(kind: str) -> tuple[object, object]:
    """Two that look at the plate from above, or at the cylinder from the front."""
    place = (0.0, 0.4, 0.0) if kind == "slab" else (0.1, -analytic.CYLINDER_RADIUS_MM, 0.0)
    away = np.array((0.0, 0.0, 300.0) if kind == "slab" else (0.0, -20_000.0, 0.0))
    side = np.array((173.0, 0.0, 0.0) if kind == "slab" else (0.0, 0.0, 1_750.0))
    one, other = (
        camera_at(
            tuple(np.array(place) + away + sign * side),
            place,
            up=(1.0, 0.2, 0.3),
            focal_length_mm=float(np.linalg.norm(away + side)),
            sensor_mm=(1.0, 1.0),
            resolution=(12, 10),
        )
        for sign in (-1.0, 1.0)
    )
    return one, other


@pytest.mark.parametrize(
    ("kind", "integral"), [("slab", slab_integral), ("cylinder", cylinder_integral)]
)
def test_parts_are_the_changes_of_the_closed_form(
    kind: str, integral: Callable[..., float], monkeypatch: pytest.MonkeyPatch
) -> None:
    make = analytic.slab if kind == "slab" else analytic.concentric_cylinders
    part, airs = states(make, monkeypatch)
    first, second = devices(kind)
    scene = Scene(part, HotAir.of_states(airs), first, second, "camera_2", engine="shells").ready
    assert scene.weights.weights.tolist() == [1.0, 0.0, 0.0, 0.0]
    groups = AirGroups.of(scene, STATED)
    scan = measure(scene, varied=True)
    along = np.einsum("kij,ij->ki", scan.errors, scan.normal)
    parts = groups.parts(scan.error_normal, along)
    now = (WALL_K, AMBIENT_K, PRESSURE_PA)
    for number, (name, step) in enumerate(STEPS.items()):
        changed = list(now)
        changed[number] += step
        relative = integral(*changed) / integral(*now) - 1.0
        stated = {"wall": 10.0, "ambient": 2.0, "pressure": 500.0}[name]
        expected = abs(relative * stated / step * scan.error_normal)
        np.testing.assert_allclose(parts[name], expected, rtol=0.02)
    # The mean is that of the base alone.
    base = measure(evolve(scene, air=scene.air.alone(1)))
    np.testing.assert_allclose(scan.error, base.error, atol=1e-12)


def test_variations_of_several_members_by_one_input_are_averaged(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Weighted as the members that they vary, in any order; `correct` traces them all."""
    part, (base, wall, *others) = states(analytic.slab, monkeypatch)
    base = evolve(base, weight=0.25)
    other, own_wall = (
        evolve(air, weight=0.75, ready=evolve(air.shells, source=source(sha, sha, facts)))
        for air, sha, facts in (
            (others[0], "7", FieldFacts()),
            (others[1], "8", FieldFacts(variation=Variation("wall", 40.0, "7"))),
        )
    )

    def scene_of(*airs: AirState) -> Scene:
        return Scene(part, HotAir.of_states(airs), *devices("slab"), "camera_2", engine="shells")

    def change(*airs: AirState) -> list[float]:
        groups = AirGroups.of(scene_of(*airs).ready, Inputs(wall_k=10.0))
        return groups.varied["wall"].change.tolist()

    of_base, of_other = 0.25 * 10.0 / 20.0, 0.75 * 10.0 / 40.0
    expected = [-of_base, of_base, -of_other, of_other]
    assert change(base, wall, other, own_wall) == pytest.approx(expected)
    assert change(other, own_wall, base, wall) == pytest.approx(expected[2:] + expected[:2])
    none = evolve(base, weight=0.0)
    assert change(other, none, wall) == pytest.approx([0.0, -0.5, 0.5])
    scene = scene_of(base, wall, other, own_wall)
    groups = AirGroups.of(scene.ready, Inputs(wall_k=10.0))
    effects = np.array([1.0, 1.4, 3.0, 2.0])
    assert groups.parts(0.0, effects)["wall"] == pytest.approx(of_other * 1.0 - of_base * 0.4)
    scan = measure(scene)
    errors = correct(scan.points, scene, inputs=Inputs(wall_k=10.0)).errors
    assert errors is not None
    for number in (1, 3):
        assert (np.abs(errors[number] - errors[number - 1]).max(axis=1) > 0.0).all()


def test_one_field_with_variations_does_not_cover_the_air(monkeypatch: pytest.MonkeyPatch) -> None:
    part, airs = states(analytic.slab, monkeypatch)
    scene = Scene(part, HotAir.of_states(airs), *devices("slab"), "camera_2", engine="shells")
    found = feature_budget(scene, STATED, gate=None).correction
    assert found.groups.missing == (AIR,)
    assert set(found.groups.varied) == set(STEPS)
    back = correct(found.measured, scene, inputs=STATED)
    np.testing.assert_allclose(back.u_normal, found.u_normal, rtol=1e-3)
    again = evolve(found, groups=AirGroups.of(scene.ready, evolve(STATED, air=0.05)))
    assert again.groups.missing == ()
    assert (again.u_normal > found.u_normal).all()


def test_one_unsteady_field_with_variations_is_as_unsteady_as_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its range of 12 % is in U, and there is no scatter and no worst member of one field."""
    part, airs = states(analytic.slab, monkeypatch)
    facts = FieldFacts(FieldKind.UNSTEADY, heat_variation=0.12, plume_swing_k=1.0)
    airs[0] = AirState(None, "base", ready=evolve(airs[0].shells, source=source("b", "0", facts)))
    scene = Scene(part, HotAir.of_states(airs), *devices("slab"), "camera_2", engine="shells")
    groups = AirGroups.of(scene.ready, STATED)
    assert groups.scaled[UNSTEADY].relative == pytest.approx(0.12 / math.sqrt(12.0))
    averaged = AirGroups.of(scene.ready, evolve(STATED, states=25.0)).scaled[UNSTEADY]
    assert averaged.relative == pytest.approx(0.12 / math.sqrt(12.0) / 5.0)
    assert "25 states" in averaged.source
    scan = measure(scene)
    assert scan.scatter_normal is None
    assert scan.worst_member is None
    assert "scatter_normal_mm" not in scan.as_dict()
    assert not render_scene(scene).image.is_ensemble


def test_a_picture_has_the_same_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """The displacement of a far oblique camera is proportional to J, too."""
    part, airs = states(analytic.slab, monkeypatch)
    camera, _ = devices("slab")
    wide = evolve(camera, resolution=(12, 10))
    scene = Scene(part, HotAir.of_states(airs), wide, engine="shells")
    found = render_with_uncertainty(scene, STATED)
    median = found.displacement_mm["median"]
    now = (WALL_K, AMBIENT_K, PRESSURE_PA)
    for number, (name, step) in enumerate(STEPS.items()):
        changed = list(now)
        changed[number] += step
        relative = slab_integral(*changed) / slab_integral(*now) - 1.0
        stated = {"wall": 10.0, "ambient": 2.0, "pressure": 500.0}[name]
        assert median.parts[name] / median.value == pytest.approx(
            abs(relative) * stated / step, rel=0.03
        )
    image = found.rendering.image
    u = image.channels["displacement.u.norm"]
    norm = image.channels["displacement.norm"]
    total = math.hypot(*median.parts.values()) / median.value
    np.testing.assert_allclose(u[norm > 0.0] / norm[norm > 0.0], total, rtol=0.03)


def test_a_variation_of_a_field_that_is_not_there_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    part, (_, *varied) = states(analytic.slab, monkeypatch)
    first, second = devices("slab")
    other = AirState(
        None, "other", ready=evolve(varied[0].shells, source=source("o", "9", FieldFacts()))
    )
    scene = Scene(part, HotAir.of_states([other, *varied]), first, second, engine="shells")
    with pytest.raises(InputError) as error:
        AirGroups.of(scene.ready, STATED)
    assert error.value.code == "air.varies_nothing"


def test_a_saved_scene_keeps_what_its_members_vary(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    part, airs = states(analytic.slab, monkeypatch)
    scene = Scene(part, HotAir.of_states(airs), *devices("slab"), "camera_2", engine="shells")
    scene.save(tmp_path / "scene.xml")
    again = load_scene(tmp_path / "scene.xml")
    assert again.weights.weights.tolist() == [1.0, 0.0, 0.0, 0.0]
    assert {one.source.facts.variation.quantity for one in again.members[1:]} == set(STEPS)


def varied_slab(monkeypatch: pytest.MonkeyPatch) -> Scene:
    """The slab's air and its three variations, measured by two cameras."""
    part, airs = states(analytic.slab, monkeypatch)
    return Scene(part, HotAir.of_states(airs), *devices("slab"), "camera_2", engine="shells").ready


def quantity_of(scene: Scene) -> str:
    """What the air of a scene of one member varies; "" for none."""
    variation = scene.compiled.source.facts.variation
    return "" if variation is None else variation.quantity


def test_only_a_budget_traces_the_variations(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, traced = varied_slab(monkeypatch), []
    scan_of, of_one_field = measure_room._scan, correct_room._robust_error

    def scanned(one: Scene, *given: object) -> Scan:
        traced.append(quantity_of(one))
        return scan_of(one, *given)

    def corrected(measured: object, one: Scene, *given: Any) -> object:
        traced.append(quantity_of(one))
        return of_one_field(measured, one, *given)

    monkeypatch.setattr(measure_room, "_scan", scanned)
    monkeypatch.setattr(correct_room, "_robust_error", corrected)
    scan = measure(scene)
    assert traced == [""]
    traced.clear()
    feature_budget(scene, STATED, gate=None)
    assert traced == ["", *STEPS]
    for stated, varied in ((Inputs(), []), (Inputs(ambient_k=2.0), ["ambient"]), (STATED, STEPS)):
        traced.clear()
        correct(scan.points, scene, inputs=stated)
        assert traced == ["", *varied]
    assert scan.numbers == (1,)
    assert scan.errors.shape == (1, *scan.points.shape)


def test_a_variation_decides_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where it alone fails, its input has no effect; elsewhere its part is the same."""
    scene = varied_slab(monkeypatch)
    whole = measure(scene, varied=True)
    plain = correct(whole.points, scene, inputs=STATED)
    scan_of, of_one_field = measure_room._scan, correct_room._in_one_field
    half = np.arange(len(whole.points)) % 2 == 0
    rows, columns = np.rint(whole.pixel[half, ::-1]).astype(int).T

    def scanned(one: Scene, *given: object) -> Scan:
        found = scan_of(one, *given)
        if quantity_of(one) == "ambient":
            raise InputError("It sees nothing.", code="devices.nothing_common")
        if quantity_of(one) != "wall":
            return found
        found.status[rows, columns] = ScanStatus.LOST
        kept = {name: getattr(found, name)[~half] for name in ("points", "true", "gap", "angle")}
        return evolve(found, **kept)

    def corrected(measured: object, *given: Any) -> object:
        error, status, face = of_one_field(measured, *given)
        if quantity_of(given[2]) == "wall":
            error[half], status[half] = np.nan, CorrectionStatus.LOST
        return error, status, face

    monkeypatch.setattr(measure_room, "_scan", scanned)
    monkeypatch.setattr(correct_room, "_in_one_field", corrected)
    found = measure(scene, varied=True)
    np.testing.assert_array_equal(found.points, whole.points)
    np.testing.assert_array_equal(found.status, whole.status)
    base, wall, ambient, pressure = found.errors
    np.testing.assert_array_equal(wall, np.where(half[:, None], base, whole.errors[1]))
    np.testing.assert_array_equal(ambient, base)
    np.testing.assert_array_equal(pressure, whole.errors[3])
    back = correct(whole.points, scene, inputs=STATED)
    np.testing.assert_array_equal(back.points, plain.points)
    np.testing.assert_array_equal(back.status, plain.status)
    np.testing.assert_array_equal(
        back.errors[1], np.where(half[:, None], back.errors[0], plain.errors[1])
    )
    assert (back.u_normal[half] < plain.u_normal[half]).all()
    np.testing.assert_array_equal(back.u_normal[~half], plain.u_normal[~half])


def test_a_member_of_the_mean_still_decides(monkeypatch: pytest.MonkeyPatch) -> None:
    """And so does one whose weight a fit knows to be 0 with some uncertainty only."""
    scene = varied_slab(monkeypatch)
    wall = scene.members[1]
    assert scene.counted == (0,)
    assert [wall.counts, evolve(wall, weight=0.1).counts] == [False, True]
    assert evolve(wall, covariance=[-0.1, 0.1]).counts
    assert not evolve(wall, covariance=[0.0, 0.0]).counts
    assert [quantity_of(one) for one in scene.alone((0, 2))] == ["", "ambient"]


def test_a_variation_does_not_choose_the_engine(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = varied_slab(monkeypatch)
    tested = []

    def too_coarse(one: Scene, _: object) -> EngineTest:
        tested.append(quantity_of(one))
        return EngineTest(100, 0.0, 1.0, 0.0, float(quantity_of(one) != ""))

    monkeypatch.setattr(engine, "_tested", too_coarse)
    choice = engine.choose(scene, scene.camera, scene.second)
    assert tested == ["", ""]
    assert choice.test.suffices


def test_a_place_in_the_air_of_a_variation_alone_is_free(monkeypatch: pytest.MonkeyPatch) -> None:
    """The variation's air reaches 60 mm from the axis, the layer on the plate 20 mm."""
    part, (base, *_) = states(analytic.slab, monkeypatch)
    _, (_, wide, *_) = states(analytic.concentric_cylinders, monkeypatch)
    place = np.array(((0.0, 0.0, 40.0),))
    one, other = (
        Scene(part, HotAir.of_states(airs), *devices("slab"), "camera_2", engine="shells").ready
        for airs in ([base, wide], [base, of_the_mean(wide)])
    )
    assert not is_inside(one, place).any()
    assert is_inside(other, place).all()


def of_the_mean(air: AirState) -> AirState:
    """The same air as a state of its own."""
    return evolve(air, ready=evolve(air.shells, source=source("own", "7", FieldFacts())))
