"""Scattered points as a volume: tetrahedra between them, without those inside the part."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import Delaunay, QhullError

from iriftrace.core.arrays import BoolArray, FloatArray, Int32Array, IntArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.mesh.query import Surface
from iriftrace.core.mesh.topology import connected
from iriftrace.medium.gradient import TETRAHEDRON_EDGES

if TYPE_CHECKING:
    import pyvista as pv

    from iriftrace.part.part import Part


# Two values at one point may differ by this fraction of the range of all values: neighbouring
# elements evaluate slightly differently.
_SAME_VALUE = 0.01
# Tetrahedra whose longest edge is this many times the usual one at their corners bridge a notch in
# the outer boundary.
_BRIDGE = 5.0
# Depth below the wall, as a fraction of the longest edge, that chords of curved walls stay within.
_DEEP = 0.1
# Distance from the wall, as a fraction of the longest edge, within which a corner lies on it.
_ON_WALL = 0.01


def merged(points: FloatArray, values: FloatArray, path: Path) -> tuple[FloatArray, FloatArray]:
    """Merge repeated points, with means of their values, which may differ by 1 % of the range."""
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
                f"{path} has several different values at one point, such as ({place[0]:g}, "
                f"{place[1]:g}, {place[2]:g}), so the field is not defined there; export one state "
                "of one domain.",
                code="table.two_values",
            )
    warn(
        f"{path} repeats {len(points) - len(unique)} points with the same values; each is used "
        "once."
    )
    return unique, means


def tetrahedra_between(points: FloatArray, path: Path) -> IntArray:
    """Delaunay tetrahedra of points, (k, 4), without those that bridge notches of their outline."""
    try:
        # Scaled, because Qhull's tolerances are absolute and meant for coordinates near one.
        extent = max(float(np.ptp(points, axis=0).max()), np.finfo(float).tiny)
        mesh = Delaunay((points - points.mean(axis=0)) / extent)
    except (QhullError, ValueError) as error:
        raise InputError(
            f"The {len(points)} points in {path} fill no volume, but rays need the air volume; "
            "export the volume and not a surface, slice or line.",
            code="field.no_volume",
        ) from error
    tetrahedra = mesh.simplices.astype(np.int64)
    bridges = _bridges(points, tetrahedra)
    if bridges.any():
        bridges = _open_to_outside(bridges, mesh.neighbors)
    kept: IntArray = tetrahedra[~bridges]
    # Qhull does not care about the orientation of a simplex, but volumes elsewhere are signed.
    edges = points[kept[:, 1:]] - points[kept[:, :1]]
    turned = np.linalg.det(edges) < 0.0
    kept[turned, :2] = kept[turned, 1::-1]
    return kept


def _bridges(points: FloatArray, tetrahedra: IntArray) -> BoolArray:
    """Mask of the tetrahedra that are much longer than usual at all of their corners."""
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
    mask: BoolArray = longest > _BRIDGE * usual[tetrahedra].max(axis=1)
    return mask


def _open_to_outside(mask: BoolArray, neighbours: Int32Array) -> BoolArray:
    """The masked tetrahedra that can be reached from the hull through masked ones."""
    chosen = np.flatnonzero(mask)
    local = np.full(len(mask), -1)
    local[chosen] = np.arange(len(chosen))
    around = neighbours[chosen]
    there = np.where(around >= 0, local[around], -1)
    row, column = np.nonzero(there >= 0)
    group = connected(np.column_stack((row, there[row, column])), len(chosen))
    outside = np.zeros(group.max() + 1, dtype=bool)
    outside[group[(around < 0).any(axis=1)]] = True
    result = np.zeros(len(mask), dtype=bool)
    result[chosen] = outside[group]
    return result


def cells_outside(grid: pv.UnstructuredGrid, part: Part | None, path: str) -> IntArray:
    """Numbers of the tetrahedra outside the part.

    Delaunay tetrahedra fill the part too, from wall to wall. A tetrahedron is removed if it
    reaches deep below the part's surface, or if none of its corners is in the air and it lies
    below or flat on the surface. Depth is relative to the tetrahedron's size, because chords of
    a curved wall cut into the part slightly.

    The grid consists of tetrahedra, mm, world. Raises InputError if there is no part, it is not
    closed, or nothing is left.
    """
    if part is None:
        raise InputError(
            f"{path} holds scattered points without elements, and the tetrahedra between them fill "
            "the part too; give the part so that it can be cut out, or export elements "
            "(sectionwise format).",
            code="field.no_part",
            argument="part",
        )
    if not part.closed:
        raise InputError(
            f"The part {part.path} is not a closed surface, so it cannot be cut out of the "
            f"scattered points in {path}; close the surface, or export elements (sectionwise).",
            code="part.open",
        )
    surface = part.surface
    points = np.asarray(grid.points, dtype=np.float64)
    corners = np.asarray(grid.cell_connectivity, dtype=np.int64).reshape(-1, 4)
    at = points[corners]
    first, second = TETRAHEDRON_EDGES.T
    size = np.linalg.norm(at[:, first] - at[:, second], axis=2).max(axis=1)
    at_corners = _distance_or_less(surface, points, corners, size)[corners]
    # A tetrahedron in the air that is farther from the surface than it is long cannot reach it.
    near = np.flatnonzero(at_corners.min(axis=1) < size)
    at, at_corners, size = at[near], at_corners[near], size[near]
    centre = at.mean(axis=1)
    depth = _below(surface, centre, at, at_corners, _ON_WALL * size)
    in_air = (at_corners > _ON_WALL * size[:, None]).any(axis=1)
    buried = (depth < -_DEEP * size) | (~in_air & (depth < _ON_WALL * size))
    middles = [at[:, pair].mean(axis=1) for pair in TETRAHEDRON_EDGES]
    for places in (*middles, *(0.5 * (centre + at[:, corner]) for corner in range(4))):
        rest = np.flatnonzero(~buried)
        limit = -_DEEP * size[rest]
        depth = _below(surface, places[rest], at[rest], at_corners[rest], limit)
        buried[rest] = depth < limit
    inside = np.zeros(len(corners), dtype=bool)
    inside[near] = buried
    if inside.all():
        raise InputError(
            f"All points in {path} lie in the part {part.path}; check the length units and the "
            "transforms of field and part.",
            code="field.in_part",
            argument="field_length_unit",
        )
    return np.flatnonzero(~inside)


def _distance(surface: Surface, points: FloatArray) -> FloatArray:
    """Distance from a closed surface, mm, negative inside."""
    return np.where(surface.inside(points), -1.0, 1.0) * surface.distance(points)


def _distance_or_less(
    surface: Surface, points: FloatArray, corners: IntArray, size: FloatArray
) -> FloatArray:
    """Distance from the surface; where no tetrahedron reaches it, that from its bounding box."""
    low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
    distance: FloatArray = np.linalg.norm(
        np.maximum(np.maximum(low - points, points - high), 0.0), axis=1
    )
    reach = np.zeros(len(points))
    np.maximum.at(reach, corners.ravel(), np.repeat(size, 4))
    close = np.flatnonzero(distance < reach)
    distance[close] = _distance(surface, points[close])
    return distance


def _below(
    surface: Surface, places: FloatArray, at: FloatArray, at_corners: FloatArray, limit: FloatArray
) -> FloatArray:
    """Distance of one point in each tetrahedron if it can be below a limit, else infinity.

    Distances change no faster than the point moves, so those of the corners decide most cases.
    """
    least = (at_corners - np.linalg.norm(at - places[:, None], axis=2)).max(axis=1)
    result = np.full(len(places), np.inf)
    near = np.flatnonzero(least < limit)
    result[near] = _distance(surface, places[near])
    return result
