"""Statistics and even sequences against numbers known by hand."""

import numpy as np
import pytest

from iriftrace.core.sampling import r2_sequence
from iriftrace.core.statistics import SPREAD, rms, spread


def test_statistics_of_an_arithmetic_sequence() -> None:
    found = spread(np.arange(101.0)[::-1], (*SPREAD, "p25"))
    assert found == {
        "mean": 50.0,
        "median": 50.0,
        "p95": 95.0,
        # The sum of n squares is n (n + 1) (2 n + 1) / 6.
        "rms": pytest.approx(np.sqrt(100 * 201 / 6)),
        "min": 0.0,
        "max": 100.0,
        "p25": 25.0,
    }
    assert list(spread(np.ones(3), ("max", "median"))) == ["max", "median"]


def test_rms_of_vectors_is_that_of_their_lengths() -> None:
    assert rms(np.array([[3.0, 4.0], [0.0, 0.0]])) == pytest.approx(np.sqrt(12.5))


def test_the_r2_sequence_fills_a_square_evenly() -> None:
    points = r2_sequence(1000, 0.5)
    counts, _, _ = np.histogram2d(*points.T, bins=10, range=[(0, 1), (0, 1)])
    assert counts.min() >= 7  # of 10; of random points some bins would have 3
    assert counts.max() <= 13
    # The plastic number g solves g^3 = g + 1; the steps are 1 / g and 1 / g^2.
    step = r2_sequence(2)[1]
    np.testing.assert_allclose(step**-1.0, [1.324717957244746, 1.324717957244746**2])
