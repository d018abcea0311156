"""The part cut out of tetrahedra that fill the hull of scattered points."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from iriftrace.errors import InputError
from iriftrace.field_cells import TETRAHEDRON_EDGES as EDGES

if TYPE_CHECKING:
    from iriftrace.part import Part

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Depth below the wall, as share of the longest edge, that a chord of a curved wall does not reach.
_DEEP = 0.1
# Distance from the wall, as share of the longest edge, below which a corner lies on it.
_ON_WALL = 0.01


def cells_outside(grid: Any, part: Part | None, path: str) -> IntArray:
    """Numbers of the tetrahedra that do not lie in the part.

    Delaunay's tetrahedra fill the part too, from wall to wall. A tetrahedron is left out if it
    reaches deep below the part's surface, or if none of its corners is in the air and it lies
    below or flat on the surface. Depth is measured against the tetrahedron's size, since chords of
    a curved wall cut into the part a little.

    Parameters
    ----------
    grid : pyvista.UnstructuredGrid
        Tetrahedra, mm, world.
    part : Part or None
    path : str
        For messages.

    Raises
    ------
    InputError
        There is no part, it is not closed, or nothing is left.
    """
    if part is None:
        raise InputError(
            f"{path} holds scattered points without elements, and the tetrahedra between them fill "
            "the part too; give the part so that it can be cut out (--part), or export elements "
            "(sectionwise format)."
        )
    if not part.closed:
        raise InputError(
            f"The part {part.path} is not a closed surface, so it cannot be cut out of the "
            f"scattered points in {path}; close the surface, or export elements (sectionwise)."
        )
    surface: Any = pv.PolyData(part.vertices, np.insert(part.faces, 0, 3, axis=1).ravel())
    points = np.asarray(grid.points, dtype=np.float64)
    corners = np.asarray(grid.cell_connectivity, dtype=np.int64).reshape(-1, 4)
    at = points[corners]
    size = np.linalg.norm(at[:, EDGES[:, 0]] - at[:, EDGES[:, 1]], axis=2).max(axis=1)
    at_corners = _distance_or_less(surface, points, corners, size)[corners]
    # Farther from the surface than it is long, a tetrahedron in the air cannot reach it.
    near = np.flatnonzero(at_corners.min(axis=1) < size)
    at, at_corners, size = at[near], at_corners[near], size[near]
    centre = _below(surface, at.mean(axis=1), at, at_corners, _ON_WALL * size)
    in_air = (at_corners > _ON_WALL * size[:, None]).any(axis=1)
    buried = (centre < -_DEEP * size) | (~in_air & (centre < _ON_WALL * size))
    for samples in _samples(at):
        open_question = np.flatnonzero(~buried)
        limit = -_DEEP * size[open_question]
        depth = _below(
            surface,
            samples[open_question],
            at[open_question],
            at_corners[open_question],
            limit,
        )
        buried[open_question] = depth < limit
    inside = np.zeros(len(corners), dtype=bool)
    inside[near] = buried
    if inside.all():
        raise InputError(
            f"All points in {path} lie in the part {part.path}; check the length units and the "
            "transforms of field and part."
        )
    return np.flatnonzero(~inside)


def _samples(at: FloatArray) -> list[FloatArray]:
    """Middles of the edges, and places halfway from the centre to the corners."""
    middles = [at[:, pair].mean(axis=1) for pair in EDGES]
    centre = at.mean(axis=1)
    return [*middles, *(0.5 * (centre + at[:, k]) for k in range(4))]


def _distance(surface: Any, points: FloatArray) -> FloatArray:
    """Distance from a closed surface, mm, negative inside."""
    if not len(points):
        return np.zeros(0)
    cloud = pv.PolyData(points).compute_implicit_distance(surface)
    return np.asarray(cloud.point_data["implicit_distance"], dtype=np.float64)


def _distance_or_less(
    surface: Any, points: FloatArray, corners: IntArray, size: FloatArray
) -> FloatArray:
    """Distance from the surface; where no tetrahedron reaches it, that from its bounding box."""
    low, high = np.reshape(surface.bounds, (3, 2)).T
    distance: FloatArray = np.linalg.norm(
        np.maximum(np.maximum(low - points, points - high), 0.0), axis=1
    )
    reach = np.zeros(len(points))
    np.maximum.at(reach, corners.ravel(), np.repeat(size, 4))
    close = np.flatnonzero(distance < reach)
    distance[close] = _distance(surface, points[close])
    return distance


def _below(
    surface: Any, places: FloatArray, at: FloatArray, at_corners: FloatArray, limit: FloatArray
) -> FloatArray:
    """Distance of one place in each tetrahedron where it can be below a limit, else infinity.

    Distances change no faster than the place does, so those of the corners tell most.
    """
    least = (at_corners - np.linalg.norm(at - places[:, None], axis=2)).max(axis=1)
    result = np.full(len(places), np.inf)
    asked = np.flatnonzero(least < limit)
    result[asked] = _distance(surface, places[asked])
    return result
