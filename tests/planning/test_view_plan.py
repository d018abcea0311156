"""Several views chosen from a sweep: only faces within the limits count."""

from itertools import combinations
from typing import Any

import numpy as np
import pytest
import xarray as xr

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.planning.cover import plan_views
from iriftrace.planning.criteria import STANDARD_CRITERIA, Criteria, Views
from validation.inputs.sweep_tables import sweep_table, two_regions, with_faces

# A unit cube, faces +x +y +z -x -y -z, seen from six directions (pose i from face i's side) and
# from two opposite corners. A corner sees three faces at 54.7 degrees, moved by 30 um.
NORMALS = np.concatenate((np.eye(3), -np.eye(3)))
CORNERS = np.array([(1, 1, 1), (-1, -1, -1)]) / np.sqrt(3)
DIRECTIONS = np.concatenate((NORMALS, CORNERS))


def cube(rays_good: Any = 1000, areas: Any = (1, 1, 1, 1, 1, 1)) -> xr.Dataset:
    sightings = []
    for direction in DIRECTIONS:
        cosine = NORMALS @ direction
        moved = 0.01 if np.abs(direction).max() == 1 else 0.03
        sightings.append(
            [
                (face, 400, moved, float(np.degrees(np.arccos(c))))
                for face, c in enumerate(cosine)
                if c > 1e-9
            ]
        )
    ones = [1.0] * len(DIRECTIONS)
    return with_faces(sweep_table(ones, ones, ones, ones, rays_good), sightings, areas)


@pytest.mark.parametrize("limits", [{"max_displacement": "20 um"}, {"max_incidence": 45.0}])
def test_a_face_beyond_a_limit_is_not_seen(limits: dict[str, Any]) -> None:
    """The corners no longer count, so k views see k faces, and six are needed for all."""
    for k in range(1, 8):
        found = plan_views(cube(), Views(k, **limits))
        assert found.covered == pytest.approx(min(k, 6) / 6)
        assert set(found.poses.tolist()) <= set(range(6))
        assert found.coverable == pytest.approx(1)


def test_the_best_pair_by_trying_all() -> None:
    rng = np.random.default_rng(5)
    areas = rng.uniform(1, 3, 30)
    sightings = [
        [
            (int(face), 10, float(rng.uniform(0, 0.04)), float(rng.uniform(0, 90)))
            for face in np.sort(rng.choice(30, 12, replace=False))
        ]
        for _ in range(12)
    ]
    ones = [1.0] * 12
    table = with_faces(sweep_table(ones, ones, ones, ones), sightings, areas)
    found = plan_views(table, Views(2, 0.025, 70.0))
    good = [
        {f for f, _, moved, angle in rows if moved <= 0.025 and angle <= 70} for rows in sightings
    ]
    best = max(
        sum(areas[face] for face in good[a] | good[b]) for a, b in combinations(range(12), 2)
    )
    assert found.covered == pytest.approx(best / areas.sum())
    assert found.exact
    for face in set().union(*(good[pose] for pose in found.poses)):
        assert any(
            f == face and moved <= 0.025 and angle <= 70
            for pose in found.poses
            for f, _, moved, angle in sightings[pose]
        )


def test_a_region_is_covered_alone() -> None:
    """The faces -x, -y and -z are a region; the second corner sees all of it."""
    joined = two_regions(cube(), sweep_table(*([[1.0] * 8] * 4)), "below")
    joined["face_region"] = ("face", np.array([2, 2, 2, 1, 1, 1], dtype="i2"))
    found = plan_views(joined, Views(1), criteria=Criteria(region="below"))
    assert found.poses.tolist() == [7]
    assert found.covered == pytest.approx(1)


def test_poses_with_few_rays_are_no_candidates() -> None:
    found = plan_views(cube([1000] * 6 + [99, 99]), Views(2))
    assert set(found.poses.tolist()) <= set(range(6))


def of_two_devices(table: xr.Dataset, points: Any) -> xr.Dataset:
    """The same cube, of which both devices measure so many points from each pose."""
    found = table.assign(points_measured=table["rays_good"].copy(data=np.array(points)[:, None]))
    for name in ("error_normal_p95", "coverage_measured"):
        found[name] = table["coverage"]
    return found


def test_poses_where_two_devices_measure_little_are_no_candidates() -> None:
    """The camera alone would see all faces from both corners, where the sensor measures nothing."""
    table = of_two_devices(cube(), [100] * 6 + [0, 99])
    assert set(plan_views(table, Views(2)).poses.tolist()) <= set(range(6))
    camera = plan_views(table, Views(2), Criteria(criterion="displacement"))
    assert set(camera.poses.tolist()) == {6, 7}


def seen_within(
    table: xr.Dataset, k: int, criteria: Criteria = STANDARD_CRITERIA, **limits: Any
) -> None:
    plan_views(table, Views(k, **limits), criteria)


@pytest.mark.parametrize(
    ("table", "k", "options", "words"),
    [
        (cube(), 0, {}, "number of views is 0"),
        (cube(), 1, {"criteria": Criteria(region="hat")}, "no region 'hat'"),
        (cube(), 1, {"max_displacement": 0.001}, "10 to 30 um"),
        (cube(), 1, {"max_displacement": -1}, "positive limit"),
        (cube(), 1, {"max_incidence": 91}, "0 to 90"),
        (cube(), 1, {"criteria": Criteria(min_hits=1001)}, "relax"),
    ],
)
def test_what_cannot_be_chosen_is_refused(
    table: xr.Dataset, k: int, options: dict[str, Any], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        seen_within(table, k, **options)


def test_limits_are_said_in_words() -> None:
    assert Views(1).text == ""
    both = Views(1, 0.02, 75.0).text
    assert both == (
        "; a face counts that is seen with a displacement of 20 um at most and at an angle of 75 "
        "degrees at most"
    )


def test_what_is_seen_of_a_face_counts() -> None:
    """Areas 4, 2 and 2; poses see 1/2 and 3/4 of the first face, and all of one other."""
    ones = [1.0] * 2
    rows = [
        [(0, 400, 0.01, 10.0), (1, 400, 0.01, 10.0)],
        [(0, 400, 0.01, 10.0), (2, 400, 0.01, 10.0)],
    ]
    table = with_faces(sweep_table(ones, ones, ones, ones), rows, [4, 2, 2])
    table["sighting_seen"] = ("sighting", np.array([0.5, 1.0, 0.75, 1.0], dtype="f4"))
    with pytest.warns(IriftraceWarning, match=r"faces are large: up to 12\.5 % .*subdivide"):
        found = plan_views(table, Views(2))
    assert found.poses.tolist() == [1, 0]
    assert found.added == pytest.approx([5 / 8, 2 / 8])
    assert found.covered == found.coverable == pytest.approx(7 / 8)
    table["sighting_seen"] = ("sighting", np.array([1.0, 1.0, 0.75, 0.0], dtype="f4"))
    assert plan_views(table, Views(2)).added == pytest.approx([6 / 8])
