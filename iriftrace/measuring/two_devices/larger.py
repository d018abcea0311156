"""Relative size of a measured cloud and the part, which show that the part was measured hot."""

from __future__ import annotations

import numpy as np
from attrs import frozen
from scipy.spatial.transform import Rotation

from iriftrace.core.arrays import BoolArray, FloatArray
from iriftrace.core.blocks import blocks
from iriftrace.core.units import ZERO_CELSIUS_K
from iriftrace.part.growth import Growth
from iriftrace.part.part import Part

STEEL = Growth(expansion=14e-6, reference_k=293.15, hot_k=293.15)
"""Expansion of forged steel at any temperature between 20 and 1250 degC, to within 10 %."""

HOTTEST_K = 1800.0
"""Steel melts."""

LEAST = 5e-4
"""Relative difference in size from which on it is reported: steel at 55 degC."""

MOST = 0.05
"""Relative difference beyond which it is another unit or another part: steel melts at 2 %."""

BOX = 0.05
"""Fraction of the part's diagonal: how far outside its box a point of the part may lie."""

SAMPLE = 3000

ROUNDS = 15

GATE = 3.5 * 1.4826
"""Multiple of the median distance beyond which a point does not belong to the part."""

MOST_LEFT = 0.5
"""Largest ratio of the distances after fits with and without a scale that the scale explains."""


@frozen
class Larger:
    """A cloud that is larger or smaller than the part."""

    scale: float  # lengths in the cloud over those of the part
    left_mm: float  # median distance from the part after the best fit with a scale
    rigid_mm: float  # the same without one

    def remark(self, growth: Growth | None) -> tuple[str, str]:
        """A sentence for a part whose expansion is known or not, and the argument that helps."""
        by = self.scale - 1.0
        grown = growth or STEEL
        hot_k = grown.hot_k + by * grown.factor / grown.expansion
        how = "larger" if by > 0 else "smaller"
        text = f"The cloud is {100 * abs(by):.2f} % {how} than the part"
        if growth is not None:
            text += f" at {_celsius(growth.hot_k)}"
        text += (
            f" (a scale leaves {1e3 * self.left_mm:.3g} um of {1e3 * self.rigid_mm:.3g} um, median)"
        )
        if not grown.reference_k < hot_k < HOTTEST_K:
            return f"{text}; check the part and the unit of the cloud.", "length_unit"
        what = "it" if growth is not None else "steel"
        return (
            f"{text}, as {what} is at {_celsius(hot_k)}: unless it was made that large, make the "
            f"scene with an expansion of {1e6 * grown.expansion:g}e-6/K and this hot temperature.",
            "hot_temperature",
        )


def _celsius(kelvin: float) -> str:
    return f"{kelvin - ZERO_CELSIUS_K:.0f} degC"


def in_box(points: FloatArray, part: Part, margin_mm: float) -> BoolArray:
    """Mask (n,) of the points (n, 3), mm, that lie at most so far outside the part's box."""
    low, high = part.bounds + np.array([[-margin_mm], [margin_mm]])
    inside = np.empty(len(points), dtype=bool)
    for rows in blocks(len(points)):
        inside[rows] = ((points[rows] >= low) & (points[rows] <= high)).all(axis=1)
    return inside


def sample_of(points: FloatArray, count: int, among: BoolArray | None = None) -> FloatArray:
    """At most so many random points of the (n, 3), or among those of a mask (n,).

    Sensors may write equal rows periodically.
    """
    whole = len(points) if among is None else int(np.count_nonzero(among))
    rows = np.random.default_rng(0).choice(whole, min(count, whole), False)
    return points[rows if among is None else np.flatnonzero(among)[rows]]


def larger_than(points: FloatArray, part: Part) -> Larger | None:
    """Compare the size of the points (n, 3), mm, with that of the part.

    A similarity (rotation, shift and scale) is fitted, and a rigid motion. None if the scale is
    small or does not explain most of the distance that remains after the rigid motion.
    """
    margin = BOX * float(np.linalg.norm(np.ptp(part.bounds, axis=0)))
    among = in_box(points, part, margin)
    if np.count_nonzero(among) < 100:
        return None
    near = sample_of(points, SAMPLE, among)
    scale, doubt, left = _aligned(near, part, scaling=True)
    _, _, rigid = _aligned(near, part, scaling=False)
    by = scale - 1.0
    if not max(LEAST, 5 * doubt) <= abs(by) <= MOST or left > MOST_LEFT * rigid:
        return None
    return Larger(scale, left, rigid)


def _aligned(points: FloatArray, part: Part, scaling: bool) -> tuple[float, float, float]:
    """Scale of points (n, 3) over the part, its standard uncertainty, and the remaining distance.

    Least squares of the distances from the nearest points of the surface, along their directions,
    over small motions (Chen and Medioni, Image and Vision Computing 10 (1992) 145) and a scale,
    iterated. The distance is a median. Motions that no direction determines are left at 0.
    """
    scale, doubt = 1.0, np.inf
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    for _ in range(ROUNDS):
        distance, direction = part.surface.distance_gradient(points)
        kept = distance <= GATE * max(float(np.median(distance)), 1e-6)
        centre = points[kept].mean(axis=0)
        arm = (points - centre) / size
        motions = np.hstack((direction, np.cross(arm, direction)))
        if scaling:
            motions = np.column_stack((motions, np.einsum("ij,ij->i", arm, direction)))
        found, *_ = np.linalg.lstsq(motions[kept], -distance[kept], rcond=1e-4)
        rotation = Rotation.from_rotvec(found[3:6] / size).as_matrix()
        factor = 1.0 + (found[6] / size if scaling else 0.0)
        points = centre + factor * (points - centre) @ rotation.T + found[:3]
        scale /= factor
        if np.abs(found).max() < 1e-6 * size:
            break
    if scaling:
        left = distance[kept] + motions[kept] @ found
        spread = np.linalg.pinv(motions[kept].T @ motions[kept], rcond=1e-8)[6, 6]
        doubt = float(np.sqrt(np.mean(left**2) * spread)) / size
    return scale, doubt, float(np.median(part.surface.distance(points)))
