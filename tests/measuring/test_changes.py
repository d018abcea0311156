"""Changes of features with the devices' poses, and by what is not linear in mixed air.

Against closed forms of a layer above a plate and of a cylinder that widens, and the order of the
neglected terms.
"""

import math
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve

from iriftrace.core.errors import InputError
from iriftrace.core.member_weights import MemberWeights
from iriftrace.measuring.two_devices import changes
from iriftrace.measuring.two_devices.budget import feature_budget
from iriftrace.measuring.two_devices.changes import (
    POSE,
    SURROGATE,
    Changes,
    error_at,
    mixture_changes,
    pose_changes,
)
from iriftrace.measuring.two_devices.correct import correct
from iriftrace.measuring.two_devices.correction import Correction
from iriftrace.measuring.two_devices.devices import Sensor
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.measuring.two_devices.scan import Scan, ScanStatus
from iriftrace.measuring.uncertainty.air_groups import AirGroups, SolvedAgain
from iriftrace.measuring.uncertainty.displacement import render_with_uncertainty
from iriftrace.measuring.uncertainty.inputs import Inputs
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.path_data import CommonMesh, cells_of
from iriftrace.part.standards import cylinder
from iriftrace.scenes.analytic import slab
from iriftrace.tracing.hot_air import AirState, HotAir
from iriftrace.tracing.scene import Scene
from validation.inputs.cameras import camera_at
from validation.inputs.leaning_air import LEEWARD, hot_block_part, leaning

pytestmark = pytest.mark.usefixtures("variant")


def stereo_above_plate() -> tuple[Scene, Sensor]:
    """Two cameras 30 degrees to both sides of the normal, 300 mm above a plate."""
    first, second = (
        camera_at((x, 0.4, 300.0), (0.0, 0.4, 0.0), up=(0.0, 1.0, 0.0), focal_length_mm=20.0)
        for x in (-300.0 * math.tan(math.pi / 6), 300.0 * math.tan(math.pi / 6))
    )
    part, stack = slab(60)
    air = HotAir.of_states([AirState(None, "", ready=stack)])
    scene = Scene(part, air, first, second, "camera_2", engine="shells").ready
    return scene, Sensor.of(scene.camera, scene.second, "stereo")


def test_a_moved_camera_changes_the_error_as_snell_says() -> None:
    """The height of a point is off by e = J (1 + t^2), t = tan of the angle on both sides.

    Each line passes beside the point by J t (1 + t^2). Moved across its line of sight by d, a
    camera changes e by e sin(angle) d / height; moved along it, or turned, by nothing.
    """
    scene, sensor = stereo_above_plate()
    near = np.linspace(-0.2, 0.2, 41)
    points = np.column_stack((near, 0.4 + near[::-1], np.zeros(41)))
    (found,) = pose_changes(
        scene, sensor, Inputs(position_mm=0.5, rotation_rad=1e-4), points, np.zeros(41, dtype=int)
    )
    assert (found.group, found.errors.shape) == (POSE, (12, 41, 3))
    height = error_at(scene, sensor, points)[:, 2].mean()
    expected = 0.5 * abs(height) * math.sin(math.pi / 6) / 300.0
    assert expected > 1e-6
    changed = found.errors[:, :, 2].mean(axis=1)
    for device in (0, 3):
        assert abs(changed[device]) == pytest.approx(expected, rel=0.05)
        np.testing.assert_allclose(changed[device + 1 : device + 3], 0.0, atol=0.05 * expected)
    assert not found.errors[6:].any()
    assert pose_changes(scene, sensor, Inputs(air=0.1), points, np.zeros(41, dtype=int)) == ()


def test_a_group_widens_a_cylinder_by_what_it_moves_its_points() -> None:
    """By 1 and 2 um along the normal: u is 2 hypot(1, 2) um; unknown where nothing is sampled."""
    part = cylinder()
    rng = np.random.default_rng(5)
    face = rng.choice(len(part.faces), 4000, p=part.face_areas / part.face_areas.sum())
    corners = part.vertices[part.faces[face]]
    points = np.einsum("nc,nci->ni", rng.dirichlet(np.ones(3), 4000), corners)
    normal = part.surface.normals[face]
    rows = np.arange(0, 4000, 2)
    errors = 1e-3 * np.array([1.0, 2.0])[:, None, None] * normal[rows]
    found = Correction(
        measured=points,
        error=np.zeros_like(points),
        status=np.zeros(4000, dtype=np.int64),
        face=face,
        face_normals=part.surface.normals,
        system="stereo",
        provenance={},
        groups=AirGroups(None, {}, {}, "known", ()),
        changes=(Changes(POSE, "stated", rows, errors),),
    )
    (mantle,) = (f for f in found.features(part, gate=None) if f.kind == "cylinder")
    assert mantle.size.uncertainty is not None
    assert mantle.size.uncertainty.parts[POSE] == pytest.approx(2e-3 * math.sqrt(5.0), rel=1e-3)
    assert mantle.size.uncertainty.missing == ()
    heights = found.relations(found.features(part, gate=None))
    for one in heights:
        assert one.value.uncertainty is not None
        if one.value.unit == "mm":  # both ends move outwards
            expected = 2e-3 * math.sqrt(5.0)
            assert one.value.uncertainty.parts[POSE] == pytest.approx(expected, rel=1e-3)
    none = evolve(found, changes=(Changes(POSE, "stated", rows[:2], errors[:, :2]),))
    (mantle,) = (f for f in none.features(part, gate=None) if f.kind == "cylinder")
    assert mantle.size.uncertainty is not None
    assert mantle.size.uncertainty.missing == (POSE,)


def contrasted(field: IndexField, factor: float) -> IndexField:
    """The same air with another contrast."""
    ambient = field.ambient_refractivity
    index = ambient + factor * (field.refractivity - ambient)
    return IndexField(field.grid, index, field.air, field.source)


def leeward(fields: list[IndexField], normals: str = "gradient") -> Scene:
    """The block in these fields, seen by two cameras past its plume."""
    air = HotAir(fields, normals=normals)
    return Scene(hot_block_part(), air, *LEEWARD, "camera_2", engine="cells").ready


def mixed(scene: Scene) -> tuple[Changes, Scan]:
    """What is not linear at the points that are measured in the mean air."""
    scan, sensor = measure(scene), Sensor.of(*LEEWARD, "stereo")
    groups = AirGroups.of(scene, Inputs())
    found = mixture_changes(scene, sensor, groups, scan.true, scan.face)
    assert found is not None
    return found, scan


@pytest.mark.slow
def test_terms_of_higher_order_are_quadratic_in_the_contrast(tmp_path: Path) -> None:
    """With the gradients of the cells themselves, which are linear in the index."""
    fields = [leaning(lean, tmp_path) for lean in (0.0, 0.5)]
    found = [mixed(leeward([contrasted(one, f) for one in fields], "facet")) for f in (0.5, 1.0)]
    small, large = (np.sqrt(np.mean(changes.errors**2)) for changes, _ in found)
    assert 2.5 < large / small < 4.5  # the rounding of single precision has a part of the small one
    assert large < 5e-4 * np.sqrt(np.mean(found[1][1].error ** 2))
    none, _ = mixed(leeward([fields[0]] * 2))
    np.testing.assert_allclose(none.errors, 0.0, atol=1e-7)


def test_mixed_air_is_that_of_a_field_of_its_own(tmp_path: Path) -> None:
    """Each mixture is a field that is measured by itself, at the same pixels."""
    fields = [leaning(lean, tmp_path) for lean in (0.0, 0.5)]
    found, scan = mixed(leeward(fields))
    assert (found.group, len(found.rows)) == (SURROGATE, len(scan.points))
    weights = AirGroups.of(leeward(fields), Inputs()).mixtures(8)
    assert weights is not None
    first = fields[0]
    index = weights[3] @ [one.refractivity for one in fields]
    alone = measure(leeward([IndexField(first.grid, index, first.air, first.source)]))
    both = (scan.status == ScanStatus.MEASURED) & (alone.status == ScanStatus.MEASURED)
    rows, own = (both[one.status == ScanStatus.MEASURED] for one in (scan, alone))
    assert scan.errors is not None
    off = alone.error[own] - np.tensordot(weights[3], scan.errors, axes=1)[rows]
    expected = math.sqrt(8.0) * found.errors[3][rows]
    assert np.sqrt(np.mean((off - expected) ** 2)) < 0.3 * np.sqrt(np.mean(expected**2))
    assert 0.0 < np.sqrt(np.mean(expected**2)) < 0.05 * np.sqrt(np.mean(scan.error**2))


@pytest.mark.parametrize(("period", "share"), [(2, 0.0), (50, 0.98)])
def test_unknown_lines_of_sight_are_no_agreement(
    period: int, share: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Points without an error do not count; of a feature with many of them nothing is known."""
    scene, whole = leeward([leaning(lean, tmp_path) for lean in (0.0, 0.5)]), changes.error_at

    def lost(scene: Scene, sensor: Sensor, points: np.ndarray) -> np.ndarray:
        found = whole(scene, sensor, points)
        found[::period] = np.nan
        return found

    monkeypatch.setattr(changes, "error_at", lost)
    found = feature_budget(scene, Inputs(position_mm=0.1))
    for change in found.correction.changes:
        assert len(change.rows) == pytest.approx(share * len(found.correction.face), abs=2)
        assert np.abs(change.errors).max(axis=(0, 2)).all()
    for one in found.relations:
        assert one.value.uncertainty is not None
        missing = {POSE, SURROGATE} & set(one.value.uncertainty.missing)
        assert missing == (set() if share else {POSE, SURROGATE})


def test_fields_on_other_meshes_are_not_mixed(tmp_path: Path) -> None:
    fields = [leaning(0.0, tmp_path), leaning(0.5, tmp_path, cells=8)]
    with pytest.raises(InputError) as error:
        CommonMesh.of([cells_of(one) for one in fields])
    assert error.value.code == "field.other_mesh"
    found = feature_budget(leeward(fields))
    assert "another mesh" in found.mixture_unchecked
    assert found.correction.changes == ()


def test_mixtures_have_the_moments_of_the_inputs() -> None:
    """Dirichlet's for the members; a varied input has its stated uncertainty over its step."""
    weights = MemberWeights((0.25, 0.75, 0.0))
    groups = AirGroups(
        weights, {}, {"wall": SolvedAgain(np.array((0.0, -0.5, 0.5)), "solved again")}, "any"
    )
    found = groups.mixtures(2**14)
    assert found is not None
    np.testing.assert_allclose(found.sum(axis=1), 1.0)
    np.testing.assert_allclose(found.mean(axis=0), weights.weights, atol=1e-3)
    covariance = weights.of_mixtures + 0.25 * np.outer((0, -1, 1), (0, -1, 1))
    np.testing.assert_allclose(np.cov(found.T), covariance, atol=2e-3)
    assert AirGroups(MemberWeights((1.0, 0.0)), {}, {}).mixtures(8) is None
    assert AirGroups().mixtures(8) is None


def test_a_correction_has_the_pose_but_not_the_check_of_the_mixture(tmp_path: Path) -> None:
    fields = [leaning(lean, tmp_path) for lean in (0.0, 0.5)]
    scene = leeward(fields)
    inputs = Inputs(position_mm=0.1)
    planned = feature_budget(scene, inputs)
    found = correct(planned.correction.measured, scene, inputs=inputs)
    assert [one.group for one in planned.correction.changes] == [POSE, SURROGATE]
    (only,) = found.changes
    assert only.group == POSE
    one = evolve(scene, second=None)
    missing = render_with_uncertainty(one, inputs).displacement_mm["median"].missing
    assert "position and rotation of the camera" in missing
