"""Sets of views against a cube that can be counted, and against trying all sets."""

from itertools import combinations, product
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from iriftrace.core.errors import InputError
from iriftrace.planning import cover as view_cover
from iriftrace.planning.cover import choose_views


def best_by_trying(seen: np.ndarray, areas: np.ndarray, k: int) -> float:
    sets = combinations(range(len(seen)), min(k, len(seen)))
    return max(float(areas[seen[list(s)].any(axis=0)].sum()) for s in sets) / float(areas.sum())


def cube_seen_from(directions: np.ndarray) -> np.ndarray:
    """A distant camera sees a face of the cube where the outward normal points towards it."""
    normals = np.concatenate((np.eye(3), -np.eye(3)))
    return directions @ normals.T > 1e-9


CORNERS = np.array(list(product((-1, 1), repeat=3)), dtype=float)
EDGES = np.array([d for d in product((-1, 0, 1), repeat=3) if d.count(0) == 1], dtype=float)
AXES = np.concatenate((np.eye(3), -np.eye(3)))


@pytest.mark.parametrize(
    ("directions", "expected"),
    [
        (AXES, [1, 2, 3, 4, 5, 6, 6]),  # one face each
        (EDGES, [2, 4, 6, 6, 6, 6, 6]),  # two faces each
        (CORNERS, [3, 6, 6, 6, 6, 6, 6]),  # three faces each
    ],
)
def test_cube_with_one_kind_of_view(directions: np.ndarray, expected: list[int]) -> None:
    for k, faces in enumerate(expected, start=1):
        found = choose_views(cube_seen_from(directions), np.ones(6), k)
        assert found.covered == pytest.approx(faces / 6)
        assert found.exact
        # Poses that add nothing are left out: no more than needed for the six faces.
        assert len(found.poses) == min(k, expected.index(6) + 1)


# Six faces. The third pose sees the most (4), after which neither other one completes the six;
# the first two do.
TRAP = np.array([[1, 1, 1, 0, 0, 0], [0, 0, 0, 1, 1, 1], [0, 1, 1, 1, 1, 0]], dtype=bool)


def test_one_at_a_time_falls_into_the_trap_and_the_choice_does_not() -> None:
    groups, shares = view_cover._grouped(TRAP, np.full(6, 1 / 6))
    assert view_cover._greedy(groups, shares, 2)[0] == 2
    found = choose_views(TRAP, np.ones(6), 2)
    assert sorted(found.poses) == [0, 1]
    assert found.covered == pytest.approx(1)
    assert found.exact


def test_areas_decide() -> None:
    """The middle four faces weigh more than the outer two together with any half."""
    found = choose_views(TRAP, [1, 10, 10, 10, 10, 1], 1)
    assert found.poses.tolist() == [2]
    assert found.covered == pytest.approx(40 / 42)
    assert found.coverable == pytest.approx(1)


def test_faces_that_no_pose_sees_count_in_the_area() -> None:
    seen = np.array([[True, False, False], [False, True, False]])
    found = choose_views(seen, [1, 1, 2], 5)
    assert sorted(found.poses) == [0, 1]
    assert found.covered == pytest.approx(0.5)
    assert found.coverable == pytest.approx(0.5)
    assert found.exact


@st.composite
def cases(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, int]:
    poses, faces = draw(st.integers(1, 8)), draw(st.integers(1, 14))
    seen = draw(npst.arrays(np.bool_, (poses, faces)))
    seen[draw(st.integers(0, poses - 1)), 0] = True
    areas = draw(npst.arrays(np.int64, faces, elements=st.integers(0, 9)))
    areas[0] += 1
    return seen, areas.astype(float), draw(st.integers(1, 4))


@settings(max_examples=50)
@given(cases())
def test_small_cases_are_exact(case: tuple[np.ndarray, np.ndarray, int]) -> None:
    seen, areas, k = case
    found = choose_views(seen, areas, k)
    assert found.exact
    assert found.covered == pytest.approx(best_by_trying(seen, areas, k), abs=1e-9)
    assert len(found.poses) <= k
    together = areas[seen[found.poses].any(axis=0)].sum() / areas.sum()
    assert found.covered == pytest.approx(together)
    assert found.added.sum() == pytest.approx(found.covered)
    assert (np.diff(found.added) <= 1e-12).all()
    assert (found.added > 0).all()


@pytest.mark.parametrize(("small", "large"), [(0, 10**6), (0, 0)])
@settings(max_examples=30)
@given(case=cases())
def test_the_gap_of_large_cases_holds(
    case: tuple[np.ndarray, np.ndarray, int], small: int, large: int
) -> None:
    """Without the exact solver, and also without the relaxed program, the optimum is bracketed."""
    seen, areas, k = case
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(view_cover, "_SMALL", small)
        patch.setattr(view_cover, "_LARGE", large)
        found = choose_views(seen, areas, k)
    optimum = best_by_trying(seen, areas, k)
    assert found.covered <= optimum + 1e-9
    assert found.covered + found.gap >= optimum - 1e-6
    assert found.covered >= (1 - 1 / np.e) * optimum - 1e-9
    if found.exact:
        assert found.covered == pytest.approx(optimum, abs=1e-6)


def test_the_gap_is_that_of_the_relaxed_program(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two bodies whose relaxed programs can be solved in the head.

    Ring of five faces, each pose sees two neighbours: two poses see four faces; two fifths of every
    pose see 4/5 of each face, which is four as well, so the greedy answer is proven. Seven faces,
    each pose sees all but one line of the Fano plane, that is four: two poses see six; two sevenths
    of every pose see each face four times, 8/7, that is all seven. The gap is one face, and only
    the exact solver closes it.
    """
    ring = np.array([np.roll([1, 1, 0, 0, 0], i) for i in range(5)], dtype=bool)
    fano = np.array([np.roll([1, 1, 0, 1, 0, 0, 0], i) for i in range(7)]) == 0
    whole = choose_views(fano, np.ones(7), 2)
    assert whole.covered == pytest.approx(6 / 7)
    assert whole.exact
    monkeypatch.setattr(view_cover, "_SMALL", 0)
    tight = choose_views(ring, np.ones(5), 2)
    assert tight.covered == pytest.approx(4 / 5)
    assert tight.exact
    loose = choose_views(fano, np.ones(7), 2)
    assert loose.covered == pytest.approx(6 / 7)
    assert not loose.exact
    assert loose.gap == pytest.approx(1 / 7)


def test_giving_up_says_how_far_the_optimum_can_be(monkeypatch: pytest.MonkeyPatch) -> None:
    """One branch is not enough for 60 random views; the bound must not fall below a better set."""
    rng = np.random.default_rng(3)
    seen = rng.random((60, 120)) < 0.1
    patient = choose_views(seen, np.ones(120), 6)
    monkeypatch.setattr(view_cover, "_MOST_WORK", 1)
    hasty = choose_views(seen, np.ones(120), 6)
    assert hasty.covered <= patient.covered + 1e-9
    assert hasty.covered + hasty.gap >= patient.covered - 1e-9
    assert hasty.gap >= patient.gap - 1e-9


@pytest.mark.parametrize(
    ("seen", "areas", "k", "words"),
    [
        (TRAP, np.ones(6), 0, "number of views is 0"),
        (TRAP, np.ones(5), 1, r"\(3, 6\) and the areas \(5,\)"),
        (TRAP[0], np.ones(6), 1, r"shape \(6,\)"),
        (TRAP, [1, 1, 1, 1, 1, -1], 1, "negative"),
        (TRAP, [1, 1, 1, 1, 1, np.nan], 1, "not finite"),
        (TRAP & False, np.ones(6), 1, "None of the 3 poses sees any"),
        (TRAP, np.zeros(6), 1, "None of the 3 poses sees any"),
        (np.zeros((0, 6), bool), np.ones(6), 1, "None of the 0 poses"),
    ],
)
def test_wrong_input_is_refused(seen: Any, areas: Any, k: int, words: str) -> None:
    with pytest.raises(InputError, match=words):
        choose_views(seen, areas, k)
