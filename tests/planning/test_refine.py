"""Refinement: never worse than the start, bounded, repeatable, and at the top of a known hill."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from attrs import evolve

from iriftrace.camera.pose import look_at
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.planning.criteria import Criteria
from iriftrace.planning.rank import Plan, rank_poses, score_of
from iriftrace.planning.refine import SCHEMA, refine_pose, write_refined
from validation.inputs.sweep_tables import sweep_table

START = look_at((0.0, -200.0, 0.0), (0.0, 0.0, 0.0))
OTHER = look_at((100.0, -180.0, 0.0), (0.0, 0.0, 0.0))
FAR = look_at((200.0, 0.0, 0.0), (0.0, 0.0, 0.0))
# A camera on which nothing depends but where it stands: the best place is here.
SUMMIT = np.array((15.0, -180.0, 20.0))


class Hill:
    """In place of a scene: displacement grows with the squared distance from the summit."""

    def __init__(self, forbidden_z: float = np.inf, good: int = 1000) -> None:
        self.rendered: list[np.ndarray] = []
        self.forbidden_z = forbidden_z
        self.good = good

    def displacement(self, matrix: np.ndarray) -> float:
        return float(1e-3 + 1e-6 * np.sum((matrix[:3, 3] - SUMMIT) ** 2))

    def coverage(self, matrix: np.ndarray) -> float:
        return 0.3

    def metrics(self, matrix: Any) -> dict[str, Any]:
        pose = np.array(matrix)
        self.rendered.append(pose)
        if pose[2, 3] > self.forbidden_z:
            raise InputError("The camera stands inside the hot air.", code="camera.in_hot_air")
        return {
            "rays": {"good": self.good},
            "displacement_mm": {"p95": self.displacement(pose)},
            "coverage_area": self.coverage(pose),
            "axial_resolution_mm": 0.1,
            "lateral_resolution_mm": 0.1,
        }


def hill_sweep() -> tuple[xr.Dataset, Plan]:
    hill = Hill()
    matrices = np.stack((FAR, START, OTHER))
    values = [hill.displacement(matrix) for matrix in matrices]
    table = sweep_table(values, [0.3] * 3, [0.1] * 3, [0.1] * 3)
    table["matrix"] = (("pose", "row", "column"), matrices)
    table["distance"] = ("pose", np.linalg.norm(matrices[:, :3, 3], axis=1))
    with pytest.warns(IriftraceWarning, match="do not differ"):
        return table, rank_poses(table, Criteria(1, 0.1, 0.1, 0.1, percentile=100))


def hill_with_room() -> tuple[xr.Dataset, Plan]:
    """The normalisation is the sweep's: 0 is the start's own value, so widen it first."""
    table, plan = hill_sweep()
    lower = {**plan.limits, "displacement": (0.0, plan.limits["displacement"][1])}
    free = evolve(plan, limits=lower)
    score = [score_of(free, {"displacement": v}) for v in plan.metrics["displacement"]]
    return table, evolve(free, score=np.array(score))


def test_the_top_of_a_hill_is_found() -> None:
    table, free = hill_with_room()
    found = refine_pose(table, free, Hill(), evaluations=120)
    assert found.start == 1
    assert np.linalg.norm(found.matrix[:3, 3] - SUMMIT) < 1.0
    assert found.gain > 0
    assert found.score == pytest.approx(score_of(free, found.metrics))
    # It still looks at the same point.
    aim = found.matrix[:3, 3] + found.distance_mm * found.matrix[:3, 2]
    np.testing.assert_allclose(aim, 0.0, atol=1e-9)
    rotation = found.matrix[:3, :3]
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-12)
    cosine = found.matrix[:3, 2] @ START[:3, 2]
    assert found.turn_deg == pytest.approx(np.degrees(np.arccos(cosine)))


class Fog(Hill):
    """The same hill, but from above 5 mm little of the part is seen."""

    def coverage(self, matrix: np.ndarray) -> float:
        return 0.3 if matrix[2, 3] <= 5.0 else 0.1


def test_poses_that_see_too_little_are_passed_over() -> None:
    table, free = hill_with_room()
    assert refine_pose(table, free, Fog()).matrix[2, 3] > 5.0
    found = refine_pose(
        table, evolve(free, criteria=evolve(free.criteria, min_coverage=0.2)), Fog()
    )
    assert 0.0 < found.matrix[2, 3] <= 5.0
    assert found.gain > 0


class Pair(Hill):
    """The same hill for two devices, which measure too few points above 5 mm."""

    def metrics(self, matrix: Any) -> dict[str, Any]:
        found = super().metrics(matrix)
        points = 100 if np.array(matrix)[2, 3] <= 5.0 else 99
        error = {"p95": found["displacement_mm"]["p95"]}
        return found | {"scan": {"points": points, "coverage": 0.3, "error_normal_mm": error}}


def test_poses_where_two_devices_measure_too_little_are_passed_over() -> None:
    table, free = hill_with_room()
    of_both = evolve(free, criteria=evolve(free.criteria, criterion="normal"))
    found = refine_pose(table, of_both, Pair())
    assert 0.0 < found.matrix[2, 3] <= 5.0
    assert found.gain > 0
    assert refine_pose(table, free, Pair()).matrix[2, 3] > 5.0


def test_nothing_better_leaves_the_start() -> None:
    """At the sweep's minimum the metric is clipped: no pose can score less than 0."""
    table, plan = hill_sweep()
    found = refine_pose(table, plan, Hill(), evaluations=30)
    assert found.score == found.start_score == 0.0
    assert found.gain == 0.0
    np.testing.assert_array_equal(found.matrix, START)
    assert found.turn_deg == found.roll_deg == 0.0


def test_a_gain_that_is_rounding_leaves_the_start() -> None:
    """Nothing but noise of 1e-6 of a score tells the poses apart."""
    table, plan = hill_sweep()
    lower = {**plan.limits, "displacement": (-1000.0, 1000.0)}
    found = refine_pose(table, evolve(plan, limits=lower, score=plan.score + 0.5), Hill())
    assert found.gain == 0.0
    np.testing.assert_array_equal(found.matrix, START)


@pytest.mark.parametrize("evaluations", [10, 25])
def test_no_more_poses_are_rendered_than_allowed(evaluations: int) -> None:
    table, plan = hill_sweep()
    hill = Hill()
    seen: list[tuple[int, float]] = []
    found = refine_pose(
        table,
        plan,
        hill,
        evaluations=evaluations,
        progress=lambda done, score: seen.append((done, score)),
    )
    assert len(hill.rendered) == found.evaluations <= evaluations
    assert [done for done, _ in seen] == list(range(1, found.evaluations + 1))
    # It may not go farther than the nearest other pose of the sweep.
    cosines = np.array([pose[:3, 2] @ START[:3, 2] for pose in hill.rendered])
    nearest = OTHER[:3, 2] @ START[:3, 2]
    # Two turns of that size at most.
    assert np.degrees(np.arccos(cosines.min())) <= 1.5 * np.degrees(np.arccos(nearest))


def test_it_is_the_same_again_and_forbidden_places_are_avoided() -> None:
    table, plan = hill_sweep()
    one, other = (refine_pose(table, plan, Hill(forbidden_z=10.0)) for _ in range(2))
    np.testing.assert_array_equal(one.matrix, other.matrix)
    assert one.matrix[2, 3] <= 10.0
    assert one.score <= one.start_score


def test_what_cannot_be_refined_is_refused() -> None:
    table, plan = hill_sweep()
    with pytest.raises(InputError) as few:
        refine_pose(table, plan, Hill(), evaluations=9)
    assert (few.value.code, few.value.argument) == ("evaluations.too_few", "evaluations")
    for changed in (Hill(good=99), Hill(forbidden_z=-1.0)):
        with pytest.raises(InputError) as error:
            refine_pose(table, plan, changed)
        assert error.value.code == "scene.changed"


def test_another_scene_than_the_swept_one_is_noticed() -> None:
    table, plan = hill_sweep()

    class Other(Hill):
        def displacement(self, matrix: np.ndarray) -> float:
            return 2e-2 + super().displacement(matrix)

    with pytest.warns(IriftraceWarning, match="not that of the sweep"):
        refine_pose(table, plan, Other(), evaluations=10)


def test_the_file_says_what_was_found(tmp_path: Path) -> None:
    table, plan = hill_sweep()
    found = refine_pose(table, plan, Hill(), evaluations=10)
    path = tmp_path / "refined.json"
    write_refined(path, found, plan, table.assign_attrs(wavelength_nm=532.0))
    assert json.loads(path.read_text())["wavelength_nm"] == 532.0
    write_refined(path, found, plan, table)
    content = json.loads(path.read_text())
    assert content["schema"] == SCHEMA
    assert content["wavelength_nm"] is None
    assert content["matrix"] == found.matrix.tolist()
    assert content["start"]["pose"] == 1
    assert content["gain"] == content["start"]["score"] - content["score"]
    look = content["look_at"]
    np.testing.assert_allclose(
        look_at(look["origin"], look["target"], look["up"]), found.matrix, atol=1e-12
    )
