"""Options of measurements and corrections with two devices, for Python and for commands."""

from __future__ import annotations

from typing import Literal

from attrs import frozen

from iriftrace.core.errors import InputError
from iriftrace.tracing.second_options import System

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


USUAL_DEVICES = MeasureOptions()
