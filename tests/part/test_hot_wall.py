"""Temperatures of a hot part's wall: those by which it expands, unless others are given."""

import pytest

from iriftrace.core.errors import IriftraceWarning
from iriftrace.core.units import Temperature
from iriftrace.part.hot_temperature import HotTemperatures

UNEVEN = HotTemperatures.of(["1100 degC", "head +x=450 degC"])
ONE = HotTemperatures.of("1100 degC")
HOT = Temperature("1100 degC")


def test_the_wall_has_the_temperatures_of_the_part() -> None:
    """Without a warning, as if the same ones were given twice."""
    own = ["head +x=723.15 K"]
    assert UNEVEN.wall(None, None) == (HOT, own)
    assert UNEVEN.wall(None, ["head +x=450 degC"]) == (HOT, own)
    assert UNEVEN.wall(HOT, ["head +x=450.5 degC"]) == (HOT, ["head +x=723.65 K"])
    assert ONE.wall(None, ["head -x=1100 degC"]) == (HOT, ["head -x=1373.15 K"])
    assert HotTemperatures().wall(HOT, None) == (HOT, None)


@pytest.mark.parametrize(
    ("hot", "wall", "regions", "expected", "words"),
    [
        (UNEVEN, HOT, None, None, "at 1100 degC, head +x=450 degC, but its wall has 1100 degC;"),
        (
            UNEVEN,
            None,
            ["head -x=600 degC"],
            ["head +x=723.15 K", "head -x=873.15 K"],
            "but its wall has 1100 degC, head +x=450 degC, head -x=600 degC; leave one",
        ),
        (
            ONE,
            None,
            ["head +x=450 degC"],
            ["head +x=723.15 K"],
            "size at 1100 degC, but its wall has 1100 degC, head +x=450 degC;",
        ),
    ],
)
def test_other_temperatures_of_a_region_are_warned_of(
    hot: HotTemperatures,
    wall: Temperature | None,
    regions: list[str] | None,
    expected: list[str] | None,
    words: str,
) -> None:
    """And a region's own temperature stays if another region is given one."""
    with pytest.warns(IriftraceWarning) as warned:
        assert hot.wall(wall, regions) == (HOT, expected)
    assert words in str(warned[0].message)
