"""A scene with two devices is a rigid sensor: swept together, ranked by what both measure."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from attrs import evolve
from numpy.testing import assert_array_equal

import iriftrace
from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.planning.criteria import METRICS, Criteria, Criterion
from iriftrace.planning.rank import rank_poses
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.scene import Scene

pytestmark = [
    pytest.mark.usefixtures("variant"),
    pytest.mark.filterwarnings("ignore:Hits of"),
    pytest.mark.filterwarnings("ignore:.*differ in"),
    pytest.mark.filterwarnings("ignore:The part's faces"),
]

SCENE = folder_of("fringe_cylinder") / "scene.xml"
ORBIT = iriftrace.Orbit(centre=(0.0, 0.0, 0.0), semi_axes_mm=(490.0, 490.0, 490.0))
POSES = iriftrace.orbit_poses(ORBIT, azimuth_deg=[20.0, 35.0], elevation_deg=[0.0, 30.0])


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene(SCENE, {"scale": 0.08})


@pytest.fixture(scope="module")
def swept(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    return iriftrace.run_sweep(scene, POSES, tmp_path_factory.mktemp("rig") / "sweep.nc")


def seen_by_both(part: iriftrace.Part, *devices: iriftrace.Camera) -> float:
    """Fraction of a convex part's area that faces both devices, in focus and in both pictures."""
    points, face = part.surface.even_places(100_000)
    seen = np.ones(len(points), dtype=bool)
    for device in devices:
        sight = device.origin - points
        distance = np.linalg.norm(sight, axis=1)
        near, far = device.focus_mm
        seen &= np.sum(sight * part.face_normals[face], axis=1) > 0
        seen &= (distance >= near) & (distance <= far) & device.holds(device.project(points))
    return float(seen.mean())


def test_errors_are_those_of_measure_with_both_devices_moved(
    scene: Scene, swept: xr.Dataset
) -> None:
    motion = scene.second.matrix @ np.linalg.inv(scene.camera.matrix)
    for pose, matrix in enumerate(POSES.matrices):
        camera = scene.camera.at(matrix)
        moved = matrix @ np.linalg.inv(scene.camera.matrix)
        scan = measure(scene, camera, scene.second.at(moved @ scene.second.matrix))
        values = swept.isel(pose=pose).sel(region="part")
        assert values["points_measured"] == len(scan.points)
        size = np.abs(scan.error_normal)
        assert values["error_normal_p95"] == pytest.approx(np.percentile(size, 95), rel=1e-6)
        assert values["error_normal_bias"] == pytest.approx(np.median(scan.error_normal), rel=1e-6)
        both = seen_by_both(scene.part, camera, scan.second)
        assert values["coverage_measured"] == pytest.approx(both, rel=0.015)
        lateral = iriftrace.FeatureChoice("cylinder", "lateral")
        (feature,) = scan.features(scene.part, [lateral], None)
        error = feature.size.difference("measured", "cold")
        stored = swept.isel(pose=pose).sel(region="lateral")["size_error"]
        assert stored == pytest.approx(error, rel=1e-6)
    assert not np.allclose(motion, np.eye(4))


@pytest.mark.parametrize(
    ("criterion", "variable"),
    [
        ("normal", "error_normal_p95"),
        ("features", "size_error"),
        ("displacement", "displacement_p95"),
    ],
)
def test_a_criterion_ranks_by_its_error_alone(
    swept: xr.Dataset, criterion: Criterion, variable: str
) -> None:
    errors = np.abs(swept.sel(region="part")[variable].values)
    assert_array_equal(rank_poses(swept, Criteria(criterion=criterion)).order, np.argsort(errors))
    # The default weighs; so do weights that are given with the criterion.
    usual = rank_poses(swept)
    assert usual.criteria.criterion == "normal"
    assert set(usual.criteria.needed) == set(METRICS)
    assert rank_poses(swept, Criteria(criterion="normal", coverage=0.3)).criteria.weights == {
        "displacement": 1.0,
        "coverage": 0.3,
        "axial": 0.0,
        "lateral": 0.0,
    }


@pytest.fixture(scope="module")
def file(swept: xr.Dataset) -> Path:
    return Path(swept.encoding["source"])


def test_plan_says_that_both_move_and_prints_both_poses(
    scene: Scene,
    swept: xr.Dataset,
    file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """They stand to each other as in the scene."""
    assert main(["plan", str(file), "--criterion", "displacement"]) == 0
    assert "is for the camera alone" in " ".join(capsys.readouterr().out.split())
    saved = tmp_path / "best.json"
    assert main(["plan", str(file), "--save", str(saved)]) == 0
    printed = capsys.readouterr().out
    assert "Both devices move together" in printed
    assert 'inside the second sensor (id="projector"):' in " ".join(printed.split())
    rows = [line.split() for line in printed.splitlines() if re.fullmatch(r"( +[-\d.]+){4}", line)]
    camera, second = np.array(rows, dtype=np.float64).reshape(2, 4, 4)
    best = swept["matrix"].values[rank_poses(swept).best]
    np.testing.assert_allclose(camera, best, atol=1e-6)
    motion = np.linalg.inv(scene.camera.matrix) @ scene.second.matrix
    np.testing.assert_allclose(second, best @ motion, atol=1e-5)
    written = json.loads(saved.read_text())
    assert written["second"]["device"] == "projector"
    np.testing.assert_allclose(written["second"]["to_first"], motion, atol=1e-9)


@pytest.mark.slow
def test_both_are_moved_to_the_refined_pose(swept: xr.Dataset, file: Path, tmp_path: Path) -> None:
    refined = tmp_path / "refined.json"
    assert main(["plan", str(file), "--refine", "--evaluations=11", "-o", str(refined)]) == 0
    found = json.loads(refined.read_text())
    assert found["score"] <= found["start"]["score"]
    start = swept.isel(pose=found["start"]["pose"]).sel(region="part")
    assert found["start"]["metrics"]["displacement"] == float(start["error_normal_p95"])


def test_a_sweep_with_another_second_device_is_another_one(scene: Scene, file: Path) -> None:
    assert scene.second is not None
    moved = scene.second.matrix.copy()
    moved[0, 3] += 10.0
    with pytest.raises(InputError) as caught:
        iriftrace.run_sweep(evolve(scene, second=scene.second.at(moved)), POSES, file)
    assert caught.value.code == "output.other_work"


def test_a_question_about_two_devices_does_not_fit_one_camera(scene: Scene) -> None:
    one = iriftrace.run_sweep(evolve(scene, second=None), POSES.take([0]))
    assert "error_normal_p95" not in one
    with pytest.raises(InputError, match="about a sensor with two devices"):
        rank_poses(one, Criteria(criterion="normal"))
