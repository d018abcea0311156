"""The score of poses and pairs, by hand."""

import numpy as np
import pytest

from iriftrace.planning.objective import Objective, limits_of

VALUES = {"error": np.array([1.0, 2.0, 5.0, 7.0]), "seen": np.array([0.2, 0.4, 0.1, 0.6])}
LIMITS = {"error": (1.0, 5.0), "seen": (0.2, 0.6)}
WEIGHTS = {"error": 2.0, "seen": 1.0}


@pytest.mark.parametrize(
    ("clipped", "error", "seen"),
    [(True, [0, 0.25, 1, 1], [0, 0.5, 0, 1]), (False, [0, 0.25, 1, 1.5], [0, 0.5, -0.25, 1])],
)
def test_costs_are_weighted_and_a_gain_costs_what_is_missing(
    clipped: bool, error: list[float], seen: list[float]
) -> None:
    objective = Objective(WEIGHTS, LIMITS, gains=("seen",), clipped=clipped)
    expected = 2 * np.array(error) + 1 - np.array(seen)
    np.testing.assert_allclose(objective.score(VALUES), expected, atol=1e-15)


def test_what_is_the_same_everywhere_counts_nothing() -> None:
    """Also as a gain, which costs nothing then instead of all of its weight."""
    objective = Objective(WEIGHTS, LIMITS, constant=("seen",), gains=("seen",))
    np.testing.assert_array_equal(objective.score(VALUES), [0, 0.5, 2, 2])


def test_a_vanishing_interval_tells_the_minimum_from_the_rest() -> None:
    """The limit of ever narrower intervals above the minimum."""
    values = np.array([1.0, 1.0, 1.0, 1.5, np.nan])
    limits = limits_of(values, 50)
    assert limits == (1.0, 1.0)
    objective = Objective({"error": 1.0}, {"error": limits})
    np.testing.assert_array_equal(objective.score({"error": values}), [0, 0, 0, 1, np.nan])


def test_an_unknown_quantity_matters_only_with_a_weight() -> None:
    values = {**VALUES, "seen": np.full(4, np.nan)}
    limits = {**LIMITS, "seen": limits_of(values["seen"], 95)}
    assert np.isnan(Objective(WEIGHTS, limits).score(values)).all()
    without = Objective({"error": 1.0, "seen": 0.0}, limits)
    np.testing.assert_array_equal(without.score(values), [0, 0.25, 1, 1])
