"""Names of Dr.Jit's arrays for annotations, and of Mitsuba's records of them.

The types themselves belong to a variant and exist once it is set; to a type checker they are Any.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from iriftrace.core.plain import JsonObject

Bool = Any
Float = Any
Float64 = Any
UInt32 = Any
Point2f = Any
Point3d = Any
Vector3d = Any
Vector3f = Any
Vector4f = Any
Spectrum = Any
TensorXf = Any

Real = Any
"""Float or Float64, or a plain number."""

Vector = Any
"""Three numbers per ray: Vector3f, Vector3d or Point3d."""

Array = Any
"""Any of the arrays above."""

Struct = Any
"""Arrays in tuples, and these in others, as Dr.Jit's control flow passes them on."""

Ray3f = Any
RayDifferential3f = Any
PreliminaryIntersection3f = Any
SurfaceInteraction3f = Any
BSDFSample3f = Any

Scene = Any
"""A ``mi.Scene``; its stubs refuse plain truth values and results of ``mi.load_dict``."""

Sensor = Any
"""A ``mi.Sensor``; ours has methods that its stubs do not know."""

BSDF = Any
"""A ``mi.BSDF``; ours has indices that its stubs do not know."""

Shape = Any
"""A ``mi.Shape``, or a ``mi.Mesh`` where its ``is_mesh()`` says so."""

Properties = Any
"""A ``mi.Properties``, whose values are of no type in Mitsuba's stubs."""

Hits = Any
"""RefractedHits or CurvedHits, as the integrator is."""

Medium = Any
"""TetrahedralAir, or anything else with its methods."""

Cell = Any
"""A piece of a medium: Cell of TetrahedralAir, or anything else with its methods."""

Rays = Callable[[UInt32], tuple[Point3d, Vector3d]]
"""Origins and unit directions of ray numbers."""

Bend = Callable[[Point3d, Vector3d], Hits]
"""Ends of bent rays, from their origins and directions."""

Check = Callable[[Hits], tuple[Bool, Bool]]
"""Masks of bent rays along which the index adds up, and of those that came from ambient air."""

Project = Callable[[Point3d], tuple[Float64, Float64, Bool]]
"""Image position of points, px, and whether it means anything."""


class RayCamera(Protocol):
    """A sensor that gives rays in double precision, as ``calibrated_camera`` does."""

    def description(self) -> JsonObject: ...

    def full_resolution(self) -> tuple[int, ...]: ...

    def rays64(self, x: Float64, y: Float64) -> tuple[Point3d, Vector3d]: ...

    def project64(self, point: Point3d) -> tuple[Float64, Float64, Bool]: ...
