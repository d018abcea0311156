"""A medium of one's own, given by its index and gradient at points, in steps of one length.

It has the methods of `iriftrace.plugins.kernels.tetrahedra.TetrahedralAir` that
:mod:`iriftrace.plugins.kernels.walk` uses: its boundary is a box, and each step a piece.
"""

from __future__ import annotations

from typing import NoReturn, Protocol

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike

from iriftrace.core.arrays import Float32Array, FloatArray, NumberArray
from iriftrace.core.errors import InputError
from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.kernels.prepared import scene_beside
from iriftrace.plugins.kernels.tetrahedra import CellPassage, Entrance, boundary_mesh

OPEN_STEP = 1e-6
"""Step of the index at the box that is left out: 1 um over a metre, for a ray at 45 degrees."""


class Medium(Protocol):
    """A medium whose index is continuous, and at the faces of its box that of the air around."""

    def index(self, point: dt.Point3d) -> dt.Float64:
        """Index at points (Point3d, mm, world)."""

    def gradient(self, point: dt.Point3d) -> dt.Vector3d:
        """Gradient of the index at points (Vector3d, 1/mm)."""

    def extent(self) -> tuple[ArrayLike, ArrayLike]:
        """Least and largest corner (3,) of a box, mm, world; outside of it rays are straight."""


class MarchedMedium:
    """A `Medium` as the walk needs it; `step` is the length of a step, mm.

    InputError if there is no step or no box.
    """

    def __init__(self, medium: Medium, step: float) -> None:
        self.medium, self.step = medium, dr.opaque(mi.Float64, step)
        # The boundary's mesh is in single precision, and so is the box.
        low, high = (np.array(corner, dtype=np.float32) for corner in medium.extent())
        if not (low.shape == high.shape == (3,) and (low < high).all() and 0 < step < np.inf):
            raise InputError(
                f"A medium from {low} to {high} mm cannot be passed in steps of {step} mm; give a "
                "least and a largest corner, and a positive length.",
                code="medium.extent",
            )
        self._corners = low, high
        self.low, self.high = (
            [dr.opaque(mi.Float64, float(x)) for x in corner] for corner in (low, high)
        )
        self.ambient = self._index_at(low.astype(np.float64)) - 1
        self.open_step = OPEN_STEP
        self._mesh = boundary_mesh(*_box(low, high))
        self._boundary: list[mi.Scene] = []  # a scene, and the box next to it

    @property
    def cells(self) -> NoReturn:
        """A field has cells, of air that results state."""
        raise InputError(
            "The rays pass a medium of your own, whose air results cannot state; use mi.render or "
            "iriftrace.hits, which need no statement.",
            code="medium.own",
        )

    def _index_at(self, point: FloatArray) -> float:
        return float(mi.Float64(self.medium.index(mi.Point3d(*point.tolist())))[0])

    def boundary_beside(self, scene: mi.Scene) -> mi.Scene:
        """The box, as a scene that kernels may query together with another one."""
        if not self._boundary or self._boundary[0] is not scene:
            self._boundary[:] = scene, scene_beside(scene, [self._mesh])
        return self._boundary[1]

    def forget_scene(self) -> None:
        """Let go of the scene of `boundary_beside`."""
        self._boundary.clear()

    def is_hot(self, point: FloatArray, scene: mi.Scene) -> bool:
        """True if the index at a point (3,), mm, world, in the box is not that of its corner."""
        low, high = self._corners
        inside = bool((low < point).all() and (point < high).all())
        return inside and abs(self._index_at(point) - 1 - self.ambient) > self.open_step

    def entrance(self, preliminary: dt.PreliminaryIntersection3f, active: dt.Bool) -> Entrance:
        """The box's next triangle, from a ray query of `boundary_beside`."""
        found = active & preliminary.is_valid()
        return Entrance(found, mi.Float64(preliminary.t), preliminary.prim_index, mi.Bool(False))

    def cell(self, place: dt.UInt32, active: dt.Bool) -> _Step:
        """The next step of rays that came in by the triangle `place` of the box."""
        return _Step(self, place >> 1)

    @staticmethod
    def unentered(place: dt.UInt32) -> dt.UInt32:
        """The same steps; where rays came in does not matter to them."""
        return place


class _Step:
    """The next step of each ray."""

    def __init__(self, medium: MarchedMedium, face: dt.UInt32) -> None:
        self._of, self._medium, self._face = medium, medium.medium, face

    def refractivity(self, point: dt.Point3d) -> dt.Float64:
        """The index less 1 (Float64) at points (Point3d, mm)."""
        return mi.Float64(self._medium.index(point)) - 1

    def acceleration(self, point: dt.Point3d, heading: dt.Vector3d) -> dt.Vector3d:
        """The index times its gradient (Vector3d, 1/mm)."""
        gradient: dt.Vector3d = mi.Vector3d(self._medium.gradient(point))
        return gradient * mi.Float64(self._medium.index(point))

    def gradient_error(self, point: dt.Point3d, heading: dt.Vector3d) -> dt.Vector3f:
        """The gradient is that of the index."""
        return mi.Vector3f(0)

    def entry_distance(
        self, point: dt.Point3d, direction: dt.Vector3d
    ) -> tuple[dt.Float64, dt.Bool]:
        """Distance from a point close by to the box's face (mm), and whether rays enter there."""
        distance, entering = mi.Float64(0), mi.Bool(False)
        for axis in range(3):
            for number, corner in enumerate((self._of.low, self._of.high)):
                here, ahead = self._face == 2 * axis + number, direction[axis]
                gap = dr.select(ahead == 0, 0, (corner[axis] - point[axis]) / ahead)
                distance = dr.select(here, gap, distance)
                entering |= here & ((ahead > 0) if number == 0 else (ahead < 0))
        return distance, entering

    def passage(self, point: dt.Point3d, direction: dt.Vector3d) -> CellPassage:
        """A straight step, up to the box's face at most."""
        leaving: dt.Float64 = mi.Float64(dr.inf)
        for axis in range(3):
            ahead = direction[axis]
            face = dr.select(ahead > 0, self._of.high[axis], self._of.low[axis])
            gap = dr.select(ahead == 0, dr.inf, (face - point[axis]) / ahead)
            leaving = dr.minimum(leaving, gap)
        length = dr.maximum(dr.minimum(self._of.step, leaving), 0)
        never = mi.Bool(False)
        return CellPassage(length, mi.UInt32(0), leaving <= self._of.step, never, never)


def _box(low: Float32Array, high: Float32Array) -> tuple[Float32Array, NumberArray]:
    """Corners (8, 3) and outward triangles (12, 3) of a box, two a face: -x, +x, -y, ..., +z."""
    number = np.arange(8)
    corners = np.where(((number[:, None] >> np.arange(3)) & 1) == 1, high, low)
    faces = []
    for axis in range(3):
        one, other = 1 << (axis + 1) % 3, 1 << (axis + 2) % 3
        near, far = np.array(((0, one, one + other), (0, one + other, other))), 1 << axis
        faces += [near[:, ::-1], near + far]
    return corners, np.concatenate(faces).astype(np.uint32)
