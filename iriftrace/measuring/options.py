"""Options of measurements and corrections with two devices, for Python and for commands."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal, Self

from attrs import field, frozen
from attrs.converters import optional as if_given

from iriftrace.core.errors import InputError
from iriftrace.core.units import Fraction
from iriftrace.tracing.second_options import System

if TYPE_CHECKING:
    from iriftrace.part.growth import Growth

Phase = Literal["columns", "rows", "both"]
Picture = Literal["cold", "hot"]

COLD: Picture = "cold"
"""The picture in which most programs state the places of shifts."""

GATE = 3.5
"""Number of robust standard deviations beyond which a point is an outlier. With normal noise one of
2,150 points is removed, which changes the standard deviation by 0.3 %."""

LEAST_GATE = 1.0


def check_gate(gate: float | None) -> None:
    """Refuse a gate that removes half of the points or is not a number."""
    if gate is not None and not gate >= LEAST_GATE:
        raise InputError(
            f"The gate is {gate:g} robust standard deviations, which leaves out good points; give "
            f"at least {LEAST_GATE:g}, or none for all points.",
            code="gate.too_small",
            argument="gate",
        )


@frozen
class MeasureOptions:
    """Kind of a sensor with two devices, and the features fitted to what it measures.

    Parameters
    ----------
    system
        Kind of sensor; by default that of the id of the scene's second sensor.
    phase
        Lines of the projector that a fringe system measures by; by default those that run more
        across the direction to the camera.
    feature
        Feature to fit: "cylinder:lateral", or "cylinder" for all regions that are one; repeatable.
        By default all regions that are planes, cylinders, cones or spheres.
    gate
        Points farther from a fitted feature than this many robust standard deviations are left out
        as outliers; none fits all points.
    """

    system: System | None = None
    phase: Phase | None = None
    feature: list[str] | None = None
    gate: float | None = GATE

    def __attrs_post_init__(self) -> None:
        check_gate(self.gate)


USUAL = MeasureOptions()


class Kelvins(float):
    """A difference of temperatures, K; in a text "10 K"."""

    def __new__(cls, value: str | float) -> Self:
        try:
            kelvins = float(value.strip().removesuffix("K") if isinstance(value, str) else value)
        except ValueError:
            kelvins = math.nan
        if not 0.0 <= kelvins < 1000.0:
            raise InputError(
                f'"{value}" is none; give a temperature difference such as 10 K.',
                code="units.no_difference",
            )
        return super().__new__(cls, kelvins)


@frozen
class Uncertainties:
    """Standard uncertainties of what is not measured, which enter those of corrected sizes.

    Parameters
    ----------
    field_uncertainty
        Standard uncertainty of the field, as a fraction of the air's contrast in refractive index,
        "5 %"; that of the corrections is the same fraction of them.
    expansion_uncertainty
        Standard uncertainty of the part's thermal expansion, "2 %", for sizes at 20 degC. The scene
        has the expansion itself.
    temperature_uncertainty
        Standard uncertainty of the part's temperature, "10 K", for sizes at 20 degC.
    """

    field_uncertainty: Fraction = field(default=Fraction(0.0), converter=Fraction)
    expansion_uncertainty: Fraction | None = field(default=None, converter=if_given(Fraction))
    temperature_uncertainty: Kelvins | None = field(default=None, converter=if_given(Kelvins))

    def __attrs_post_init__(self) -> None:
        if not 0.0 <= self.field_uncertainty < 1.0:
            raise InputError(
                f"The field's uncertainty is {self.field_uncertainty:g}, but it is a fraction of "
                "the air's contrast; give one from 0 to 1, such as 0.05 (5 %).",
                code="field.uncertainty_range",
                argument="field_uncertainty",
            )

    def of_growth(self, growth: Growth, hot: float, drawn: float, angle: bool) -> float | None:
        """Standard uncertainty of a value on the drawing, in its unit; None if not known.

        To first order: the expansion scales the difference between the `hot` value and the `drawn`
        one, and a temperature changes all lengths by the same fraction, but no angle. Both are
        independent.
        """
        if self.expansion_uncertainty is None or self.temperature_uncertainty is None:
            return None
        relative = growth.expansion * self.temperature_uncertainty
        by_temperature = 0.0 if angle else relative * drawn
        return (
            math.hypot((hot - drawn) * self.expansion_uncertainty, by_temperature) / growth.factor
        )


NONE_STATED = Uncertainties()
