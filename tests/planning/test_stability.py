"""Stability of a ranking: other weights, Pareto front, poses outside, and what is said of it."""

import numpy as np
import pytest
from attrs import evolve
from five_poses import SCORES, A, B, C, D, changed, five, random_tables, rank
from hypothesis import given, settings

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.planning.criteria import METRICS, THE_PAPERS, Criteria
from iriftrace.planning.rank import pareto_front, rank_poses, ranked_quietly, score_of
from iriftrace.planning.stability import close_alternative, stability
from iriftrace.planning.summary import summarise
from iriftrace.planning.texts import alternative_text, least_error_text, other_statistics_text
from validation.inputs.sweep_tables import sweep_table


def test_stability_by_hand() -> None:
    """C against B, costs C - B: d 0.1, c -0.1, a -0.09375, l 0.0375 (weighted, sum -0.05625).

    With one weight halved or half as large again the sum changes by half of one of them, at most
    to -0.00625 (d up: C 0.34375, B 0.35), so C stays first; with all at once it can reach
    -0.05625 + 0.5 * 0.33125 > 0, so B is a rival. A: d -0.15, c 0.05, a 0.05625, l -0.0375, sum
    -0.08125 + 0.5 * 0.29375 > 0, a rival. D: d -0.4, c 0.1, a 0.01875, l -0.1125, sum -0.39375 +
    0.5 * 0.63125 < 0. E is worse than C in everything.
    """
    found = stability(rank_poses(five()))
    assert found.ranks == dict.fromkeys(METRICS, (1, 1))
    assert found.winners == dict.fromkeys(METRICS, (C, C))
    assert found.worst_rank == 1
    assert sorted(found.rivals.tolist()) == [A, B]


@settings(max_examples=30)
@given(random_tables())
def test_stability_is_what_ranking_anew_gives(table: dict[str, list[float]]) -> None:
    sweep = sweep_table(**table)
    plan = ranked_quietly(sweep, Criteria())
    found = stability(plan)
    for name in METRICS:
        for side, factor in enumerate((0.5, 1.5)):
            weights = Criteria().weights
            weights[name] *= factor
            score = ranked_quietly(sweep, Criteria(**weights)).score
            assert found.ranks[name][side] == 1 + np.count_nonzero(score < score[plan.best] - 1e-12)
            assert score[found.winners[name][side]] == pytest.approx(score.min(), abs=1e-12)
    corners = np.stack(np.meshgrid(*[(0.5, 1.5)] * 4), axis=-1).reshape(-1, 4)
    rivals = set()
    for corner in corners:
        weights = dict(zip(METRICS, corner * list(Criteria().weights.values()), strict=True))
        score = ranked_quietly(sweep, Criteria(**weights)).score
        rivals |= set(np.flatnonzero(score < score[plan.best] - 1e-12).tolist())
    assert set(found.rivals.tolist()) == rivals


def test_a_winner_by_a_hair_is_not_stable() -> None:
    """Pose 0 has the better displacement, pose 1 all else: 0.5 against 0.2 + 0.15 + 0.15."""
    table = sweep_table([1, 2], [0.1, 0.2], [2, 1], [2, 1])
    plan = rank_poses(table, Criteria(displacement=0.51))
    found = stability(plan)
    assert plan.best == 0
    assert found.ranks["displacement"] == (2, 1)
    assert found.winners["displacement"] == (1, 0)
    assert found.ranks["coverage"] == (1, 2)
    assert found.worst_rank == 2
    # A weight of zero stays zero.
    alone = stability(rank_poses(table, Criteria(1, 0, 0, 0)))
    assert alone.ranks == {"displacement": (1, 1)}


def test_pareto_front_by_hand() -> None:
    """E is worse than C in everything; every other pose is the best in something or near it."""
    assert pareto_front(five()).tolist() == [A, B, C, D]


@given(random_tables(smallest=1))
def test_pareto_front_equals_all_comparisons(table: dict[str, list[float]]) -> None:
    costs = list(
        zip(
            table["displacement"],
            [-value for value in table["coverage"]],
            table["axial"],
            table["lateral"],
            strict=True,
        )
    )
    expected = [
        i
        for i, mine in enumerate(costs)
        if not any(
            all(o <= m for o, m in zip(other, mine, strict=True)) and other != mine
            for other in costs
        )
    ]
    assert pareto_front(sweep_table(**table)).tolist() == expected


def test_pareto_front_leaves_out_what_cannot_be_compared() -> None:
    table = five(displacement=[6, np.nan, 3, 12, 7], rays_good=[1000, 1000, 99, 1000, 1000])
    # Without B and C, E is dominated by A.
    assert pareto_front(table).tolist() == [A, D]
    with pytest.raises(InputError, match="no region"):
        pareto_front(table, Criteria(region="lateral"))


@given(random_tables())
def test_a_pose_outside_is_scored_as_one_inside(table: dict[str, list[float]]) -> None:
    """Scoring the sweep's own poses one by one gives the sweep's scores."""
    plan = rank(table)
    for pose in range(len(table["coverage"])):
        metrics = {name: table[name][pose] for name in METRICS}
        assert score_of(plan, metrics) == pytest.approx(plan.score[pose], abs=1e-12)


def test_scores_of_other_poses_by_hand() -> None:
    """Beyond both ends of the normalisation, and with one value unknown."""
    plan = rank_poses(five())
    best = {"displacement": 0.5, "coverage": 0.6, "axial": 0.0, "lateral": 2.0}
    assert score_of(plan, best) == pytest.approx(0.0)
    worst = {"displacement": 20, "coverage": 0.0, "axial": 1.0, "lateral": 4.0}
    assert score_of(plan, worst) == pytest.approx(0.5 + 0.2 + 0.15 + 0.15 * 0.5)
    assert np.isnan(score_of(plan, {**worst, "axial": np.nan}))
    discarding = rank_poses(five(), Criteria(outside="discard"))
    assert np.isnan(score_of(discarding, worst))
    assert score_of(discarding, dict(zip(METRICS, (6, 0.4, 0.1, 4), strict=True))) == (
        pytest.approx(SCORES[A])
    )


def test_a_winner_that_sees_far_less_is_not_clear() -> None:
    """Pose 0 sees a tenth of pose 1 and is ahead by next to nothing; 2 sees no more, 3 is far.

    Normalised displacement 0, 0.2, 0.21, 1 (percentile 100) and coverage 0, 1, 0.05, 1: with
    weights 0.5 and 0.1 the scores are 0.1, 0.1 + x, 0.2, 0.5.
    """
    displacement = [1.0, 1.205, 1.21, 2.0]
    coverage = [0.04, 0.4, 0.058, 0.4]
    table = sweep_table(displacement, coverage, [1, 1, 1, 1], [1, 1, 1, 1])
    with pytest.warns(IriftraceWarning, match="axial, lateral"):
        plan = rank_poses(table, Criteria(0.5, 0.1, 0.2, 0.2, percentile=100))
    assert plan.score == pytest.approx([0.1, 0.1025, 0.2, 0.5])
    assert close_alternative(plan) == 1


@pytest.mark.parametrize(
    ("displacement", "coverage"),
    [
        ([1.0, 1.5, 2.0], [0.04, 0.4, 0.4]),  # far behind
        ([1.0, 1.201, 2.0], [0.30, 0.40, 0.4]),  # of the same kind
        ([1.0, 1.201, 2.0], [0.01, 0.03, 0.03]),  # next to nothing, both
    ],
)
def test_a_clear_winner_has_no_alternative(
    displacement: list[float], coverage: list[float]
) -> None:
    table = sweep_table(displacement, coverage, [1, 1, 1], [1, 1, 1])
    with pytest.warns(IriftraceWarning, match="axial, lateral"):
        plan = rank_poses(table, Criteria(0.5, 0.1, 0.2, 0.2, percentile=100))
    assert close_alternative(plan) is None


def test_the_default_is_the_displacement_below_which_nearly_all_rays_stay() -> None:
    """A few rays that jump rule the mean, and a median is blind to half of the picture."""
    table = changed(five(), "displacement_p95", [7, 12, 10, 1, 6])
    table = changed(table, "displacement_mean", [7, 1, 10, 12, 6])
    alone = {"displacement": 1, "coverage": 0, "axial": 0, "lateral": 0}
    assert rank_poses(table, Criteria(**alone)).best == 3
    assert THE_PAPERS.statistic == "mean"
    assert rank_poses(table, evolve(THE_PAPERS, **alone)).best == 1


def test_other_winners_are_said_where_they_differ() -> None:
    count = 5
    table = five()
    for name, values in (("mean", [7, 1, 10, 12, 6]), ("p95", [7, 12, 10, 1, 6])):
        table = changed(table, f"displacement_{name}", values)
    table = changed(table, "displacement_median", [np.nan] * count)
    found = summarise(table, Criteria(1, 0, 0, 0))
    assert found.other_winners == {"mean": 1}
    text = other_statistics_text(found)
    assert "95th percentile of the displacement pose 3 is the best, by its mean pose 1" in text
    same = table.assign(displacement_mean=table["displacement_p95"])
    assert other_statistics_text(summarise(same, Criteria(1, 0, 0, 0))) is None


def test_a_best_pose_that_sees_little_is_told() -> None:
    """Far ahead in all else, so that no other pose is as good."""
    criteria = Criteria(0.5, 0.1, 0.2, 0.2, percentile=100)
    table = sweep_table([1.0, 1.5, 2.0], [0.04, 0.4, 0.4], [1, 1, 1], [1, 1, 1])
    with pytest.warns(IriftraceWarning, match="axial, lateral"):
        text = alternative_text(summarise(table, criteria))
    assert text is not None
    assert "sees 4.0 % of the part, another one 40.0 %" in text


def test_the_least_error_is_named_where_another_pose_is_the_best() -> None:
    table = sweep_table([1.0, 2.0, 9.0], [0.1, 0.8, 0.8], [3, 1, 1], [3, 1, 1])
    weighed = summarise(table)
    assert weighed.plan.best == 1
    text = least_error_text(weighed)
    assert text is not None
    assert "Pose 0 has the least 95th-percentile displacement" in text
    assert "sees 10 % of the part instead of 80 %" in text
    alone = summarise(table, Criteria(criterion="displacement"))
    assert alone.plan.order.tolist() == [0, 1, 2]
    assert least_error_text(alone) is None
    enough = summarise(table, Criteria(criterion="displacement", min_coverage=0.5))
    assert enough.plan.best == 1


def test_a_pose_of_an_ensemble_counts_with_its_scatter() -> None:
    """Two standard deviations on top of the mean, unless other ones are asked for."""
    table = sweep_table([1.0, 2.0, 3.0, 6.0], [0.3] * 4, [0.1] * 4, [0.1] * 4)
    alone = Criteria(1, 0, 0, 0)
    assert rank_poses(table, alone).order.tolist() == [0, 1, 2, 3]
    with pytest.raises(InputError, match="of a single field"):
        rank_poses(table, evolve(alone, robust=2.0))
    scatter = np.array([[2.0], [0.1], [0.0], [0.0]])
    table["scatter_p95"] = table["displacement_p95"] * 0 + scatter
    plan = rank_poses(table, alone)
    assert plan.metrics["displacement"].tolist() == pytest.approx([5.0, 2.2, 3.0, 6.0])
    assert plan.order.tolist() == [1, 2, 0, 3]
    assert rank_poses(table, evolve(alone, robust=0.0)).order.tolist() == [0, 1, 2, 3]


def test_scatter_of_one_pose_leaves_the_scale_of_the_others() -> None:
    """Twice the displacement is worse than 1 % more of the part, however another pose scatters."""
    table = sweep_table([1.0, 2.0, 3.0], [0.3, 0.31, 0.9], [0.1] * 3, [0.1] * 3)
    table["scatter_p95"] = table["displacement_p95"] * 0 + np.array([[0.0], [0.0], [1e3]])
    assert rank_poses(table, Criteria(0.5, 0.2, 0, 0)).best == 0
