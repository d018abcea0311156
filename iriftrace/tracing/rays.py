"""Bundles of rays traced through a scene, and lines of sight from one point."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from attrs import frozen
from numpy.typing import ArrayLike

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.core.mesh.triangles import row_lengths
from iriftrace.core.runtime import variant as runtime
from iriftrace.image.aov_image import Status
from iriftrace.tracing.engine import choose
from iriftrace.tracing.scene import Scene, ready_scene

if TYPE_CHECKING:
    import mitsuba as mi


@frozen(eq=False)
class RayHits:
    """Hits of a bundle of n rays.

    Attributes
    ----------
    straight, refracted : (n, 3) arrays, mm, world
        First hits on the part; NaN where there is none.
    last_point, direction : (n, 3) arrays, mm and unit vectors, world
        Where the refracted ray hit or was last bent, and its direction from there.
    face, refracted_face : (n,) arrays of int
        Face of the part under either hit; -1 where there is none.
    path_length : (n,) array, mm
        Geometric length of the refracted ray; NaN where it hits nothing.
    crossings : (n,) array of int
        Shells the refracted ray met.
    status : (n,) array of int
        Codes of :class:`iriftrace.image.aov_image.Status`.
    ray : (n,) array of int
        Number of each ray in the bundle that was given.
    """

    straight: FloatArray
    refracted: FloatArray
    last_point: FloatArray
    direction: FloatArray
    face: IntArray
    refracted_face: IntArray
    path_length: FloatArray
    crossings: IntArray
    status: IntArray
    ray: IntArray

    @property
    def displacement(self) -> FloatArray:
        """(n, 3) array, mm, world: refracted minus straight hit."""
        return self.refracted - self.straight

    def __repr__(self) -> str:
        counts = {s.key: int((self.status == s).sum()) for s in Status}
        found = ", ".join(f"{n} {key}" for key, n in counts.items() if n)
        return f"RayHits({len(self.status)} rays: {found or 'none'})"


def trace_rays(
    scene: Scene,
    origins: ArrayLike,
    directions: ArrayLike,
    *,
    focus_mm: tuple[float, float] = (0.0, math.inf),
    coherent: bool = False,
    trace_all: bool = True,
) -> RayHits:
    """Trace any bundle of rays: a projector's, a laser sheet's, a random pencil.

    Those of a camera come from `Camera.rays`.
    The engine is chosen by :func:`iriftrace.tracing.engine.choose`, unless one was requested.
    Request one to compare bundles, as for finite differences; `hits` has derivatives.

    Parameters
    ----------
    scene : Scene
    origins : (n, 3) array, mm, world
    directions : (n, 3) array, world
        Need not have length one.
    focus_mm : (2,) tuple, mm
        Nearest and farthest length of a straight ray that counts as sharp.
    coherent : bool
        Neighbouring rays are similar, as a camera's are; this affects only the speed.
    trace_all : bool
        Also trace refracted rays whose straight twin misses the part; otherwise they are left out.

    Raises
    ------
    InputError
        If the shapes do not match, a value is not finite or a direction is zero; or the scene is
        an ensemble.

    Warns
    -----
    IriftraceWarning
        The shells are too few for these rays.
    """
    start, heading = _bundle(origins, directions)
    loaded = ready_scene(scene)
    refuse_several_fields(loaded)
    chosen = choose(loaded, (start, heading)).scene if loaded.engine.free else loaded
    return traced_as_chosen(
        chosen, start, heading, focus_mm=focus_mm, coherent=coherent, trace_all=trace_all
    )


def refuse_several_fields(scene: Scene) -> None:
    """Refuse an ensemble where a bundle of rays is traced through one field."""
    if scene.members:
        raise InputError(
            f"{scene.name} is an ensemble of {len(scene.members)} fields, and a bundle of rays "
            'is traced through one of them; load it with {"member": 1}, for example.',
            code="scene.several_fields",
        )


def traced_as_chosen(
    scene: Scene,
    origins: FloatArray,
    directions: FloatArray,
    *,
    focus_mm: tuple[float, float] = (0.0, math.inf),
    coherent: bool = False,
    trace_all: bool = True,
) -> RayHits:
    """As `trace_rays`, for rays whose engine is already chosen; directions have length one."""
    with runtime.using(scene.compiled.variant):
        import drjit as dr
        import mitsuba as mi

        places, headings = _on_device(origins), _on_device(directions)
        compiled = scene.compiled
        trace = compiled.integrator.trace(
            compiled.mitsuba_scene,
            lambda ray: (dr.gather(mi.Point3d, places, ray), dr.gather(mi.Vector3d, headings, ray)),
            len(origins),
            focus=focus_mm,
            coherent=coherent,
            trace_all=trace_all,
        ).trace
        if trace is None:
            empty, count = np.empty((0, 3)), np.empty(0, dtype=np.int64)
            return RayHits(
                empty, empty, empty, empty, count, count, np.empty(0), count, count, count
            )
        refracted = trace.refracted
        on_part = np.array(trace.straight_outcome) == 1
        bent_on_part = np.array(refracted.outcome) == 1
        first = compiled.tables.part_first_face

        def points(value: mi.Point3d, exists: BoolArray) -> FloatArray:
            return np.where(exists[:, None], np.array(value, dtype=np.float64).T, np.nan)

        return RayHits(
            straight=points(trace.straight, on_part),
            refracted=points(refracted.point, bent_on_part),
            last_point=np.array(refracted.point, dtype=np.float64).T,
            direction=np.array(refracted.direction, dtype=np.float64).T,
            face=np.where(on_part, np.array(trace.straight_face, dtype=np.int64), -1),
            refracted_face=np.where(
                bent_on_part, np.array(refracted.face, dtype=np.int64) - first, -1
            ),
            path_length=np.where(bent_on_part, np.array(refracted.path_length), np.nan),
            crossings=np.array(refracted.crossings, dtype=np.int64),
            status=np.array(trace.status, dtype=np.int64),
            ray=np.array(trace.ray, dtype=np.int64),
        )


class RayEnds(NamedTuple):
    """Ends of n rays from one point."""

    point: FloatArray  # (n, 3), mm: where each hit or was last bent
    direction: FloatArray  # (n, 3), unit: from there
    face: IntArray  # of the part under the hit; -1 where it ends elsewhere
    crossings: IntArray  # shells, or pieces of the field, that it met
    lost: BoolArray  # where it ends is not known (`Status.lost`)
    blocked: BoolArray  # it ends on a body that only blocks the view


def refracted_hits(
    scene: Scene, origin: FloatArray, directions: FloatArray, *, bent: bool = True
) -> RayEnds:
    """Trace neighbouring rays from one point along their refracted paths alone, in one field.

    From a (3,) array, mm, and (n, 3) unit vectors, world. Rays that are not `bent` run straight, as
    without the hot air.
    """
    with runtime.using(scene.compiled.variant):
        import drjit as dr
        import mitsuba as mi

        from iriftrace.plugins.kernels.bundle import is_lost, straight_hits
        from iriftrace.plugins.kernels.queries import HIT_BLOCKER, HIT_PART

        integrator = scene.compiled.integrator
        prepared = integrator.prepare(scene.compiled.mitsuba_scene)
        rays = dr.arange(mi.UInt32, len(directions))
        heading = dr.gather(mi.Vector3d, _on_device(directions), rays)
        start = mi.Point3d(*(dr.opaque(mi.Float64, float(value)) for value in origin))
        if bent:
            ends = integrator.bender(prepared, coherent=True)(start, heading)
            place, ahead, outcome, row = ends.point, ends.direction, ends.outcome, ends.face
            crossings, lost = ends.crossings, is_lost(heading, ends)
        else:
            hit = straight_hits(prepared, start, heading, coherent=True)
            outcome, row, ahead = hit.outcome, hit.face, heading
            place = start + heading * dr.select(dr.isfinite(hit.distance), hit.distance, 0)
            crossings, lost = (
                dr.zeros(mi.UInt32, len(directions)),
                dr.zeros(mi.Bool, len(directions)),
            )
        dr.eval(place, ahead, outcome, row, crossings, lost)
        face = np.array(row, dtype=np.int64) - prepared.tables.part_first_face
        ended = np.array(outcome)
        return RayEnds(
            np.array(place, dtype=np.float64).T,
            np.array(ahead, dtype=np.float64).T,
            np.where(ended == HIT_PART, face, -1),
            np.array(crossings, dtype=np.int64),
            np.array(lost),
            ended == HIT_BLOCKER,
        )


def _on_device(vectors: FloatArray) -> mi.Float64:
    """Coordinates one after the other (Float64), from which Dr.Jit gathers vectors."""
    import mitsuba as mi

    from iriftrace.plugins.kernels.vertex_table import aligned

    return mi.Float64(aligned(vectors.ravel()))


def is_inside(scene: Scene, points: ArrayLike) -> BoolArray:
    """Mask of points in the hot air or in the part, (n, 3) array, mm, world to (n,) array.

    For an ensemble, in the hot air of any member that counts.
    """
    positions = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    inside = np.zeros(len(positions), dtype=bool)
    with runtime.using(scene.compiled.variant):
        for one in scene.alone(scene.counted):
            for number in np.flatnonzero(~inside):
                compiled, place = one.compiled, positions[number]
                found = compiled.integrator.surroundings_of(compiled.mitsuba_scene, place)
                inside[number] = found is not None
    return inside


def _bundle(origins: ArrayLike, directions: ArrayLike) -> tuple[FloatArray, FloatArray]:
    start = np.asarray(origins, dtype=np.float64)
    heading = np.asarray(directions, dtype=np.float64)
    if start.shape != heading.shape or start.ndim != 2 or start.shape[1:] != (3,) or not len(start):
        raise InputError(
            f"A bundle of rays needs origins and directions of one shape (n, 3) with n > 0; given "
            f"are {start.shape} and {heading.shape}.",
            code="rays.shape",
        )
    length = row_lengths(heading)[:, None]
    if not (np.isfinite(start).all() and np.isfinite(heading).all() and (length > 0).all()):
        raise InputError(
            "A ray has an origin or direction that is not finite, or a direction of length zero; "
            "remove it.",
            code="rays.not_finite",
        )
    return start, heading / length
