"""Air in tetrahedra: the index between their corners, and the path from one to the next.

Within a tetrahedron n is linear, with a constant gradient, which is exact for the field as it is
given. For the smooth field behind it, the gradient is recovered at the corners and interpolated,
which is of higher order, and n along the ray still changes as the corners say.
"""

from __future__ import annotations

from copy import copy
from functools import cached_property
from itertools import combinations, product
from typing import NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from attrs import evolve
from scipy.spatial import KDTree

from iriftrace.core.arrays import Float32Array, FloatArray, NumberArray
from iriftrace.core.errors import InputError
from iriftrace.medium.gradient import consistent_gradient, point_gradient
from iriftrace.medium.path_data import FieldCells
from iriftrace.medium.tetrahedra import BOUNDARY, OPPOSITE, tetrahedra_of
from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.kernels.air_table import AirTable
from iriftrace.plugins.kernels.between import length_gain
from iriftrace.plugins.kernels.prepared import scene_beside
from iriftrace.plugins.kernels.vertex_table import aligned, aligned_rows

NO_FACE = 4
"""In the place of a face's number: the tetrahedron was not entered through one of its faces."""

FLAT = 1e-6
"""Volume of a tetrahedron over the cube of its longest edge below which it is flat, and area of a
face across a ray, over that edge's square, below which they are parallel: some roundings of single
precision."""

LOST_MM = 0.01
"""A ray that is farther outside the tetrahedron it should be in is lost."""

OPEN_SHARE = 1 / 24
"""Fraction of the range of n that an open boundary may differ by: half of a usual step of 13
shells, so that both engines count the same rays."""

WAYS = np.array([way for way in product((-1, 0, 1), repeat=3) if any(way)]) + np.full(3, 0.02)
"""Directions all around, none of them along a plane of two axes."""


class Entrance(NamedTuple):
    """The next face of the data's boundary along a ray."""

    found: dt.Bool
    distance: dt.Float64  # mm: as single precision has it
    place: dt.UInt32  # the tetrahedron behind the face, and the face
    wall: dt.Bool  # the face belongs to the inner boundary, where the part is


class CellPassage(NamedTuple):
    """The segment through one tetrahedron."""

    distance: dt.Float64  # mm; negative in a tetrahedron that is turned inside out
    place: dt.UInt32  # where the ray comes to; meaningless where the data end
    ends: dt.Bool  # the data end there
    wall: dt.Bool  # and it is the inner boundary
    lost: dt.Bool  # the ray was not in the tetrahedron


class Cell:
    """One tetrahedron per ray, in single precision about its first corner.

    A point is then known to some 1e-7 of the tetrahedron's size, which is more than the field knows
    of it; a ray's own point and velocity are summed up in double precision elsewhere.
    """

    def __init__(self, air: TetrahedralAir, place: dt.UInt32, active: dt.Bool) -> None:
        self._air, self._active = air, active
        self.number, self.entry = place >> 3, place & 7
        corners = dr.gather(mi.Vector4u, air.tetrahedra, 2 * self.number, active)
        rows: list[dt.Vector4f] = [
            dr.gather(mi.Vector4f, air.points, 2 * c, active) for c in corners
        ]
        first, *others = rows
        self._origin = mi.Point3d(first.xyz)
        self._edges = e1, e2, e3 = [other.xyz - first.xyz for other in others]
        areas = dr.cross(e2, e3), dr.cross(e3, e1), dr.cross(e1, e2)
        self._volume = dr.dot(e1, areas[0])
        squares = [dr.squared_norm(edge) for edge in self._edges]
        self._size = dr.sqrt(dr.maximum(dr.maximum(squares[0], squares[1]), squares[2]))
        # A flat tetrahedron is passed in no time, so any gradient does.
        self._solid = dr.abs(self._volume) > FLAT * self._size * self._size * self._size
        inverse = dr.select(self._solid, dr.rcp(self._volume), 0)
        self._slopes = [area * inverse for area in areas]
        self._index = first.w
        self.constant = sum(
            (
                slope * (other.w - first.w)
                for slope, other in zip(self._slopes, others, strict=True)
            ),
            mi.Vector3f(0),
        )
        recovered: list[dt.Vector4f] = [
            dr.gather(mi.Vector4f, air.points, 2 * c + 1, active) for c in corners
        ]
        self._recovered = [row.xyz for row in recovered]

    def refractivity(self, point: dt.Point3d) -> dt.Float64:
        """Linear n - 1 at points (Float64; Point3d, mm)."""
        return self._air.ambient_air + mi.Float64(self._excess(point))

    def acceleration(self, point: dt.Point3d, heading: dt.Vector3d) -> dt.Vector3d:
        """n grad n, with the gradient that bends a ray of a unit direction (Vector3d, 1/mm)."""
        air = self._air
        gradient = self._smooth_gradient(point, heading) if air.recovered else self.constant
        return mi.Vector3d(gradient * (1 + mi.Float(air.ambient_air) + self._excess(point)))

    def _excess(self, point: dt.Point3d) -> dt.Float:
        """Linear n less that of the ambient air."""
        return self._index + dr.dot(self.constant, self._local(point))

    def gradient_error(self, point: dt.Point3d, heading: dt.Vector3d) -> dt.Vector3f:
        """Gradient with the recovered direction less the constant one (Vector3f, 1/mm).

        The usual estimate of the constant one's error (Zienkiewicz and Zhu 1987, "A simple error
        estimator and adaptive procedure"); the recovered one's is smaller.
        """
        return dr.select(self._solid, self._smooth_gradient(point, heading) - self.constant, 0)

    def _local(self, point: dt.Point3d) -> dt.Vector3f:
        """Vector from the first corner to a point."""
        return mi.Vector3f(point - self._origin)

    def _smooth_gradient(self, point: dt.Point3d, heading: dt.Vector3d) -> dt.Vector3f:
        """Along the recovered direction N, as strong as n changes along the ray.

        With g the cell's own gradient and d the ray's direction that is (g.d) / (N.d) N, so that
        the changes of n along the ray add up without error for any noise of the cells. As N.d falls
        below ``DIRECTION_ERROR``, the recovered gradient's own length is used instead; see
        `iriftrace.plugins.kernels.between.length_gain`.
        """
        ahead = mi.Vector3f(heading)
        first, *others = self._recovered
        offset = self._local(point)
        recovered = first
        for slope, other in zip(self._slopes, others, strict=True):
            recovered = recovered + (other - first) * dr.dot(slope, offset)
        length = dr.norm(recovered)
        direction = recovered * dr.select(length > 0, dr.rcp(length), 0)
        cosine = dr.dot(ahead, direction)
        # Where n is even, the neighbours' gradients do not matter.
        strength = dr.select(dr.squared_norm(self.constant) > 0, length, 0)
        strength += length_gain(cosine) * (dr.dot(self.constant, ahead) - cosine * strength)
        return dr.select(self._solid, direction * strength, 0)

    def _faces_along(
        self, point: dt.Point3d, direction: dt.Vector3d
    ) -> tuple[list[dt.Float], list[dt.Float], list[dt.Float]]:
        r"""For each face: how far inside a line passes, its area across the line, the distance.

        Seen from the line's origin, :math:`w_{ab} = d \cdot (a \times b)` says at which side the
        line passes the edge from a to b. It leaves through the face abc where :math:`w_{ab}`,
        :math:`w_{bc}` and :math:`w_{ca}` are positive, and these are the weights of c, a and b at
        that point (Platis and Theoharis 2003, "Fast ray-tetrahedron intersection using Pluecker
        coordinates", Journal of Graphics Tools 8). Neighbours come to the same result to rounding,
        however flat they are. The first result is the least of the three, mm^2, the second twice
        the area.
        """
        ahead, offset = mi.Vector3f(direction), self._local(point)
        corners = [edge - offset for edge in (mi.Vector3f(0), *self._edges)]
        along = [dr.dot(ahead, corner) for corner in corners]
        nearest = dr.minimum(dr.minimum(along[0], along[1]), dr.minimum(along[2], along[3]))
        farthest = dr.maximum(dr.maximum(along[0], along[1]), dr.maximum(along[2], along[3]))
        # What was not entered through a face has its true orientation, and not that of its face.
        sense = dr.select((self.entry == NO_FACE) & (self._volume < 0), -1.0, 1.0)
        side = {}
        for a, b in combinations(range(4), 2):
            side[a, b] = sense * dr.dot(dr.cross(ahead, corners[a]), corners[b])
            side[b, a] = -side[a, b]
        inside, across, distance = [], [], []
        for a, b, c in OPPOSITE.tolist():
            weights = side[b, c], side[c, a], side[a, b]
            total = weights[0] + weights[1] + weights[2]
            reached = weights[0] * along[a] + weights[1] * along[b] + weights[2] * along[c]
            inside.append(dr.minimum(dr.minimum(weights[0], weights[1]), weights[2]))
            across.append(total)
            distance.append(
                dr.select(total != 0, dr.clip(reached / total, nearest, farthest), nearest)
            )
        return inside, across, distance

    def entry_distance(self, point: dt.Point3d, direction: dt.Vector3d) -> tuple[dt.Float, dt.Bool]:
        """Distance from a point close by to the entry face (mm), and whether rays enter there.

        A cell turned inside out lies on the wrong side of its face, but behind it all the same.
        """
        _, across, distance = self._faces_along(point, direction)
        return _chosen(distance, self.entry), _chosen(across, self.entry) < 0

    def passage(self, point: dt.Point3d, direction: dt.Vector3d) -> CellPassage:
        """Straight segment to the face through which a ray leaves the tetrahedron.

        An inverted tetrahedron lies on the near side of the face by which it is entered. It is
        passed backwards, and the next one then covers the same segment again: the deflections add
        up to those of a mesh without the fold.
        """
        faces = zip(*self._faces_along(point, direction), strict=True)
        margin, exit_distance = mi.Float(-dr.inf), mi.Float(0)
        leaving = mi.UInt32(0)
        # A ray along an edge does not leave through the faces that meet there.
        parallel = FLAT * self._size * self._size
        for face, (inside, across, distance) in enumerate(faces):
            better = (self.entry != face) & (across > parallel) & (inside > margin)
            margin = dr.select(better, inside, margin)
            exit_distance = dr.select(better, distance, exit_distance)
            leaving = dr.select(better, mi.UInt32(face), leaving)
        backward = (self.entry < NO_FACE) & (self._volume < 0)
        lost = (margin < -LOST_MM * self._size) | (~backward & (exit_distance < -LOST_MM))
        next_ = dr.gather(
            mi.UInt32, self._air.tetrahedra, self.number * 8 + 4 + leaving, self._active
        )
        ends = (next_ & BOUNDARY) != 0
        wall = dr.gather(
            mi.UInt32, self._air.wall, next_ & ~mi.UInt32(BOUNDARY), self._active & ends
        )
        return CellPassage(
            distance=mi.Float64(
                dr.select(backward, dr.minimum(exit_distance, 0), dr.maximum(exit_distance, 0))
            ),
            place=(next_ >> 2) * 8 + (next_ & 3),
            ends=ends,
            wall=wall != 0,
            lost=lost,
        )


def _chosen(values: list[dt.Float], number: dt.UInt32) -> dt.Float:
    """Entry of a list by a number per ray; the first where there is none."""
    result = values[0]
    for k, value in enumerate(values[1:], start=1):
        result = dr.select(number == k, value, result)
    return result


class TetrahedralAir:
    """A field's tetrahedra in tables for a kernel, and their boundary for ray queries.

    Where the air is ambient there are none (`FieldCells`). Gradients are the ones recovered at the
    points, interpolated; or each tetrahedron has its own. `changed` and `attached` give the same
    tetrahedra with other air in them.
    """

    def __init__(self, cells: FieldCells, recovered: bool) -> None:
        tetrahedra = tetrahedra_of(cells)
        self._hold(cells)
        self.ambient = cells.ambient
        self.ambient_air = dr.opaque(mi.Float64, cells.ambient)
        # Four corners and the four neighbours behind the faces opposite to them.
        rows = np.concatenate((tetrahedra.corners, tetrahedra.neighbours), axis=1)
        self.tetrahedra = mi.UInt32(aligned(rows.ravel()))
        gradient = consistent_gradient(
            cells.points,
            tetrahedra.corners,
            cells.refractivity,
            point_gradient(cells, cells.refractivity),
        )
        excess = cells.refractivity - cells.ambient
        places = np.column_stack((cells.points, excess, gradient, np.zeros(len(excess))))
        self.points = mi.Float(aligned(places.astype(np.float32).ravel()))
        self.recovered = recovered
        wall = np.asarray(cells.wall[tetrahedra.boundary].all(axis=1))
        self.wall = mi.UInt32(aligned(wall.astype(np.uint32)))
        self.boundary_place = mi.UInt32(aligned(tetrahedra.boundary_place))
        self._boundary_faces = tetrahedra.boundary
        self._boundary_mesh = boundary_mesh(cells.points, tetrahedra.boundary)
        # Shared by all air in these tetrahedra: the latest other scene, and that next to it.
        self._boundary: list[mi.Scene] = []

    @cached_property
    def table(self) -> AirTable:
        """The table of points as a function of their temperatures."""
        corners = np.array(self.tetrahedra).reshape(-1, 8)[:, :4]
        return AirTable(self.cells, corners)

    def changed(self, temperature: dt.Float64, contrast: dt.Float64) -> TetrahedralAir:
        """The same cells with other temperatures at their points (Float64, K).

        `contrast` is a factor on n - n_ambient (Float64). InputError if a temperature is not
        positive, or of another number of points.
        """
        kelvin, factor = np.array(dr.detach(temperature)), float(dr.detach(contrast)[0])
        if len(kelvin) != len(self.cells.points):
            raise InputError(
                f"field.temperature has {len(kelvin):,} values, but the field has "
                f"{len(self.cells.points):,} points; give one for each.",
                code="field.temperature_count",
            )
        excess = factor * (self.cells.air.refractivity(kelvin) - self.ambient)
        cells = evolve(self.cells, refractivity=self.ambient + excess)
        other = self.attached(dr.detach(temperature), dr.detach(contrast))
        other._hold(cells)
        dr.eval(other.points)
        return other

    def _hold(self, cells: FieldCells) -> None:
        """State the air as it is in cells."""
        self.cells = cells
        self.open_step = OPEN_SHARE * abs(cells.ambient - float(cells.refractivity.min()))

    def attached(self, temperature: dt.Float64, contrast: dt.Float64) -> TetrahedralAir:
        """The same air as a function of its temperatures, which it has already."""
        _ = self.table
        other = copy(self)
        other.points = self.table.rows(temperature, contrast)
        return other

    def boundary_beside(self, scene: mi.Scene) -> mi.Scene:
        """The data's boundary, as a scene that kernels may query together with another one."""
        if not self._boundary or self._boundary[0] is not scene:
            self._boundary[:] = scene, scene_beside(scene, [self._boundary_mesh])
        return self._boundary[1]

    def forget_scene(self) -> None:
        """Let go of the scene of `boundary_beside`."""
        self._boundary.clear()

    def is_hot(self, point: FloatArray, scene: mi.Scene) -> bool:
        """True if a point (3,), mm, world, lies in the data where the air is not ambient."""
        nearest = self._tree.query(point)[1]
        if abs(self.cells.refractivity[nearest] - self.ambient) <= self.open_step:
            return False
        # Seen from inside, the first face of the boundary shows its back in every direction.
        places = mi.Point3f(*aligned_rows(np.broadcast_to(point, WAYS.shape).astype(np.float32)))
        ways = mi.Vector3f(*aligned_rows(WAYS.astype(np.float32)))
        ray = mi.Ray3f(places, dr.normalize(ways))
        hit = self.boundary_beside(scene).ray_intersect_preliminary(ray)
        found = np.array(hit.is_valid())
        a, b, c = self.cells.points[self._boundary_faces[np.array(hit.prim_index)[found]].T]
        leaving = np.einsum("ij,ij->i", np.cross(b - a, c - a), WAYS[found]) > 0
        return bool(np.count_nonzero(leaving) > 0.5 * len(WAYS))

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self.cells.points)

    def cell(self, place: dt.UInt32, active: dt.Bool) -> Cell:
        """The tetrahedra at places."""
        return Cell(self, place, active)

    @staticmethod
    def unentered(place: dt.UInt32) -> dt.UInt32:
        """The same tetrahedra, not entered through one of their faces."""
        return (place >> 3) * 8 + NO_FACE

    def entrance(self, preliminary: dt.PreliminaryIntersection3f, active: dt.Bool) -> Entrance:
        """The next boundary face, from a ray query of `boundary_beside`."""
        found = active & preliminary.is_valid()
        face = preliminary.prim_index
        place = dr.gather(mi.UInt32, self.boundary_place, face, found)
        return Entrance(
            found=found,
            distance=mi.Float64(preliminary.t),
            place=(place >> 2) * 8 + (place & 3),
            wall=dr.gather(mi.UInt32, self.wall, face, found) != 0,
        )


def boundary_mesh(points: Float32Array, faces: NumberArray) -> mi.Mesh:
    """Triangles as Mitsuba's mesh."""
    used, corners = np.unique(faces, return_inverse=True)
    mesh = mi.Mesh("boundary", vertex_count=len(used), face_count=len(faces))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = mi.Float(aligned(points[used].ravel()))
    parameters["faces"] = mi.UInt32(aligned(corners.astype(np.uint32).ravel()))
    parameters.update()
    return mesh
