"""Values of cells or faces averaged onto the points around them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from iriftrace.core.arrays import FloatArray, IntArray, as_float64
from iriftrace.medium.gradient import cell_centroids, cell_corners
from iriftrace.medium.polyhedra import added

if TYPE_CHECKING:
    import pyvista as pv

PLACES = "iriftrace_places"
"""Cell data, (m, 3): the location of a cell's value where the cell is a piece of a polyhedron."""

_LEAST = 0.1
"""Smallest correction of a weight."""
_NEAREST = 1e-6
"""Smallest distance of a location, as a fraction of the largest one."""


def point_means(grid: pv.UnstructuredGrid, values: FloatArray) -> FloatArray:
    """Cell values (m,) or (m, k) averaged onto the n points with the weights of `linear_weights`.

    They are located at the cells' centroids, or at `PLACES` where the grid has them.
    """
    if PLACES in grid.cell_data:
        places = as_float64(grid.cell_data[PLACES])
    else:
        places = cell_centroids(grid)
    parts = cell_corners(grid).values()
    cell = np.concatenate([np.repeat(cells, corners.shape[1]) for cells, corners in parts])
    point = np.concatenate([corners.ravel() for _, corners in parts])
    arm = places[cell] - as_float64(grid.points)[point]
    (weight,) = linear_weights([(point, arm)], grid.n_points)
    total = np.bincount(point, weight, minlength=grid.n_points)
    return (added(point, (weight * values[cell].T).T, grid.n_points).T / total).T


def linear_weights(around: Sequence[tuple[IntArray, FloatArray]], count: int) -> list[FloatArray]:
    """Weights (k,) of locations around `count` points, for each group of locations.

    A group has (k,) points and (k, 3) vectors from them to the locations. The weights are inverse
    distances times a linear function of these vectors, chosen so that their weighted mean vanishes:
    the means of values that are linear in space are then exact (Holmes and Connell, AIAA 89-1932).
    Where all locations lie on one side of the point the function is limited to `_LEAST`.
    """
    lengths = [np.linalg.norm(arm, axis=1) for _, arm in around]
    least = _NEAREST * max((length.max(initial=0.0) for length in lengths), default=0.0)
    least = max(least, np.finfo(float).tiny)
    near = [1.0 / np.maximum(length, least) for length in lengths]
    moment, spread = np.zeros((count, 3)), np.zeros((count, 3, 3))
    for (point, arm), weight in zip(around, near, strict=True):
        toward = weight[:, None] * arm
        moment += added(point, toward, count)
        for axis in range(3):
            spread[:, axis] += added(point, toward * arm[:, axis, None], count)
    # Faces around a point of a plane patch do not spread along its normal.
    floor = np.maximum(1e-9 * np.trace(spread, axis1=1, axis2=2), np.finfo(float).tiny)
    slope = np.linalg.solve(spread + floor[:, None, None] * np.eye(3), moment[..., None])[..., 0]
    return [
        weight * np.maximum(1.0 - (slope[point] * arm).sum(axis=1), _LEAST)
        for (point, arm), weight in zip(around, near, strict=True)
    ]
