"""Temperatures of the wall by region, with and without a transition."""

import numpy as np
import pytest

from iriftrace.core.errors import InputError
from iriftrace.part.part import Part
from iriftrace.part.wall_temperature import WallTemperatures, wall_temperature
from validation.inputs.parts import bar_of_halves, papers_cylinder

COOL, HOT = 723.15, 1373.15


@pytest.fixture(scope="module")
def cylinder() -> Part:
    return papers_cylinder()


@pytest.fixture(scope="module")
def halves() -> Part:
    return bar_of_halves()


def along(x: np.ndarray) -> np.ndarray:
    """Points on the bar's top."""
    return np.column_stack((x, np.zeros_like(x), np.full_like(x, 5.0)))


def test_one_temperature_for_all(cylinder: Part) -> None:
    found = wall_temperature(WallTemperatures(HOT), cylinder, cylinder.face_centres)
    assert (found == HOT).all()


def test_each_face_has_the_temperature_of_its_region(cylinder: Part) -> None:
    wall = WallTemperatures(HOT, {"head +x": COOL})
    found = wall_temperature(wall, cylinder, cylinder.face_centres)
    head = cylinder.region_of_face == cylinder.region_names.index("head +x")
    assert head.any()
    assert (found[head] == COOL).all()
    assert (found[~head] == HOT).all()


def test_transition_is_the_tanh_of_the_formula(halves: Part) -> None:
    """T = T1 + (T2 - T1) (1 + tanh(x / (0.455 w))) / 2, which is 10 % and 90 % at +-w/2."""
    width = 10.0
    wall = WallTemperatures(HOT, {"steel": COOL}, width)
    x = np.linspace(-20.0, 20.0, 81)
    expected = COOL + (HOT - COOL) * 0.5 * (1 + np.tanh(x * 2 * np.arctanh(0.8) / width))
    assert wall_temperature(wall, halves, along(x)) == pytest.approx(expected, abs=1e-3)
    tenth, ninetieth = wall_temperature(wall, halves, along(np.array([-5.0, 5.0])))
    assert (tenth - COOL) / (HOT - COOL) == pytest.approx(0.1, abs=1e-6)
    assert (ninetieth - COOL) / (HOT - COOL) == pytest.approx(0.9, abs=1e-6)


def test_transition_ignores_regions_of_the_same_temperature(cylinder: Part) -> None:
    """Two heads of one temperature count once, or a point between them would be pulled twice."""
    both = WallTemperatures(HOT, {"head +x": COOL, "head -x": COOL}, 10.0)
    one = WallTemperatures(HOT, {"head +x": COOL}, 10.0)
    near = cylinder.face_centres[cylinder.face_centres[:, 0] > 60.0]
    assert len(near)
    assert wall_temperature(both, cylinder, near) == pytest.approx(
        wall_temperature(one, cylinder, near), abs=1e-6
    )


def test_sharp_edge_without_transition(halves: Part) -> None:
    wall = WallTemperatures(HOT, {"steel": COOL})
    found = wall_temperature(wall, halves, along(np.array([-30.0, -0.1, 0.1, 30.0])))
    assert found.tolist() == [COOL, COOL, HOT, HOT]


def test_edge_of_two_temperatures_has_one_of_them_however_it_was_rounded(halves: Part) -> None:
    """A field stores its points as float32; its check must find the temperature that was set."""
    wall = WallTemperatures(HOT, {"steel": COOL})
    found = wall_temperature(wall, halves, along(np.linspace(-1e-5, 1e-5, 21)))
    assert len(set(found.tolist())) == 1


@pytest.mark.parametrize(
    ("wall", "message"),
    [
        (WallTemperatures(HOT, {"tooth": COOL}), r'no region "tooth".*steel, nickel'),
        (WallTemperatures(293.15), "hotter than the air"),
        (WallTemperatures(HOT, {"steel": 20.0}), "hotter than the air"),
        (WallTemperatures(5000.0), "at most 3000 K"),
        (WallTemperatures(float("nan")), "hotter than the air"),
        (WallTemperatures(HOT, {}, 10.0), "two temperatures"),
        (WallTemperatures(HOT, {"steel": HOT}, 10.0), "two temperatures"),
        (WallTemperatures(HOT, {"steel": COOL}, -1.0), "is impossible"),
    ],
)
def test_impossible_walls_are_refused(halves: Part, wall: WallTemperatures, message: str) -> None:
    with pytest.raises(InputError, match=message):
        wall.check(halves, 293.15)
