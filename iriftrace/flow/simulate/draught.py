"""Draught: uniform wind that enters the air around a part through its upstream sides."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError

SLOWEST_RISE = 0.5
"""Rise speed of plumes in a draught over `rise_speed`, rounded: slower the stronger the wind."""
FASTEST = 2.0
"""m/s; faster air is turbulent behind a part of some centimetres, so the flow is not laminar."""
SIDES = {"xmin": (0, -1.0), "xmax": (0, 1.0), "ymin": (1, -1.0), "ymax": (1, 1.0)}
"""Vertical sides of the box of air: axis and sign of the outward normal."""
# A component of the direction below it is the rounding error of a cosine.
_ROUNDING = 1e-9


@frozen
class Draught:
    """Wind of one speed and direction, without which the air comes to rest far from the part."""

    speed: float  # m/s, positive
    source: tuple[float, float, float]  # unit vector, world, to where the air comes from

    @property
    def velocity(self) -> tuple[float, float, float]:
        """Velocity, m/s, world."""
        x, y, z = (-self.speed * component + 0.0 for component in self.source)
        return x, y, z

    @property
    def inlets(self) -> tuple[str, ...]:
        """Sides of `SIDES` through which it enters; at bottom and top air moves freely."""
        return tuple(
            name for name, (axis, sign) in SIDES.items() if sign * self.source[axis] > _ROUNDING
        )

    def mirrored(self, axes: str) -> Draught:
        """Its mirror image about the planes across `axes`, of "xy"."""
        x, y, z = (
            -value if name in axes else value
            for name, value in zip("xyz", self.source, strict=True)
        )
        return Draught(self.speed, (x + 0.0, y + 0.0, z))

    def crossed(self, axes: str) -> str:
        """The planes across `axes` through which it blows, about which it is not symmetric."""
        return "".join(name for name in axes if abs(self.source["xy".index(name)]) > _ROUNDING)

    def crossing(self, lengths: FloatArray) -> float:
        """Time, s, to cross air of a width and depth, (2,) array, mm."""
        return float(np.abs(self.source[:2]) @ lengths) * 1e-3 / self.speed

    @property
    def text(self) -> str:
        """Description for messages and for the field's origin."""
        x, y, z = self.source
        if z:
            return f"draught of {self.speed:g} m/s from ({x:.3g}, {y:.3g}, {z:.3g})"
        return f"draught of {self.speed:g} m/s from {np.degrees(np.arctan2(y, x)) % 360.0:g} deg"


@frozen
class Lean:
    """Largest lean of a plume by draughts of one direction."""

    downwind: tuple[float, float]  # unit vector, world
    most: float  # as a fraction of its height


def rise_speed(height_mm: float, hottest_k: float, ambient_k: float) -> float:
    """Speed, m/s, of air that has risen along a hot wall: sqrt(g h (T - T0) / T)."""
    buoyancy = max(1.0 - ambient_k / hottest_k, 0.0)
    return float(np.sqrt(9.81 * 1e-3 * height_mm * buoyancy))


def leans(draughts: Iterable[Draught], rise: float) -> tuple[Lean, ...]:
    """Leans of plumes that rise at `SLOWEST_RISE` times `rise`, m/s; each direction once."""
    found: dict[tuple[float, float], float] = {}
    for draught in draughts:
        across = np.array(draught.velocity[:2])
        speed = float(np.linalg.norm(across))
        x, y = (round(float(component) / speed, 6) for component in across)
        found[x, y] = max(speed, found.get((x, y), 0.0))
    return tuple(Lean(downwind, speed / (SLOWEST_RISE * rise)) for downwind, speed in found.items())


def draught_from(speed: float, source: Sequence[float]) -> Draught | None:
    """Draught of a speed, m/s, from a direction; None for still air, a speed of 0.

    `source` is where the air comes from: one angle in the horizontal plane, degrees from +x to +y,
    or the components x, y, z of a vector of any length. Raises InputError if the speed is negative
    or too fast, the direction is not valid, or closer to gravity than to the horizontal.
    """
    check_speed(speed)
    if len(source) == 1:
        angle = np.radians(source[0] % 360.0)
        vector = np.array((np.cos(angle), np.sin(angle), 0.0))
    elif len(source) == 3:
        vector = np.array(source, dtype=np.float64)
    else:
        raise InputError(
            f"{len(source)} numbers are not a direction; give one angle in degrees (0 is "
            "+x), or x,y,z.",
            code="draught.numbers",
            argument="draught_from",
        )
    length = float(np.linalg.norm(vector))
    if not 0.0 < length < np.inf:
        raise InputError(
            "the draught's direction is zero; give one that is not 0,0,0.",
            code="draught.no_direction",
            argument="draught_from",
        )
    vector[np.abs(vector) < _ROUNDING * length] = 0.0
    vector /= np.linalg.norm(vector)
    if abs(vector[2]) > np.hypot(vector[0], vector[1]):
        raise InputError(
            "a draught along gravity cannot be simulated here, because air leaves and enters "
            "freely above and below the part; give a direction at most 45 degrees off the "
            "horizontal plane.",
            code="draught.vertical",
            argument="draught_from",
        )
    x, y, z = (float(value) for value in vector)
    return Draught(speed, (x, y, z)) if speed > 0.0 else None


def check_speed(speed: float) -> None:
    """Refuse a speed, m/s, that is not possible for a laminar draught, with an InputError."""
    if not 0.0 <= speed <= FASTEST:
        raise InputError(
            f"a draught of {speed:g} m/s cannot be simulated here; give a speed from 0 to "
            f"{FASTEST:g} m/s.",
            code="draught.speed",
        )
