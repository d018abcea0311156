"""Summary of a sweep with known numbers: units, limits, grids and angles of its poses."""

import numpy as np
import pytest
from attrs import evolve

from iriftrace.camera.orbit import Orbit, fibonacci_poses, orbit_poses
from iriftrace.camera.pose_set import PoseSet
from iriftrace.core.errors import InputError
from iriftrace.image.aov_image import Status
from iriftrace.measuring.uncertainty.inputs import Inputs
from iriftrace.planning.criteria import Criteria
from iriftrace.planning.summary import SweepSummary, summarise
from iriftrace.planning.texts import indistinct_text
from validation.inputs.sweep_tables import (
    AZIMUTHS,
    ELEVATIONS,
    EMPTY,
    GRID,
    ORBIT,
    known_sweep,
    sweep_table,
)

ALONE = Criteria(displacement=1.0, coverage=0.0, axial=0.0, lateral=0.0)
"""The displacement alone."""


@pytest.fixture(scope="module")
def summary() -> SweepSummary:
    return summarise(known_sweep())


def test_values_come_in_readable_units(summary: SweepSummary) -> None:
    """mm become um and shares become per cent; what is unknown stays unknown."""
    known = np.setdiff1d(np.arange(len(GRID)), EMPTY)
    assert summary.displacement.unit == "µm"
    assert summary.displacement.values[known] == pytest.approx(1.5**known)
    assert summary.coverage.label == "Coverage (%)"
    assert summary.coverage.values[known] == pytest.approx(10 + 30 * known / len(GRID))
    for quantity in summary.quantities:
        assert np.flatnonzero(~quantity.known).tolist() == list(EMPTY)


def test_limits_are_those_of_the_plan(summary: SweepSummary) -> None:
    low, high = summary.displacement.limits
    known = np.setdiff1d(np.arange(len(GRID)), EMPTY)
    assert low == pytest.approx(1.5)
    assert high == pytest.approx(np.percentile(1.5**known, 95))


def test_only_rays_that_occur_are_counted(summary: SweepSummary) -> None:
    assert set(summary.rays) == set(Status) - {Status.MISSED, Status.GAVE_UP}


def test_poses_with_few_hits_have_no_number() -> None:
    few = summarise(known_sweep(), Criteria(min_hits=1005))
    assert np.flatnonzero(~few.displacement.known).tolist() == [0, 1, 2, 3, 4, 6]
    assert "6 without a rank" in few.subtitle


def test_the_pole_stands_for_all_azimuths(summary: SweepSummary) -> None:
    grid = summary.grid(np.arange(14))
    assert grid is not None
    assert grid.tolist() == [
        [0] * 4,
        [1, 2, 3, 4],
        [5, 6, 7, 8],
        [9, 10, 11, 12],
        [13] * 4,
    ]


@pytest.mark.parametrize(
    "poses",
    [
        GRID.take(np.delete(np.arange(14), 7)),
        fibonacci_poses(ORBIT, 12),
        orbit_poses(ORBIT, [0.0], ELEVATIONS),
        orbit_poses(ORBIT, AZIMUTHS, [10.0]),
    ],
    ids=["a hole", "all around", "one azimuth", "one elevation"],
)
def test_other_poses_are_no_grid(poses: PoseSet) -> None:
    assert summarise(known_sweep(poses, empty=())).grid(np.arange(len(poses))) is None


def test_poses_without_angles_get_those_of_their_line_of_sight() -> None:
    """On a sphere they are those of the orbit; in the sweep's file too, and so in its tables."""
    poses = orbit_poses(Orbit((0, 0, 0), (200, 200, 200)), [0.0, 90.0, 320.0], [0.0, 90.0])
    table = known_sweep(PoseSet(poses.matrices), empty=())
    assert table["azimuth"].values == pytest.approx([0.0, 90.0, 320.0, 0.0])
    found = summarise(table)
    assert found.azimuth == pytest.approx(poses.azimuth_deg)
    assert found.elevation == pytest.approx(poses.elevation_deg)
    assert found.angles_of == "of the line of sight"


def test_azimuths_are_0_to_360_and_continue_on_maps() -> None:
    ranges = {(-40.0, 0.0, 40.0): [-40, 0, 40], (0.0, 120.0, 240.0): [0, 120, 240]}
    for typed, drawn in ranges.items():
        poses = orbit_poses(ORBIT, typed, [-10.0, 10.0])
        found = summarise(known_sweep(poses, empty=()))
        assert found.azimuth.tolist() == [angle % 360.0 for angle in typed] * 2
        grid = found.grid(np.arange(6))
        assert grid is not None
        assert found.azimuth_on_maps[grid[0]].tolist() == drawn


def test_a_table_of_something_else_is_refused() -> None:
    with pytest.raises(InputError, match="matrix is missing"):
        summarise(known_sweep().drop_vars("matrix"))
    with pytest.raises(InputError, match="None of the 14 poses"):
        summarise(known_sweep(empty=tuple(range(14))))


def test_poses_that_do_not_differ_from_the_best_are_named() -> None:
    """10 um with 0.3 um of scatter and 4 % stated: U = 2 hypot(0.3, 0.4) um = 1 um."""
    table = sweep_table([0.010, 0.01075, 0.0109, 0.020], [0.5] * 4, [0.1] * 4, [0.1] * 4)
    assert indistinct_text(summarise(table, ALONE)) is None
    stated = indistinct_text(summarise(table, ALONE), Inputs(air=0.04))
    assert stated is not None
    assert "Pose 1 does not differ from pose 0 by more than the U" in stated
    scatter = np.array([[3e-4], [2e-3], [3e-4], [3e-4]])
    for statistic in ("mean", "median", "p95"):
        table[f"scatter_{statistic}"] = table["displacement_p95"] * 0 + scatter
    summary = summarise(table, evolve(ALONE, robust=0.5))
    both = indistinct_text(summary, Inputs(air=0.04))
    assert both is not None
    assert "Poses 2 and 1 do not differ from pose 0 by more than the U" in both
    assert "(1 um, k = 2)" in both
    alone = indistinct_text(summary)
    assert alone is not None
    assert alone.startswith("Every other ranked pose differs from pose 0 by more than")
    with pytest.raises(InputError) as error:
        indistinct_text(summary, Inputs(wall_k=10.0))
    assert error.value.code == "uncertainty.not_in_plans"
