"""Air in tetrahedra: the index between their corners, and the way from one to the next.

Within a tetrahedron n is linear, with a constant gradient, which is exact for the field as it is
given. For the smooth field behind it, the gradient is recovered at the corners and interpolated,
which is of higher order, and n along the ray still changes as the corners say.
"""

from __future__ import annotations

from functools import cached_property
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from iriftrace.field.gradient import consistent_gradient, point_gradient
from iriftrace.field.path_data import FieldCells
from iriftrace.field.tetrahedra import BOUNDARY, tetrahedra_of
from iriftrace.plugins.kernels.layers import length_gain
from iriftrace.plugins.kernels.prepared import scene_beside
from iriftrace.plugins.kernels.tables import aligned

NO_FACE = 4
"""In the place of a face's number: the tetrahedron was not entered through one of its faces."""

LOST_MM = 0.01
"""A ray that is farther outside the tetrahedron it should be in has lost its way."""

OPEN_SHARE = 1 / 24
"""Share of the range of n that an open boundary may differ by: half of a usual step of 13
shells, so that both engines count the same rays."""

WAYS = np.array([way for way in product((-1, 0, 1), repeat=3) if any(way)]) + np.full(3, 0.02)
"""Directions all around, none of them along a plane of two axes."""


class Entrance(NamedTuple):
    """The next face of the data's boundary along a ray."""

    found: Any  # Bool
    distance: Any  # Float64, mm, as single precision has it
    place: Any  # UInt32: the tetrahedron behind the face, and the face
    wall: Any  # Bool: the face belongs to the inner boundary, where the part is


class Passage(NamedTuple):
    """The way through one tetrahedron."""

    distance: Any  # Float64, mm; negative in a tetrahedron that is turned inside out
    place: Any  # UInt32: where the ray comes to; meaningless where the data end
    ends: Any  # Bool: the data end there
    wall: Any  # Bool: and it is the inner boundary
    lost: Any  # Bool: the ray was not in the tetrahedron


class Cell:
    """One tetrahedron per ray."""

    def __init__(self, air: TetrahedralAir, place: Any, active: Any) -> None:
        import drjit as dr
        import mitsuba as mi

        self._air, self._active = air, active
        self.number, self.entry = place >> 3, place & 7
        corners = dr.gather(mi.Vector4u, air.corners, self.number, active)
        points = [mi.Point3d(dr.gather(mi.Point3f, air.points, c, active)) for c in corners]
        self._origin = points[0]
        e1, e2, e3 = (mi.Vector3d(p - points[0]) for p in points[1:])
        self._areas = (dr.cross(e2, e3), dr.cross(e3, e1), dr.cross(e1, e2))
        self._volume = dr.dot(e1, self._areas[0])
        # A flat tetrahedron is passed in no time, so any gradient does.
        self._solid = dr.abs(self._volume) > 1e-12
        self._inverse = dr.select(self._solid, dr.rcp(self._volume), 0)
        self._index = [dr.gather(mi.Float64, air.refractivity, c, active) for c in corners]
        self.constant = sum(
            (
                area * ((value - self._index[0]) * self._inverse)
                for area, value in zip(self._areas, self._index[1:], strict=True)
            ),
            mi.Vector3d(0),
        )
        self._recovered = [
            mi.Vector3d(dr.gather(mi.Vector3f, air.gradient, c, active)) for c in corners
        ]

    def refractivity(self, point: Any) -> Any:
        """Linear n - 1 (Float64)."""
        import drjit as dr

        return self._index[0] + dr.dot(self.constant, point - self._origin)

    def gradient(self, point: Any, heading: Any) -> Any:
        """Gradient of n that bends a ray of a unit direction (Vector3d, 1/mm)."""
        return self._smooth_gradient(point, heading) if self._air.recovered else self.constant

    def gradient_error(self, point: Any, heading: Any) -> Any:
        """Gradient with the recovered direction less the constant one (Vector3d, 1/mm).

        The usual estimate of the constant one's error (Zienkiewicz and Zhu 1987, "A simple error
        estimator and adaptive procedure"); the recovered one's is smaller.
        """
        import drjit as dr

        return dr.select(self._solid, self._smooth_gradient(point, heading) - self.constant, 0)

    def _smooth_gradient(self, point: Any, heading: Any) -> Any:
        """Along the recovered direction N, as strong as n changes along the ray.

        With g the cell's own gradient and d the ray's direction that is (g.d) / (N.d) N, so that
        the changes of n along the ray add up without error, whatever the cells' noise. As N.d falls
        below ``DIRECTION_ERROR``, the recovered gradient's own length takes its place; see
        `iriftrace.plugins.kernels.layers.length_gain`.
        """
        import drjit as dr

        recovered = self._interpolated(point)
        length = dr.norm(recovered)
        direction = dr.select(length > 0, recovered / length, 0)
        cosine = dr.dot(heading, direction)
        share = length_gain(cosine)
        # Where n is even, the neighbours' gradients do not matter.
        strength = dr.select(dr.norm(self.constant) > 0, length, 0)
        strength += share * (dr.dot(self.constant, heading) - cosine * strength)
        return dr.select(self._solid, strength * direction, 0)

    def _interpolated(self, point: Any) -> Any:
        import drjit as dr

        first = self._recovered[0]
        offset = point - self._origin
        result = first
        for area, value in zip(self._areas, self._recovered[1:], strict=True):
            result = result + (value - first) * (dr.dot(area, offset) * self._inverse)
        return dr.select(self._solid, result, 0)

    def _heights(self, point: Any, direction: Any) -> tuple[list[Any], list[Any], list[Any]]:
        """For each face: area, volume under the point, and how that grows along the direction."""
        import drjit as dr

        inner = [dr.dot(area, point - self._origin) for area in self._areas]
        growth = [dr.dot(area, direction) for area in self._areas]
        areas = [self._areas[0] + self._areas[1] + self._areas[2], *self._areas]
        sign = dr.select(self._volume < 0, -1.0, 1.0)
        below = [self._volume - (inner[0] + inner[1] + inner[2]), *inner]
        rising = [-(growth[0] + growth[1] + growth[2]), *growth]
        return (
            [dr.norm(area) for area in areas],
            [sign * value for value in below],
            [sign * value for value in rising],
        )

    def entry_distance(self, point: Any, direction: Any, rough: Any, tolerance: Any) -> Any:
        """Distance to the entry face's plane (Float64, mm), and whether the ray enters there."""
        import drjit as dr

        areas, below, rising = self._heights(point, direction)
        area, height, slope = (_chosen(values, self.entry) for values in (areas, below, rising))
        exact = dr.select(slope != 0, -height / slope, rough)
        reach = tolerance * dr.minimum(area / dr.abs(slope), 100)
        # A cell turned inside out lies on the wrong side of its face, but behind it all the same.
        enters = dr.select(self._volume < 0, slope < 0, slope > 0)
        return dr.clip(exact, rough - reach, rough + reach), enters

    def passage(self, point: Any, direction: Any) -> Passage:
        """Straight way to the face through which a ray leaves the tetrahedron.

        A tetrahedron that is turned inside out lies on the near side of the face by which it is
        entered. It is passed backwards, and the one behind it then covers the way again: what bends
        the ray adds up to what a mesh without the fold would do.
        """
        import drjit as dr
        import mitsuba as mi

        areas, below, rising = self._heights(point, direction)
        backward = (self.entry < NO_FACE) & (self._volume < 0)
        best = mi.Float64(dr.inf)
        leaving = mi.UInt32(NO_FACE)
        outside = mi.Float64(0)
        for face, (area, height, slope) in enumerate(zip(areas, below, rising, strict=True)):
            falling = dr.select(backward, slope, -slope)
            distance = dr.maximum(height, 0) / falling
            nearer = (falling > 0) & (self.entry != face) & (distance < best)
            best = dr.select(nearer, distance, best)
            leaving = dr.select(nearer, mi.UInt32(face), leaving)
            outside = dr.maximum(outside, dr.select(area > 0, -height / area, 0))
        left = leaving < NO_FACE
        lost = ~left | (outside > LOST_MM)
        next_ = dr.gather(
            mi.UInt32, self._air.neighbours, self.number * 4 + leaving, self._active & left
        )
        ends = (next_ & BOUNDARY) != 0
        wall = dr.gather(
            mi.UInt32, self._air.wall, next_ & ~mi.UInt32(BOUNDARY), self._active & left & ends
        )
        return Passage(
            distance=dr.select(left, dr.select(backward, -best, best), 0),
            place=(next_ >> 2) * 8 + (next_ & 3),
            ends=ends,
            wall=wall != 0,
            lost=lost,
        )


def _chosen(values: list[Any], number: Any) -> Any:
    """Entry of a list by a number per ray; the first where there is none."""
    import drjit as dr

    result = values[0]
    for k, value in enumerate(values[1:], start=1):
        result = dr.select(number == k, value, result)
    return result


class TetrahedralAir:
    """A field's tetrahedra in tables for a kernel, and its boundary for ray queries.

    Parameters
    ----------
    cells : FieldCells
    recovered : bool
        Interpolate the gradients recovered at the points; else each tetrahedron has its own.
    """

    def __init__(self, cells: FieldCells, recovered: bool) -> None:
        import mitsuba as mi

        tetrahedra = tetrahedra_of(cells)
        self.cells = cells
        self.ambient = cells.ambient
        self.open_step = OPEN_SHARE * abs(cells.ambient - float(cells.refractivity.min()))
        self.corners = mi.UInt32(aligned(tetrahedra.corners.ravel()))
        self.neighbours = mi.UInt32(aligned(tetrahedra.neighbours.ravel()))
        self.points = mi.Float(aligned(cells.points.ravel()))
        self.refractivity = mi.Float64(aligned(cells.refractivity))
        gradient = consistent_gradient(
            cells.points,
            tetrahedra.corners,
            cells.refractivity,
            point_gradient(cells, cells.refractivity),
        )
        self.gradient = mi.Float(aligned(gradient.astype(np.float32).ravel()))
        self.recovered = recovered
        wall = cells.wall[tetrahedra.boundary].all(axis=1)
        self.wall = mi.UInt32(aligned(wall.astype(np.uint32)))
        self.boundary_place = mi.UInt32(aligned(tetrahedra.boundary_place))
        self._boundary_mesh = _mesh(cells.points, tetrahedra.boundary)
        self._boundary: tuple[Any, Any] | None = None

    def boundary_beside(self, scene: Any) -> Any:
        """The data's boundary, as a scene that kernels may query together with another one."""
        if self._boundary is None or self._boundary[0] is not scene:
            self._boundary = scene, scene_beside(scene, [self._boundary_mesh])
        return self._boundary[1]

    def is_hot(self, point: NDArray[np.float64], scene: Any) -> bool:
        """True if a point (3,), mm, world, lies in the data where the air is not ambient."""
        import drjit as dr
        import mitsuba as mi

        nearest = self._tree.query(point)[1]
        if abs(self.cells.refractivity[nearest] - self.ambient) <= self.open_step:
            return False
        # Seen from inside, the first face of the boundary shows its back in every direction.
        places = mi.Point3f(*(aligned(np.full(len(WAYS), x, dtype=np.float32)) for x in point))
        ways = mi.Vector3f(*(aligned(axis.astype(np.float32)) for axis in WAYS.T))
        boundary = self.boundary_beside(scene)
        hit = boundary.ray_intersect(mi.Ray3f(places, dr.normalize(ways)))
        leaving = hit.is_valid() & (dr.dot(hit.n, ways) > 0)
        return bool(np.mean(np.array(leaving)) > 0.5)

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self.cells.points)

    def cell(self, place: Any, active: Any) -> Cell:
        """The tetrahedra at places."""
        return Cell(self, place, active)

    @staticmethod
    def unentered(place: Any) -> Any:
        """The same tetrahedra, not entered through one of their faces."""
        return (place >> 3) * 8 + NO_FACE

    def entrance(self, preliminary: Any, active: Any) -> Entrance:
        """The next boundary face, from a ray query of `boundary_beside`."""
        import drjit as dr
        import mitsuba as mi

        found = active & preliminary.is_valid()
        face = preliminary.prim_index
        place = dr.gather(mi.UInt32, self.boundary_place, face, found)
        return Entrance(
            found=found,
            distance=mi.Float64(preliminary.t),
            place=(place >> 2) * 8 + (place & 3),
            wall=dr.gather(mi.UInt32, self.wall, face, found) != 0,
        )


def _mesh(points: Any, faces: Any) -> Any:
    """Triangles as Mitsuba's mesh."""
    import mitsuba as mi

    used, corners = np.unique(faces, return_inverse=True)
    mesh = mi.Mesh("boundary", vertex_count=len(used), face_count=len(faces))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = mi.Float(aligned(points[used].ravel()))
    parameters["faces"] = mi.UInt32(aligned(corners.astype(np.uint32).ravel()))
    parameters.update()
    return mesh
