"""Cells of a field in which all air is ambient, so that rays are straight: most of a large flow."""

from __future__ import annotations

import numpy as np

from iriftrace.core.arrays import BoolArray, FloatArray
from iriftrace.medium.gradient import LinearCells

AMBIENT_SHARE = 1e-4
"""Fraction of the largest contrast with the ambient air below which air counts as ambient.

That is 0.02 K around a part of 1100 degC, less than the uncertainty of any ambient temperature.
"""


def ambient_step(refractivity: FloatArray, ambient: float) -> float:
    """Difference of n - 1 from that of the ambient air below which air counts as ambient."""
    return AMBIENT_SHARE * float(np.abs(refractivity - ambient).max())


def not_ambient(refractivity: FloatArray, ambient: float) -> BoolArray:
    """Mask (n,) of the points where the air is not ambient."""
    step = ambient_step(refractivity, ambient)
    mask: BoolArray = np.abs(refractivity - ambient) >= step
    return mask


def cells_at(grid: LinearCells, points: BoolArray) -> BoolArray:
    """Mask (c,) of the cells with a corner among the masked (n,) points."""
    starts = np.asarray(grid.cell_offsets)[:-1]
    mask: BoolArray = np.logical_or.reduceat(points[np.asarray(grid.cell_connectivity)], starts)
    return mask


def points_of(grid: LinearCells, cells: BoolArray) -> BoolArray:
    """Mask (n,) of the points that are corners of the masked (c,) cells."""
    mask = np.zeros(len(np.asarray(grid.points)), dtype=bool)
    mask[np.asarray(grid.cell_connectivity)[corners_of(grid, cells)]] = True
    return mask


def corners_of(grid: LinearCells, cells: BoolArray) -> BoolArray:
    """Mask of the entries of `cell_connectivity` that belong to the masked (c,) cells."""
    return np.repeat(cells, np.diff(np.asarray(grid.cell_offsets)))
