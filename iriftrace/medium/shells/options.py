"""Options of shells, for Python and for commands."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from attrs import field, frozen
from attrs.converters import optional

from iriftrace.core.errors import InputError
from iriftrace.core.number_lists import Numbers
from iriftrace.core.units import Length, Temperature

if TYPE_CHECKING:
    from iriftrace.medium.air.refractivity import Air

Rule = Literal["rim", "midpoint", "graded", "outer"]

_MOST_OF_AIR = 0.01
"""n - 1 of air is far below this; a temperature in degC, or n itself, is above."""


@frozen
class ShellOptions:
    """Contouring of the field, once it is read.

    Parameters
    ----------
    layers
        Number of shells.
    index_range
        End points OUTSIDE:INSIDE of the index steps, as n - 1 (2.718e-4:5.8e-5) or as temperatures
        ("20 degC:1100 degC"); by default ambient air and the hottest air of the field.
    levels
        List of n - 1 for the shells, separated by commas, instead of layers and rule.
    rule
        Steps of the index and where a shell lies in them: "rim" is equal steps and one thin one
        outside; "midpoint" steps are equal, as in Kern et al. (2025); "graded" ones are finer at
        the wall and in the outer tail, for few shells across a plume; "outer" is of first order,
        for studies.
    min_size
        Pieces of a shell smaller than this are dropped.
    triangles
        Reduce the shells to about this many triangles in all; by default all are kept.
    """

    layers: int = 13
    index_range: str | None = None
    levels: Numbers | None = field(default=None, converter=optional(Numbers))
    rule: Rule = "rim"
    min_size: Length = field(default=Length(1.0), converter=Length)
    triangles: int | None = None

    def ends(self, air: Air) -> tuple[float, float] | None:
        """n - 1 of the ends of the range in air; None by default."""
        if self.index_range is None:
            return None
        ends = self.index_range.split(":")
        if len(ends) != 2:
            raise InputError(
                f'the range of the index is "{self.index_range}"; give OUTSIDE:INSIDE, as n - 1 or '
                "as temperatures with unit.",
                code="shells.index_range",
                argument="index_range",
            )
        return _refractivity(ends[0], air), _refractivity(ends[1], air)


def _refractivity(end: str, air: Air) -> float:
    """One end of a range: a bare number is n - 1, anything else a temperature."""
    try:
        value = float(end)
    except ValueError:
        return float(air.refractivity(Temperature(end)))
    if not 0.0 <= value < _MOST_OF_AIR:
        raise InputError(
            f'the range of the index ends at "{end}", which is not n - 1 of air (5.8e-5 at 1100 '
            'degC, 2.718e-4 in the room); a temperature needs its unit, such as "20 degC".',
            code="shells.index_range",
            argument="index_range",
        )
    return value


STANDARD = ShellOptions()
