"""Options about how a field becomes shells."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from attrs import frozen
from cyclopts import Group, Parameter

from iriftrace.cli.options import Whole, numbers, quantity
from iriftrace.errors import InputError

if TYPE_CHECKING:
    from iriftrace.air import Air
    from iriftrace.field import IndexField
    from iriftrace.shell_stack import ShellStack

SHELLS = Group("Shells", sort_key=3)

LARGEST_REFRACTIVITY = 0.01
"""n - 1 of air is far below, a temperature in degC or n itself above."""


@Parameter(name="*", group=SHELLS)
@frozen
class ShellOptions:
    """How the field becomes shells.

    Parameters
    ----------
    layers
        Number of shells.
    index_range
        End points OUTSIDE:INSIDE of the index steps, as n - 1 (2.718e-4:5.8e-5) or as temperatures
        ("20 degC:1100 degC"); by default ambient air and the hottest air of the field.
    levels
        Own list of n - 1 for the shells, separated by commas, instead of layers and rule.
    rule
        Steps of the index and where a shell lies in them: "midpoint" steps are equal; "graded" ones
        are finer at the wall and in the outer tail, for few shells across a plume;
        "outer" is of first order, for studies.
    min_size
        Pieces of a shell smaller than this are dropped.
    smooth
        Taubin smoothing steps; smoothed shells have facet normals, and bend rays there alone.
    subdivide
        Times every triangle is split into four.
    drop_inner
        Leave out this many of the innermost shells, as Kern et al. (2025) do; for studies.
    triangles
        Thin out the shells to about this many triangles in all; by default all are kept.
    """

    layers: Whole = 13
    index_range: str | None = None
    levels: str | None = None
    rule: Annotated[
        Literal["midpoint", "graded", "outer"], Parameter(name=["--rule", "--index-rule"])
    ] = "midpoint"
    min_size: str = "1 mm"
    smooth: Whole = 0
    subdivide: Whole = 0
    triangles: Whole | None = None
    drop_inner: Whole = 0

    def build(self, field: IndexField) -> ShellStack:
        """Contour the field."""
        from iriftrace.shells import contour_shells

        levels = None
        if self.levels is not None:
            count = self.levels.count(",") + 1
            levels = numbers(self.levels, count, "--levels")
        stack = contour_shells(
            field,
            self.layers,
            index_range=self._range(field.air),
            levels=levels,
            rule=self.rule,
            min_size_mm=self.min_size_mm(),
        )
        return self.edited(stack, self.layers if levels is None else len(levels))

    def notes(self) -> dict[str, str]:
        """What is to be known of the shells, beside what the field's options say."""
        if not self.drop_inner:
            return {}
        return {"shells": f"the {self.drop_inner} innermost left out"}

    def min_size_mm(self) -> float:
        """Size below which pieces are dropped, mm."""
        return quantity(self.min_size, "mm", "--min-size")

    def edited(self, stack: ShellStack, levels: int | None = None) -> ShellStack:
        """Drop inner shells, smooth, subdivide and thin out as asked."""
        from iriftrace.shell_edit import smooth_taubin, subdivide_midpoint, without_inner

        if self.drop_inner:
            stack = without_inner(stack, self.drop_inner, levels)
        if self.smooth:
            stack = smooth_taubin(stack, self.smooth)
        if self.subdivide:
            stack = subdivide_midpoint(stack, self.subdivide)
        if self.triangles is not None:
            from iriftrace.shell_decimation import decimate

            stack = decimate(stack, self.triangles)
        return stack

    def _range(self, air: Air) -> tuple[float, float] | None:
        if self.index_range is None:
            return None
        ends = self.index_range.split(":")
        if len(ends) != 2:
            raise InputError(
                f'--index-range is "{self.index_range}"; give OUTSIDE:INSIDE, as n - 1 or as '
                "temperatures with unit."
            )
        outside, inside = (_refractivity(end, air) for end in ends)
        return outside, inside


def _refractivity(end: str, air: Air) -> float:
    """One end of --index-range: a bare number is n - 1, anything else a temperature."""
    try:
        value = float(end)
    except ValueError:
        return float(air.refractivity(quantity(end, "kelvin", "--index-range")))
    if not 0.0 <= value < LARGEST_REFRACTIVITY:
        raise InputError(
            f'--index-range has the end "{end}", which is no n - 1 of air (5.8e-5 at 1100 degC, '
            '2.718e-4 in the room); a temperature needs its unit, such as "20 degC".'
        )
    return value
