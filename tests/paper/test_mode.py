"""Modes: which shells they make, and what they refuse."""

import warnings

import numpy as np
import pytest
from attrs import asdict, evolve

from iriftrace.core.errors import InputError
from validation.inputs.shell_fields import AMBIENT, HOTTEST, sphere_field
from validation.paper.mode import OURS, PAPERS, Mode, check_modes, one_change_each, shells_of


def test_rules_place_the_shells_where_they_say() -> None:
    e = np.linspace(AMBIENT, HOTTEST, 5)
    ours = shells_of(sphere_field(), 4, OURS)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        papers = shells_of(sphere_field(), 4, PAPERS)
    assert ours is not None
    assert papers is not None
    steps = np.linspace(AMBIENT, HOTTEST, 4)
    levels = [0.9 * steps[0] + 0.1 * steps[1], *(steps[1:] + steps[:-1]) / 2]
    np.testing.assert_allclose([s.refractivity for s in ours.shells], levels)
    # The fourth level is the hottest air itself, which is one point of this field.
    np.testing.assert_allclose([s.refractivity for s in papers.shells], e[1:4])


def test_by_the_outer_rule_some_stacks_are_part_of_the_reference() -> None:
    """All shells of 5 are among those of 20, facet by facet; of 6 only the one in the middle is."""
    field = sphere_field()
    reference = shells_of(field, 20, PAPERS)
    assert reference is not None
    known = {shell.vertices.tobytes() for shell in reference.shells}
    for layers, shared in ((4, 3), (5, 4), (6, 1), (7, 0), (10, 9)):
        stack = shells_of(field, layers, PAPERS)
        assert stack is not None
        assert sum(shell.vertices.tobytes() in known for shell in stack.shells) == shared


@pytest.mark.parametrize("mode", [OURS, PAPERS])
def test_dropping_inner_shells_leaves_the_others_as_they_are(mode: Mode) -> None:
    field = sphere_field()
    whole = shells_of(field, 6, mode)
    kept = shells_of(field, 6, evolve(mode, drop_inner=[2]))
    assert whole is not None
    assert kept is not None
    assert [shell.layer for shell in kept.shells] == [1, 2, 3, 4]
    for one, other in zip(whole.shells, kept.shells, strict=False):
        assert (one.ext, one.int_) == (other.ext, other.int_)
        np.testing.assert_array_equal(one.vertices, other.vertices)


def test_each_field_can_drop_another_number() -> None:
    mode = Mode("m", drop_inner=[3, 0])
    assert (mode.left(5, 0), mode.left(5, 1)) == (2, 5)
    assert Mode("m", drop_inner=[2]).left(5, 7) == 3
    with pytest.raises(InputError, match="2 numbers of inner shells"):
        check_modes([mode], 3)


def test_no_shell_left_is_said_or_none() -> None:
    field = sphere_field()
    assert shells_of(field, 1, PAPERS) is None
    assert shells_of(field, 3, evolve(OURS, drop_inner=[3])) is None
    with pytest.raises(InputError, match="leaves none"):
        check_modes([PAPERS], 1, 1)
    with pytest.raises(InputError, match="0 layers"):
        shells_of(field, 0, OURS)


def test_explaining_modes_change_one_choice_each_to_ours() -> None:
    papers = evolve(PAPERS, drop_inner=[3])
    ours = asdict(OURS)
    changed = []
    for mode in one_change_each(papers):
        different = {
            key: value
            for key, value in asdict(mode).items()
            if key != "name" and value != asdict(papers)[key]
        }
        ((key, value),) = different.items()
        assert value == ours[key]
        changed.append(key)
    assert changed == ["normals", "index_rule", "inside_hit", "drop_inner"]
    assert len(one_change_each(PAPERS)) == 3
