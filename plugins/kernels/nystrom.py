"""One step of a ray by Nystrom's method of order 4, for r'' = n grad n."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from iriftrace.plugins.kernels.types import Float64, Point3d, Vector3d


class Step(NamedTuple):
    """End of a step."""

    point: Point3d  # mm
    velocity: Vector3d  # index times direction
    velocity_error: Vector3d  # difference of the velocity to a rule of order 2
    middle: Point3d  # mm


def nystrom_step(
    point: Point3d, velocity: Vector3d, acceleration: Callable[[Point3d], Vector3d], time: Float64
) -> Step:
    """Advance a ray by one step of Nystrom's method of order 4 (Hairer, Norsett and Wanner, II.14).

    From a point (Point3d, mm) and a velocity (Vector3d, index times unit direction), with the
    acceleration n grad n (Vector3d, 1/mm) at points. The time is the length of the step over the
    index, mm; it may be negative.
    """
    first = acceleration(point) * time
    halfway = point + velocity * (time / 2) + first * (time / 8)
    middle = acceleration(halfway) * time
    last = acceleration(point + velocity * time + middle * (time / 2)) * time
    return Step(
        point + (velocity + (first + 2 * middle) / 6) * time,
        velocity + (first + 4 * middle + last) / 6,
        (first - 2 * middle + last) / 6,
        halfway,
    )
