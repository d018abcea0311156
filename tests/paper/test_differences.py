"""Statistics of two runs against numbers worked out by hand."""

import numpy as np
import pytest

from iriftrace.core.errors import InputError
from validation.paper.differences import Hits, compare, displacement_statistics


def hits(displacement: np.ndarray, good: np.ndarray, hit: np.ndarray | None = None) -> Hits:
    return Hits(displacement, good, good if hit is None else hit)


def test_distances_of_matched_rays_give_the_statistics() -> None:
    # Distances 1, 2 ... 100 mm in changing directions, about an arbitrary common displacement.
    count = 100
    directions = np.eye(3)[np.arange(count) % 3]
    reference = np.full((count, 3), 0.25)
    here = reference + directions * np.arange(1, count + 1)[:, None]
    everyone = np.ones(count, dtype=bool)
    found = compare(hits(here, everyone), hits(reference, everyone))
    squares = np.arange(1, count + 1) ** 2.0
    assert found.rmse == pytest.approx(np.sqrt(squares.mean()))
    # The one ray in a hundred that differs most is left out.
    assert found.rmse_trimmed == pytest.approx(np.sqrt(squares[:99].mean()))
    assert found.median == pytest.approx(50.5)
    assert found.p95 == pytest.approx(95.05)
    assert (found.matched, found.only_here, found.only_reference) == (100, 0, 0)


def test_rays_that_are_good_in_one_run_only_are_counted_and_nothing_else() -> None:
    here = hits(np.ones((4, 3)), np.array([True, True, False, False]))
    wild = np.array([[1, 1, 1], [9, 9, 9], [7, 7, 7], [0, 0, 0]], dtype=float)
    found = compare(here, hits(wild, np.array([True, False, True, True])))
    assert (found.matched, found.only_here, found.only_reference) == (1, 1, 2)
    assert found.rmse == found.p95 == 0.0


def test_trimming_leaves_at_least_one_ray() -> None:
    one = np.array([True])
    assert compare(hits(np.ones((1, 3)), one), hits(np.zeros((1, 3)), one)).rmse_trimmed > 1.7


def test_pictures_without_common_rays_cannot_be_compared() -> None:
    one, other = np.array([True, False]), np.array([False, True])
    with pytest.raises(InputError, match="No ray is good in both"):
        compare(hits(np.ones((2, 3)), one), hits(np.ones((2, 3)), other))
    with pytest.raises(InputError, match="2 and 3 pixels"):
        compare(hits(np.ones((2, 3)), one), hits(np.ones((3, 3)), np.ones(3, dtype=bool)))


def test_a_run_states_its_own_size_and_what_it_lost() -> None:
    displacement = np.array([[3.0, 4.0, 0.0], [0.0, 0.0, 1.0], [50.0, 0.0, 0.0]])
    good, hit = np.array([True, True, False]), np.array([True, True, True])
    size = displacement_statistics(hits(displacement, good, hit))
    assert size["displacement_median"] == pytest.approx(3.0)
    assert size["displacement_rms"] == pytest.approx(np.sqrt(13.0))
    assert (size["rays_good"], size["rays_lost"]) == (2, 1)
    with pytest.raises(InputError, match="No ray"):
        displacement_statistics(hits(displacement, np.zeros(3, dtype=bool)))
