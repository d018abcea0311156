"""Ranking by a table worked out by hand, by independent loops, and by what must never win."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from five_poses import FIVE, NORMALISED, SCORES, A, B, C, D, E, changed, five, random_tables, rank
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.planning.criteria import METRICS, THE_PAPERS, Criteria
from iriftrace.planning.rank import pareto_front, rank_poses, score_of
from iriftrace.planning.stability import stability
from validation.inputs.sweep_tables import sweep_table, two_regions


def test_five_poses_are_scored_as_by_hand() -> None:
    plan = rank_poses(five(), THE_PAPERS)
    for name in METRICS:
        assert_allclose(plan.normalised[name], NORMALISED[name], atol=1e-12)
    assert_allclose(plan.score, SCORES, atol=1e-12)
    assert plan.order.tolist() == [C, B, A, E, D]
    assert plan.best == C
    assert plan.unranked == {}
    assert plan.warnings == ()
    assert plan.limits["displacement"] == pytest.approx((1, 11))


@pytest.mark.parametrize("factor", [0.5, 1.7])
def test_the_fraction_of_faces_hit_does_not_count(factor: float) -> None:
    """The paper's number depends on the mesh and the pixels; the area seen ranks and limits."""
    table = changed(five(), "coverage", np.array(FIVE["coverage"])[::-1] * factor)
    for criteria in (THE_PAPERS, Criteria(min_coverage=0.25)):
        plan, usual = rank_poses(table, criteria), rank_poses(five(), criteria)
        assert_array_equal(plan.score, usual.score)
        assert plan.unranked == usual.unranked
        assert_array_equal(plan.metrics["coverage"], FIVE["coverage"])
    assert plan.unranked == {
        B: "coverage 0.1, less than 0.25",
        E: "coverage 0.2, less than 0.25",
    }


def test_discarding_drops_what_lies_above_the_percentile() -> None:
    """B's axial resolution and D's three metrics lie above it; the others' scores stay."""
    plan = rank_poses(five(), Criteria(outside="discard"))
    assert plan.order.tolist() == [C, A, E]
    assert_allclose(plan.score[[C, A, E]], [0.29375, 0.375, 0.6375], atol=1e-12)
    assert plan.unranked == {
        B: "axial 0.55 is above the 95th percentile, 0.5",
        D: "displacement 12 is above the 95th percentile, 11",
    }
    assert np.isnan(plan.score[[B, D]]).all()


def test_discarding_cannot_leave_nothing() -> None:
    """Of two poses, each one is the worse in something, hence above the percentile."""
    table = sweep_table([1, 2], [0.1, 0.1], [2, 1], [1, 1])
    with pytest.raises(InputError, match="none is left to rank"):
        rank_poses(table, Criteria(outside="discard"))
    # A region where only rounding differs has no outliers.
    same = sweep_table([1, 1 + 1e-15], [0.1, 0.1], [1, 1], [1, 1])
    with pytest.warns(IriftraceWarning, match="do not differ"):
        assert rank_poses(same, Criteria(outside="discard")).order.tolist() == [0, 1]


def test_percentile_100_is_the_maximum() -> None:
    plan = rank_poses(five(), Criteria(percentile=100))
    assert_allclose(plan.normalised["displacement"], [5 / 11, 0, 2 / 11, 1, 6 / 11])
    assert rank_poses(five(), Criteria(percentile=100, outside="discard")).unranked == {}


def test_percentile_50_is_the_median() -> None:
    """Displacements 1, 3, 6, 7, 12: all from 6 on count 1, and 3 lies 2/5 of the way to 6."""
    plan = rank_poses(five(), Criteria(percentile=50))
    assert_allclose(plan.normalised["displacement"], [1, 0, 0.4, 1, 1])


def test_weights_count_as_given() -> None:
    """Displacement alone orders by displacement; twice the weight is twice the score."""
    alone = Criteria(displacement=2, coverage=0, axial=0, lateral=0)
    plan = rank_poses(five(), alone)
    assert plan.order.tolist() == [B, C, A, E, D]
    assert_allclose(plan.score, 2 * np.array(NORMALISED["displacement"]), atol=1e-12)
    coverage = rank_poses(five(), Criteria(0, 1, 0, 0))
    assert coverage.order.tolist() == [D, A, C, E, B]


def test_equal_poses_keep_their_order() -> None:
    twice = sweep_table(*([*values, *values] for values in FIVE.values()))
    assert rank_poses(twice).order[:4].tolist() == [C, C + 5, B, B + 5]


def test_of_poses_that_clipping_makes_equal_the_better_one_is_first() -> None:
    """At percentile 50, all coverages from 0.4 on count 1; discarded and few rays stay unranked."""
    coverage = [0.4, 0.3, 0.6, 0.5, 0.1, 0.9]
    rays = [1000] * 5 + [10]
    table = sweep_table(*([1.0] * 6, coverage, [1.0] * 6, [1.0] * 6), rays)
    plan = rank_poses(table, Criteria(0, 1, 0, 0, percentile=50))
    assert plan.score[[0, 2, 3]].tolist() == [0.0, 0.0, 0.0]
    assert plan.order.tolist() == [2, 3, 0, 1, 4]
    assert plan.best in pareto_front(table)


@given(
    random_tables(),
    st.lists(st.floats(0.01, 1.0), min_size=4, max_size=4),
    st.sampled_from([50.0, 95.0]),
)
def test_the_best_pose_is_on_the_pareto_front(
    table: dict[str, list[float]], weights: list[float], percentile: float
) -> None:
    plan = rank(table, **dict(zip(METRICS, weights, strict=True)), percentile=percentile)
    assert plan.best in pareto_front(sweep_table(**table))


@pytest.mark.parametrize("statistic", ["median", "p95"])
def test_robust_statistics_take_their_own_values(statistic: str) -> None:
    """With all displacements mirrored (13 - d), B has the largest one instead of the smallest."""
    table = changed(five(), f"displacement_{statistic}", [7, 12, 10, 1, 6])
    plan = rank_poses(table, Criteria(1, 0, 0, 0, statistic=statistic))
    assert plan.order.tolist() == [D, E, A, C, B]


def test_resolutions_take_their_own_values() -> None:
    table = changed(five(), "axial_resolution", [5, 4, 3, 2, 1])
    table = changed(table, "lateral_resolution", [1, 1, 2, 1, 1])
    assert rank_poses(table, Criteria(0, 0, 1, 0)).order.tolist() == [E, D, C, B, A]
    assert rank_poses(table, Criteria(0, 0, 0, 1)).order[-1] == C


def test_a_region_is_ranked_by_its_own_numbers() -> None:
    reverse = sweep_table(*(values[::-1] for values in FIVE.values()), rays_good=100)
    table = two_regions(five(), reverse, "head -x")
    plan = rank_poses(table, Criteria(region="head -x"))
    assert_allclose(plan.score, SCORES[::-1], atol=1e-12)
    assert_array_equal(rank_poses(table).score, rank_poses(five()).score)


def test_poses_that_see_nothing_never_win_and_change_nothing() -> None:
    """Null metrics, failures, untraced poses and too few rays, each with seductive numbers."""
    empty = np.nan
    table = sweep_table(
        [0.0, *FIVE["displacement"], 0.0, empty, 0.0, 0.0],
        [1.0, *FIVE["coverage"], 1.0, empty, 1.0, 1.0],
        [0.0, *FIVE["axial"], 0.0, empty, empty, np.inf],
        [0.0, *FIVE["lateral"], 0.0, empty, empty, 0.0],
        [99, *[100] * 5, 1000, -1, 1000, 1000],
    )
    table["failure"][6] = "the camera stands inside the part"
    plan = rank_poses(table)
    assert_allclose(plan.score[1:6], SCORES, atol=1e-12)
    assert plan.order.tolist() == [1 + pose for pose in (C, B, A, E, D)]
    assert plan.unranked == {
        0: "99 good rays, fewer than 100",
        6: "failed: the camera stands inside the part",
        7: "not traced",
        8: "no value of axial, lateral",
        9: "no value of axial",
    }
    assert 0 in rank_poses(table, Criteria(min_hits=99)).order


def test_a_pose_without_a_diameter_says_why() -> None:
    table = five()
    table["error_normal_p95"] = table["displacement_p95"]
    table["coverage_measured"] = table["coverage"]
    table["points_measured"] = table["rays_good"]
    table["size_error"] = table["displacement_p95"].where(table["pose"] != 2)
    plan = rank_poses(table, Criteria(criterion="features"))
    assert plan.unranked[2].endswith("(too few points on each cylinder, cone and sphere)")


def test_poses_that_see_too_little_never_win_and_change_nothing() -> None:
    """The best by far in all else sees 4 % of the part."""
    columns = {name: [0.04 if name == "coverage" else 0.0, *FIVE[name]] for name in METRICS}
    table = sweep_table(*columns.values(), [1000] * 6)
    assert rank_poses(table).best == 0
    assert 0 in pareto_front(table)
    plan = rank_poses(table, Criteria(min_coverage=0.05))
    assert plan.unranked == {0: "coverage 0.04, less than 0.05"}
    assert_allclose(plan.score[1:], SCORES, atol=1e-12)
    assert 0 not in pareto_front(table, Criteria(min_coverage=0.05))


def test_a_metric_without_weight_may_be_unknown() -> None:
    table = five(axial=[np.nan] * 5)
    plan = rank_poses(table, Criteria(axial=0))
    assert_allclose(plan.score, np.array(SCORES) - 0.15 * np.array(NORMALISED["axial"]))
    assert np.isnan(plan.normalised["axial"]).all()
    with pytest.raises(InputError, match="no value of axial_resolution for part"):
        rank_poses(table)


@pytest.mark.parametrize("name", METRICS)
def test_a_constant_metric_counts_zero(name: str) -> None:
    """The coverage, too: its cost is 0 then and not 1. Noise of rounding is no difference."""
    noise = 1 + np.array([0, 1, -1, 2, 0]) * 2.0**-52
    with pytest.warns(IriftraceWarning, match=rf"The ranked poses \(5\) do not differ in {name},"):
        plan = rank_poses(five(**{name: 0.3 * noise}))
    expected = sum(
        weight * (1 - np.array(NORMALISED[n]) if n == "coverage" else np.array(NORMALISED[n]))
        for n, weight in Criteria().weights.items()
        if n != name
    )
    assert_allclose(plan.score, expected, atol=1e-12)
    assert len(plan.warnings) == 1


def test_a_metric_that_hardly_differs_is_said_to_decide_as_much() -> None:
    """It counts as always, since the paper's normalisation knows no size."""
    little = 0.3 * (1 + 1e-3 * np.array(NORMALISED["lateral"]))
    with pytest.warns(IriftraceWarning, match=r"differ in lateral only by 0\.1 %"):
        plan = rank_poses(five(lateral=little))
    assert plan.constant == ()
    assert np.ptp(plan.normalised["lateral"]) == 1.0
    assert len(plan.warnings) == 1
    # A metric that is the only one cannot get the weight 0.
    with pytest.warns(IriftraceWarning, match=r"only by 0\.1 %, so their order says little\."):
        rank_poses(five(lateral=little), Criteria(0, 0, 0, 1))


def test_one_pose_is_the_best_of_one() -> None:
    with pytest.warns(IriftraceWarning, match="Only one pose is ranked"):
        plan = rank_poses(sweep_table([1], [0.1], [1], [1]))
    assert plan.order.tolist() == [0]
    assert plan.score.tolist() == [0]
    assert stability(plan).worst_rank == 1


def test_nearly_all_poses_at_the_minimum() -> None:
    """One of 40 poses sees more; minimum and percentile coincide, and it still counts as more."""
    count = 40
    coverage = [0.2] * (count - 1) + [0.4]
    table = sweep_table(np.arange(count), coverage, np.arange(count), np.arange(count))
    plan = rank_poses(table, Criteria(0, 1, 0, 0))
    assert plan.order[0] == count - 1
    assert_array_equal(plan.normalised["coverage"], [0] * (count - 1) + [1])


def test_a_sweep_from_a_file_ranks_alike(tmp_path: Path) -> None:
    five().to_netcdf(tmp_path / "sweep.nc", engine="h5netcdf")
    with xr.open_dataset(tmp_path / "sweep.nc", engine="h5netcdf") as table:
        plan = rank_poses(table)
    assert_allclose(plan.score, SCORES, atol=1e-12)


@pytest.mark.parametrize(
    ("given_weights", "words"),
    [
        ({"axial": -0.1}, "weight of axial is -0.1"),
        ({"coverage": np.nan}, "weight of coverage is nan"),
        ({"lateral": np.inf}, "weight of lateral is inf"),
        (dict.fromkeys(METRICS, 0), "All weights are zero"),
    ],
)
def test_impossible_weights_are_refused(given_weights: dict[str, float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        Criteria(**given_weights)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"statistic": "max"}, "Unknown statistic 'max'; use one of mean, median, p95"),
        ({"outside": "keep"}, "Unknown outside 'keep'; use one of clip, discard"),
        ({"region": "head +x"}, "no region 'head \\+x'; it has part"),
        ({"percentile": 0}, "percentile is 0"),
        ({"percentile": 101}, "percentile is 101"),
        ({"percentile": np.nan}, "percentile is nan"),
        ({"min_hits": 0}, "good rays is 0"),
        ({"min_coverage": 30}, r"coverage is 30, .*from 0 to 1"),
        ({"min_coverage": 1}, r"None of the 5 poses .*coverage 0\.\d+, less than 1"),
        ({"min_hits": 1001}, r"None of the 5 poses .*pose 3: 1000 good rays, fewer than 1001"),
    ],
)
def test_wrong_options_are_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        rank_poses(five(), Criteria(**options))


def test_other_files_are_refused() -> None:
    with pytest.raises(InputError, match="not a sweep of iriftrace: coverage is missing"):
        rank_poses(five().drop_vars("coverage"))
    with pytest.raises(InputError, match="not a sweep of iriftrace: region"):
        pareto_front(five().drop_vars("region"))
    with pytest.raises(InputError, match="no poses"):
        rank_poses(five().isel(pose=slice(0)))
    scattered = sweep_table([1, np.nan], [0.1, 0.2], [np.nan, 1], [1, 1])
    with pytest.raises(InputError, match="None of the 2 poses has all of displacement, coverage"):
        rank_poses(scattered)


@given(random_tables())
def test_scores_equal_a_loop_over_sorted_lists(table: dict[str, list[float]]) -> None:
    count = len(table["coverage"])
    expected = [0.0] * count
    for name, weight in zip(METRICS, (0.5, 0.2, 0.15, 0.15), strict=True):
        ascending = sorted(table[name])
        position = 0.95 * (count - 1)
        below = min(int(position), count - 2)
        upper = ascending[below] + (position - below) * (ascending[below + 1] - ascending[below])
        if ascending[0] == ascending[-1]:
            continue
        for pose, value in enumerate(table[name]):
            if upper - ascending[0] > 1e-12:
                share = min((value - ascending[0]) / (upper - ascending[0]), 1.0)
            else:
                share = float(value > ascending[0])
            expected[pose] += weight * (1 - share if name == "coverage" else share)
    plan = rank(table)
    assert_allclose(plan.score, expected, atol=1e-9)
    assert_array_equal(np.diff(plan.score[plan.order]) >= 0, True)


@given(random_tables(), st.floats(0.1, 100))
def test_units_do_not_matter(table: dict[str, list[float]], factor: float) -> None:
    """A metric in other units gives the same scores: normalised values have no unit."""
    scaled = {name: [factor * value for value in values] for name, values in table.items()}
    assert_allclose(rank(scaled).score, rank(table).score, atol=1e-9)


def test_discarding_compares_what_is_scored() -> None:
    """Means 1 to 20 mm and 2 standard deviations of 10 mm: the one beyond the percentile alone.

    The 95th percentile of 21 to 40 lies at 0.05 between the last two: 39.05; of the means 19.05.
    """
    values = np.arange(1.0, 21.0)
    table = sweep_table(values, [0.3] * 20, [0.1] * 20, [0.1] * 20)
    table["scatter_p95"] = table["displacement_p95"] * 0 + 10.0
    plan = rank_poses(table, Criteria(1, 0, 0, 0, outside="discard"))
    assert plan.unranked == {19: "displacement 40 is above the 95th percentile, 39.05"}
    assert plan.limits["displacement"] == pytest.approx((1.0, 19.05))
    assert np.isfinite(score_of(plan, {"displacement": 39.0}))
    assert np.isnan(score_of(plan, {"displacement": 39.1}))
