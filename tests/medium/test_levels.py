"""Levels of the index, and shells as values, by hand."""

import re

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from iriftrace.core.errors import InputError
from iriftrace.medium.shells.levels import index_levels, layers_between
from iriftrace.medium.shells.stack import Shell, ShellStack
from validation.inputs.shell_fields import (
    AIR,
    AMBIENT,
    CUBE_CORNERS,
    CUBE_FACES,
)


@pytest.mark.parametrize(
    ("rule", "surfaces", "layers"),
    [
        ("midpoint", [9, 7, 5], [10, 8, 6, 4]),
        # Two equal steps, a shell at a tenth of the outer one, and the layer midway between both.
        ("rim", [9.7, 8.5, 5.5], [10, 9.1, 7, 4]),
        # The cosine's steps of 6 are 1.5, 3 and 1.5, equal ones 2: seven tenths and three.
        ("graded", [9.175, 7, 4.825], [10, 8.35, 5.65, 4]),
        ("outer", [8, 6, 4], [10, 8, 6, 4]),
        # A single shell has no rim.
        ("rim", [7], [10, 4]),
        ("midpoint", [7], [10, 4]),
    ],
)
def test_levels_by_hand(rule, surfaces, layers):
    found, e = index_levels(10e-5, 4e-5, layers=len(surfaces), rule=rule)
    assert_allclose(found, np.multiply(surfaces, 1e-5))
    assert_allclose(e, np.multiply(layers, 1e-5))


@given(st.integers(1, 200))
def test_graded_steps_fill_the_range_evenly_to_both_sides(layers):
    steps = -np.diff(index_levels(10e-5, 4e-5, layers, "graded")[1]) * layers / 6e-5
    assert_allclose(steps, steps[::-1], rtol=1e-9)
    assert_allclose(steps.mean(), 1)
    # 0.3 of an equal step at the ends, where the cosine is flat, and 1.4 of one in the middle.
    assert steps[0] == pytest.approx(0.3 + 0.35 * (1 - np.cos(np.pi / layers)) * layers)
    assert steps.max() <= 0.3 + 0.35 * np.pi + 1e-9


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((4e-5, 10e-5), "higher index"),
        ((4e-5, 4e-5), "higher index"),
        ((np.nan, 4e-5), "higher index"),
        ((4e-5, -1e-5), "higher index"),
        ((10e-5, 4e-5, 0), "0 layers"),
        ((10e-5, 4e-5, 3, "inner"), "'inner'"),
    ],
)
def test_impossible_levels_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        index_levels(*arguments)


@given(st.integers(1, 200), st.floats(0, 2.6e-4), st.floats(2.65e-4, 3e-4))
def test_reversed_midpoint_rule_gives_equal_steps_back(layers, hottest, ambient):
    surfaces, e = index_levels(ambient, hottest, layers, "midpoint")
    sorted_back, e_back = layers_between(surfaces[::-1], ambient)
    assert_allclose(sorted_back, surfaces)
    assert_allclose(e_back, e, atol=1e-15)


def test_reversed_midpoint_rule_of_unequal_levels():
    # e_1 midway between 9 and 6; the innermost one as far inside 6 as 6 is from e_1.
    _, e = layers_between([9e-5, 6e-5], 10e-5)
    assert_allclose(e, [10e-5, 7.5e-5, 4.5e-5])
    # No air is hotter than the hottest.
    assert_allclose(layers_between([9e-5, 6e-5], 10e-5, 5e-5)[1][-1], 5e-5)


@pytest.mark.parametrize("levels", [[], [np.nan], [9e-5, 9e-5], [10e-5], [3e-5], [0.0]])
def test_impossible_custom_levels_are_refused(levels):
    with pytest.raises(InputError, match="levels"):
        layers_between(levels, 10e-5, 4e-5 if levels != [0.0] else None)


def test_shell_keeps_float32_and_refuses_damage():
    shell = Shell(1, 2e-4, 2.5e-4, 1.5e-4, CUBE_CORNERS, CUBE_FACES, CUBE_CORNERS)
    assert shell.vertices.dtype == np.float32
    assert shell.faces.dtype == np.int32
    assert shell.normals.dtype == np.float32
    with pytest.raises(InputError, match="no triangle"):
        Shell(1, 2e-4, 2.5e-4, 1.5e-4, CUBE_CORNERS, CUBE_FACES[:0])
    with pytest.raises(InputError, match="vertex number 8"):
        Shell(1, 2e-4, 2.5e-4, 1.5e-4, CUBE_CORNERS, CUBE_FACES + 1)
    with pytest.raises(InputError, match="not finite"):
        Shell(1, 2e-4, 2.5e-4, 1.5e-4, CUBE_CORNERS * np.nan, CUBE_FACES)
    with pytest.raises(InputError, match="7 normals"):
        Shell(1, 2e-4, 2.5e-4, 1.5e-4, CUBE_CORNERS, CUBE_FACES, CUBE_CORNERS[:7])
    assert evolve(shell, derivatives=np.ones((8, 7))).derivatives.dtype == np.float32
    for shape in ((7, 7), (8, 6), (8, 1), (8,)):
        with pytest.raises(InputError, match=re.escape(f"shape {shape} for 8 vertices")):
            evolve(shell, derivatives=np.ones(shape))
    with pytest.raises(InputError, match="or no normals"):
        Shell(1, 2e-4, 2.5e-4, 1.5e-4, CUBE_CORNERS, CUBE_FACES, None, np.ones((8, 7)))


def test_stack_tells_temperatures_and_refuses_nothing_and_unknown_rules():
    shell = Shell(1, AMBIENT / 2, AMBIENT, AMBIENT / 3, CUBE_CORNERS, CUBE_FACES)
    stack = ShellStack([shell], AIR, "custom")
    # Half the refractivity means half the density, hence twice the absolute temperature.
    assert_allclose(stack.temperature_k, [2 * 293.15])
    assert stack.triangles == 12
    assert not stack.has_normals
    with pytest.raises(InputError, match="without shells"):
        ShellStack([], AIR, "custom")
    with pytest.raises(InputError, match="'other'"):
        ShellStack([shell], AIR, "other")
