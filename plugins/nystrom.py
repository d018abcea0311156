"""One step of order 4 along a ray in a medium whose index varies.

With x the position and v = n times the direction, the ray equation d/ds (n dr/ds) = grad n becomes
dx/dt = v, dv/dt = n grad n, where dt = ds / n; the acceleration does not depend on the velocity, so
a Nystroem scheme needs three gradients a step (Sharma, Kumar and Ghatak 1982, "Tracing rays through
graded-index media: a new method", Applied Optics 21, 984).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple


class Step(NamedTuple):
    """End of a step."""

    point: Any  # Point3d, mm
    velocity: Any  # Vector3d: index times direction
    doubt: Any  # Float64: difference of the velocity to a rule of order 2


def nystrom_step(point: Any, velocity: Any, acceleration: Callable[[Any], Any], time: Any) -> Step:
    """Advance a ray.

    Parameters
    ----------
    point, velocity : Point3d, Vector3d
        mm; index times unit direction.
    acceleration : callable
        n grad n (Vector3d, 1/mm) at points.
    time : Float64, mm
        Length of the step over the index; may be negative.
    """
    import drjit as dr

    first = acceleration(point) * time
    middle = acceleration(point + velocity * (time / 2) + first * (time / 8)) * time
    last = acceleration(point + velocity * time + middle * (time / 2)) * time
    return Step(
        point + (velocity + (first + 2 * middle) / 6) * time,
        velocity + (first + 4 * middle + last) / 6,
        dr.norm(first - 2 * middle + last) / 6,
    )
