"""One ray traced again by both engines and by a reference, with its whole path."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from attrs import evolve, frozen

from iriftrace.core.arrays import FloatArray
from iriftrace.core.engines import Engine
from iriftrace.core.errors import InputError
from iriftrace.core.runtime import variant as runtime
from iriftrace.image.aov_image import Status
from iriftrace.image.lost_rays import LostRay
from iriftrace.tracing.facets import FacetSurface, FacetTracer
from iriftrace.tracing.rays import RayHits, traced_as_chosen
from iriftrace.tracing.scene import Scene, ready_scene

REFERENCE = "NumPy"
"""Name of the reference among the paths."""

MOST_POINTS = 100
"""Number of points of an engine's path, each of which is one more trace."""


@frozen(eq=False)
class RayPath:
    """Path of a ray through a scene.

    Attributes
    ----------
    tracer : str
        ``"shells"``, ``"cells"`` or ``"NumPy"``.
    points : (k, 3) array, mm, world
        Start, places where it was bent, and the end. The path through cells has only some of them.
    status : Status
    crossings : int
        Number of shells, or of pieces of the field, that it met.
    edge_distance : float or None, mm
        Smallest distance of a crossing to an edge of its triangle; of the reference alone.
    """

    tracer: str
    points: FloatArray
    status: Status
    crossings: int
    edge_distance: float | None = None

    @property
    def end(self) -> FloatArray:
        """(3,) array, mm, world: where it hit the part, or was last bent."""
        return np.asarray(self.points[-1])


@frozen(eq=False)
class Replay:
    """A ray's paths by both engines and the reference.

    Attributes
    ----------
    ray : LostRay
    paths : tuple of RayPath
    left_out : dict of str
        Tracers that the scene cannot be traced with, and why.
    straight : (3,) array or None, mm, world
        Where the straight ray hits the part.
    """

    ray: LostRay
    paths: tuple[RayPath, ...]
    left_out: dict[str, str]
    straight: FloatArray | None


def replay_ray(scene: Scene, ray: LostRay) -> Replay:
    """Trace a ray again: with shells, with cells, and with the reference.

    The reference (`FacetTracer`, float64 NumPy) bends at the facets of the shells alone. It agrees
    with the engines as far as facets represent the air, and needs neither their acceleration
    structure nor their kernels.

    Parameters
    ----------
    scene : Scene
    ray : LostRay
        Of an ensemble's `LostRay.member`; without one, through the first member whose ray has the
        ray's status.
    """
    start, along = np.array([ray.origin_mm]), np.array([ray.direction])
    along /= np.linalg.norm(along)
    one = _member(ready_scene(scene), ray, start, along)
    paths, left_out, straight = [], {}, None
    for engine in (Engine.SHELLS, Engine.CELLS):
        try:
            through = _with_engine(one, engine)
            hits = traced_as_chosen(through, start, along)
        except InputError as error:
            left_out[engine.value] = str(error)
            continue
        paths.append(_path(through, engine, start, along, hits))
        if np.isfinite(hits.straight).all():
            straight = hits.straight[0]
    tracer = _reference(one)
    path = tracer.trace(start[0], along[0])
    status = tracer.status(start[0], along[0], path)
    paths.append(RayPath(REFERENCE, path.points, status, path.crossings, path.edge_distance))
    return Replay(ray, tuple(paths), left_out, straight)


def _member(scene: Scene, ray: LostRay, start: FloatArray, along: FloatArray) -> Scene:
    """The scene of one field in which a ray is traced."""
    if not scene.members:
        return scene
    for listed, member in zip(scene.members, scene.alone(), strict=True):
        if ray.member == listed.number:
            return member
        if ray.member is None and traced_as_chosen(member, start, along).status[0] == ray.status:
            return member
    raise InputError(
        f"Ray {ray.number} is lost in no member of {scene.name} "
        f"({'number ' + str(ray.member) if ray.member else 'all were tried'}); give the scene in "
        "which it was lost.",
        code="rays.no_member",
    )


def _with_engine(scene: Scene, engine: Engine) -> Scene:
    if scene.compiled.engine.through_cells is engine.through_cells:
        return scene
    return evolve(scene, engine=engine)


def _path(
    scene: Scene, engine: Engine, start: FloatArray, along: FloatArray, hits: RayHits
) -> RayPath:
    """An engine's path, found by stopping the ray at one crossing, or step, after the other."""
    name = "max_steps" if engine.through_cells else "max_crossings"
    crossings = int(hits.crossings[0])
    stops = np.unique(np.linspace(1, max(crossings, 1), min(crossings, MOST_POINTS)).astype(int))
    points = [start[0]]
    for stop in stops.tolist():
        with limited(scene, name, stop):
            points.append(traced_as_chosen(scene, start, along).last_point[0])
    if not np.array_equal(points[-1], hits.last_point[0]):
        points.append(hits.last_point[0])
    status = next(code for code in Status if code == hits.status[0])
    return RayPath(engine.value, np.array(points), status, crossings)


@contextmanager
def limited(scene: Scene, name: str, most: int) -> Iterator[None]:
    """Lower an integrator's limit of crossings or steps inside the block."""
    integrator = scene.compiled.integrator
    former = getattr(integrator, name)
    setattr(integrator, name, most)
    try:
        yield
    finally:
        setattr(integrator, name, former)


def _reference(scene: Scene) -> FacetTracer:
    """The reference with the shells as Mitsuba has them, so with the indices of this light."""
    with runtime.using(scene.compiled.variant):
        tables = scene.compiled.tables
        shells = [
            FacetSurface(
                np.array(shape.vertex_positions_buffer(), dtype=np.float64).reshape(-1, 3)[
                    np.array(shape.faces_buffer()).reshape(-1, 3)
                ],
                sides,
            )
            for shape, sides in zip(tables.shell_shapes, tables.index_pairs, strict=True)
        ]
    bodies = (scene.part, *scene.blockers)
    return FacetTracer(shells, [FacetSurface(body.vertices[body.faces]) for body in bodies])
