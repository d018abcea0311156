"""Scattered points as a volume: the tetrahedra of Delaunay between them."""

from __future__ import annotations

from pathlib import Path
from warnings import warn

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay, QhullError

from iriftrace.errors import InputError, IriftraceWarning
from iriftrace.field_cells import TETRAHEDRON_EDGES

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Two values at one place may differ by this share of all values' range: neighbouring elements
# evaluate a little differently.
_SAME_VALUE = 0.01
# Tetrahedra whose longest edge is so many times what is usual at their corners bridge a notch in
# the outer boundary.
_BRIDGE = 5.0


def merged(points: FloatArray, values: FloatArray, path: Path) -> tuple[FloatArray, FloatArray]:
    """Points that occur several times, once each with the mean of their values.

    Raises
    ------
    InputError
        Values at one place differ by more than 1 % of their range.
    """
    unique, number = np.unique(points, axis=0, return_inverse=True)
    if len(unique) == len(points):
        return points, values
    number = number.ravel()
    count = np.bincount(number)
    means = np.empty((len(unique), values.shape[1]))
    for k, column in enumerate(values.T):
        means[:, k] = np.bincount(number, column) / count
        off = np.abs(column - means[number, k])
        if off.max() > _SAME_VALUE * np.ptp(column):
            place = points[off.argmax()]
            raise InputError(
                f"{path} has several different values at one point, such as "
                f"({place[0]:g}, {place[1]:g}, {place[2]:g}), so the field is not defined there; "
                "export one state of one domain."
            )
    warn(
        f"{path} names {len(points) - len(unique)} points again with the same values; each is used "
        "once.",
        IriftraceWarning,
        stacklevel=5,
    )
    return unique, means


def tetrahedra_between(points: FloatArray, path: Path) -> IntArray:
    """Delaunay's tetrahedra of points, (k, 4), without those that bridge notches of their outline.

    Raises
    ------
    InputError
        The points lie in a plane, or there are fewer than four.
    """
    try:
        # Scaled, since Qhull's tolerances are absolute for coordinates near one.
        extent = max(float(np.ptp(points, axis=0).max()), np.finfo(float).tiny)
        mesh = Delaunay((points - points.mean(axis=0)) / extent)
    except (QhullError, ValueError) as error:
        raise InputError(
            f"The {len(points)} points in {path} fill no volume, and light needs the air between; "
            "export the volume and not a surface, slice or line."
        ) from error
    tetrahedra = mesh.simplices.astype(np.int64)
    bridges = _bridges(points, tetrahedra)
    if bridges.any():
        bridges = _open_to_outside(bridges, mesh.neighbors)
    kept: IntArray = tetrahedra[~bridges]
    # Qhull does not care which way round a simplex is; volumes elsewhere have a sign.
    edges = points[kept[:, 1:]] - points[kept[:, :1]]
    turned = np.linalg.det(edges) < 0.0
    kept[turned, :2] = kept[turned, 1::-1]
    return kept


def _bridges(points: FloatArray, tetrahedra: IntArray) -> NDArray[np.bool_]:
    """Mask of the tetrahedra that are much longer than what is usual at all of their corners."""
    ends = np.sort(tetrahedra[:, TETRAHEDRON_EDGES], axis=2)
    edge, number = np.unique(ends[..., 0] * len(points) + ends[..., 1], return_inverse=True)
    first, second = np.divmod(edge, len(points))
    length = np.linalg.norm(points[first] - points[second], axis=1)
    corner = np.concatenate((first, second))
    each = np.tile(length, 2)
    order = np.lexsort((each, corner))
    count = np.bincount(corner, minlength=len(points))
    start = np.concatenate(([0], np.cumsum(count)[:-1]))
    usual = each[order[np.minimum(start + count // 2, len(order) - 1)]]
    longest = length[number.reshape(-1, len(TETRAHEDRON_EDGES))].max(axis=1)
    mask: NDArray[np.bool_] = longest > _BRIDGE * usual[tetrahedra].max(axis=1)
    return mask


def _open_to_outside(mask: NDArray[np.bool_], neighbours: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Those of the masked tetrahedra that can be reached from the hull through masked ones."""
    chosen = np.flatnonzero(mask)
    local = np.full(len(mask), -1)
    local[chosen] = np.arange(len(chosen))
    around = neighbours[chosen]
    there = np.where(around >= 0, local[around], -1)
    row, column = np.nonzero(there >= 0)
    links = coo_array(
        (np.ones(len(row), dtype=bool), (row, there[row, column])), shape=(len(chosen),) * 2
    )
    group = connected_components(links, directed=False)[1]
    outside = np.zeros(group.max() + 1, dtype=bool)
    outside[group[(around < 0).any(axis=1)]] = True
    result = np.zeros(len(mask), dtype=bool)
    result[chosen] = outside[group]
    return result
