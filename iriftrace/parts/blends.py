"""Signed distances of simple solids, negative inside, and how they are joined smoothly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def smooth_union(one: FloatArray, other: FloatArray, blend: float) -> FloatArray:
    """Union whose seam is rounded over a length, mm (polynomial smooth minimum)."""
    overlap = np.maximum(blend - np.abs(one - other), 0.0)
    return np.asarray(np.minimum(one, other) - overlap**2 / (4.0 * blend))


def smooth_difference(one: FloatArray, other: FloatArray, blend: float) -> FloatArray:
    """The first solid without the second."""
    return -smooth_union(-one, other, blend)


def rounded_cylinder(
    across: FloatArray, along: FloatArray, radius: float, ends: tuple[float, float], edge: float
) -> FloatArray:
    """Cylinder with rounded edges.

    Parameters
    ----------
    across, along
        Distance from the axis and coordinate along it, mm.
    radius, ends
        Of the cylinder, mm.
    edge
        Radius of the edges, mm.
    """
    beside = across - radius + edge
    beyond = np.maximum(along - ends[1], ends[0] - along) + edge
    inside = np.minimum(np.maximum(beside, beyond), 0.0)
    outside = np.sqrt(np.maximum(beside, 0.0) ** 2 + np.maximum(beyond, 0.0) ** 2)
    return np.asarray(inside + outside - edge)
