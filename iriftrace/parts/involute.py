"""The outline of a gear's teeth: involute flanks between a root and a tip circle."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from attrs import frozen
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

FLANK_POINTS, TIP_STEPS, ROOT_STEPS = 10, 4, 4
PER_TOOTH = 2 * FLANK_POINTS + TIP_STEPS + ROOT_STEPS - 2
"""Points of the outline of one tooth with the gap after it."""

_WIDER_ROOT = 0.10
"""Share of half a tooth's pitch by which a flank is wider at the root, in place of a fillet."""


@frozen(slots=False)
class Involute:
    """Outline of a gear's teeth in the plane across its axis.

    The flanks are involutes of the base circle (radius of the pitch circle times the cosine of the
    pressure angle) from the pitch circle to the tip. Below the pitch circle they widen towards the
    root, and below the base circle they are radial besides.

    Attributes
    ----------
    teeth : int
    pitch_radius, root_radius, tip_radius : float, mm
    pressure_angle : float, rad
    """

    teeth: int
    pitch_radius: float
    root_radius: float
    tip_radius: float
    pressure_angle: float

    @property
    def base_radius(self) -> float:
        """Radius of the circle of which the flanks are involutes, mm."""
        return self.pitch_radius * float(np.cos(self.pressure_angle))

    def half_angle(self, radius: ArrayLike) -> FloatArray:
        """Half the angle, rad, that a tooth takes at given radii, mm."""
        r = np.asarray(radius, dtype=np.float64)
        half_pitch = np.pi / (2 * self.teeth)
        rolled = np.arccos(np.clip(self.base_radius / r, 0.0, 1.0))
        half = half_pitch + _involute(self.pressure_angle) - _involute(rolled)
        depth = (self.pitch_radius - r) / (self.pitch_radius - self.root_radius)
        wider = _WIDER_ROOT * half_pitch * np.clip(depth, 0.0, 1.0) ** 2
        return np.asarray(half + wider)

    @cached_property
    def points(self) -> FloatArray:
        """(teeth * PER_TOOTH, 2) array: radius, mm, and angle, rad, counter-clockwise.

        Tooth k is symmetric about the angle 2 pi k / teeth and holds the points from k PER_TOOTH
        on: flank upwards, tip, flank downwards, root of the gap after it.
        """
        radii = np.linspace(self.root_radius, self.tip_radius, FLANK_POINTS)
        half = self.half_angle(radii)
        pitch = 2.0 * np.pi / self.teeth
        tip = np.linspace(-half[-1], half[-1], TIP_STEPS + 1)[1:-1]
        root = half[0] + np.linspace(0.0, 1.0, ROOT_STEPS + 1)[1:-1] * (pitch - 2.0 * half[0])
        radius = np.concatenate(
            (
                radii,
                np.full(len(tip), self.tip_radius),
                radii[::-1],
                np.full(len(root), self.root_radius),
            )
        )
        angle = np.concatenate((-half, tip, half[::-1], root))
        turns = pitch * np.repeat(np.arange(self.teeth), len(radius))
        return np.column_stack((np.tile(radius, self.teeth), np.tile(angle, self.teeth) + turns))


def _involute(angle: ArrayLike) -> FloatArray:
    """The involute function, tan a - a."""
    return np.asarray(np.tan(angle) - angle)
