"""One pose: from a loaded scene to its AOV image and metrics, or a free bundle of rays."""

from __future__ import annotations

import math
import time
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from attrs import evolve, frozen
from numpy.typing import ArrayLike, NDArray

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.geometry.triangles import row_lengths
from iriftrace.image.aov_image import AovImage, Status, write_exr
from iriftrace.image.metrics import PoseMetrics, pose_metrics, write_metrics
from iriftrace.runtime import variant as runtime
from iriftrace.scene.load import LoadedScene
from iriftrace.scene.scene import AnyScene, loaded_scene
from iriftrace.trace.engine import choose
from iriftrace.trace.field_reference import shell_error
from iriftrace.trace.lost import warn_of_lost_rays
from iriftrace.trace.pose_image import pose_image
from iriftrace.trace.shell_convergence import NOT_TESTED, SAMPLE


@frozen(eq=False)
class Rendering:
    """One pose's image and its metrics."""

    image: AovImage
    metrics: PoseMetrics

    def __repr__(self) -> str:
        width, height = self.image.resolution
        return f"Rendering({width} x {height} px, {self.metrics!r})"

    def save(self, path: str | Path, *, rgb: str | None = None) -> tuple[Path, Path]:
        """Write the AOV EXR and, beside it, the metrics JSON; returns both names.

        ``rgb`` is that of :func:`iriftrace.write_exr`.
        """
        exr = Path(path)
        started = time.perf_counter()
        write_exr(exr, self.image, rgb=rgb)
        self.metrics.add_time("write", time.perf_counter() - started)
        report = exr.with_suffix(".json")
        write_metrics(report, self.metrics)
        return exr, report


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


def render_scene(
    scene: AnyScene,
    *,
    camera: Camera | None = None,
    include: Collection[int] = (0,),
    nearest: bool = False,
    empty: bool = False,
    check_shells: int = SAMPLE,
    check_field: bool = False,
) -> Rendering:
    """Trace a camera's rays through a scene, bent and unbent, and reduce the hits to metrics.

    Of an ensemble (`LoadedScene.ensemble`) the image holds the mean displacement of the members and
    its standard deviation, and the metrics have the key ``ensemble``; see `pose_image`.

    Parameters
    ----------
    scene : Scene, LoadedScene or path
        A path is loaded first; load once to render many poses.
    camera : Camera, optional
        Takes the place of the scene's own sensor.
    include : collection of int
        Status codes whose rays the metrics use.
    nearest : bool
        See :func:`iriftrace.image.metrics.pose_metrics`.
    empty : bool
        Whether a picture without a good ray is a result too and not an error.
    check_shells : int
        Rays that are traced without every second shell too (metrics ``every_second_shell``), to
        choose the engine; 0 for no test. Where that changes them by more than 3 % the view is
        traced through the field instead, if it lies beside the scene and no engine was asked for;
        see :func:`iriftrace.trace.engine.choose`.
    check_field : bool
        Trace a sample of the rays through the field itself too (``shells_against_field``); see
        :func:`iriftrace.trace.field_reference.shell_error`.

    Returns
    -------
    Rendering

    Raises
    ------
    InputError
        If the camera stands in the hot air or in the part, the film would smear the channels, or
        no ray hits the part in focus.

    Warns
    -----
    IriftraceWarning
        The shells are too few for the view, or over 0.5 % of its hits are lost (status 5 or 6).
    """
    loaded = loaded_scene(scene)
    began = time.perf_counter()
    against_field = shell_error(loaded).as_dict() if check_field else None
    tested, choice = NOT_TESTED, None
    if check_shells:
        choice = choose(loaded, camera, check_shells)
        tested = choice.test
    chosen = loaded if choice is None else choice.scene
    every_second_shell = None
    if tested.resolution is not None:
        through = {"through_field": chosen is not loaded}
        every_second_shell = tested.resolution.as_dict() | through
    check_s = time.perf_counter() - began - tested.straight_s
    image = pose_image(chosen, camera, include, tested.straight)
    known = image.header["time_s"]
    # Loading the field is part of the check, and done once for many poses.
    known.update(load=loaded.load_s, build=loaded.build_s)
    known["straight"] += tested.straight_s
    if not empty:
        _refuse_empty(image)
    reduced = time.perf_counter()
    metrics = pose_metrics(image, loaded.part, include=tuple(include), nearest=nearest)
    warn_of_lost_rays(metrics.rays)
    done = time.perf_counter()
    times: dict[str, float | None] = {
        **image.header["time_s"],
        "check": check_s,
        "metrics": done - reduced,
        "write": 0.0,
        "figures": 0.0,
        # Further members of an ensemble are loaded after the start.
        "total": loaded.load_s + loaded.build_s + done - began,
    }
    checked = evolve(
        metrics,
        time_s=times,
        shells_against_field=against_field,
        every_second_shell=every_second_shell,
    )
    return Rendering(image, checked)


def keep_checks(metrics: PoseMetrics, earlier: Mapping[str, Any]) -> PoseMetrics:
    """Fill in times and checks of the shells that only rendering knew, for an image reduced again.

    `earlier` are the JSON values written when it was rendered; another pose's are not used.
    """
    known = earlier.get("time_s")
    if earlier.get("pose") != metrics.as_dict()["pose"] or not isinstance(known, Mapping):
        return metrics
    return evolve(
        metrics,
        time_s={
            key: known.get(key) if value is None else value for key, value in metrics.time_s.items()
        },
        shells_against_field=earlier.get("shells_against_field"),
        every_second_shell=earlier.get("every_second_shell"),
    )


def trace_rays(
    scene: AnyScene,
    origins: ArrayLike,
    directions: ArrayLike,
    *,
    focus_mm: tuple[float, float] = (0.0, math.inf),
    coherent: bool = False,
    trace_all: bool = True,
) -> RayHits:
    """Trace any bundle of rays: a projector's, a laser sheet's, a random pencil.

    Those of a camera come from `Camera.rays`; the centre of pixel ``i`` lies at ``i + 0.5`` there.

    Parameters
    ----------
    scene : Scene, LoadedScene or path
    origins : (n, 3) array, mm, world
    directions : (n, 3) array, world
        Need not have length one.
    focus_mm : (2,) tuple, mm
        Nearest and farthest length of a straight ray that counts as sharp.
    coherent : bool
        Neighbouring rays run alike, as a camera's do; only the speed depends on it.
    trace_all : bool
        Bend also the rays whose straight twin misses the part; otherwise they are left out.

    Returns
    -------
    RayHits

    Raises
    ------
    InputError
        If the shapes do not match, a value is not finite or a direction is zero; or the scene is
        an ensemble.
    """
    start, heading = _bundle(origins, directions)
    loaded = loaded_scene(scene)
    if loaded.ensemble is not None:
        raise InputError(
            f"{loaded.name} is an ensemble of {len(loaded.ensemble)} fields, and a bundle of rays "
            'is traced through one of them; load it with {"member": 1}, for example.'
        )
    with runtime.using(loaded.variant):
        import drjit as dr
        import mitsuba as mi

        places, headings = _on_device(start), _on_device(heading)
        trace = loaded.integrator.trace(
            loaded.mitsuba_scene,
            lambda ray: (
                dr.gather(mi.Point3d, places, ray),
                dr.gather(mi.Vector3d, headings, ray),
            ),
            len(start),
            focus=focus_mm,
            coherent=coherent,
            trace_all=trace_all,
        ).trace
        if trace is None:
            way, count = np.empty((0, 3)), np.empty(0, dtype=np.int64)
            return RayHits(way, way, way, way, count, count, np.empty(0), count, count, count)
        refracted = trace.refracted
        on_part = np.array(trace.straight_outcome) == 1
        bent_on_part = np.array(refracted.outcome) == 1
        first = loaded.integrator.prepare(loaded.mitsuba_scene).tables.part_first_face

        def points(value: Any, exists: NDArray[np.bool_]) -> FloatArray:
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


def bent_ends(
    scene: LoadedScene, origin: FloatArray, directions: FloatArray
) -> tuple[FloatArray, FloatArray, IntArray, IntArray, BoolArray]:
    """Trace neighbouring rays from one point along their bent lines alone, through one field.

    From a (3,) array, mm, and (n, 3) unit vectors, world: (n, 3) points where each ray hit or was
    last bent, mm, and unit directions from there; (n,) faces of the part under the hit, -1 where it
    ends elsewhere, and numbers of shells, or pieces of the field, that it met; (n,) mask of the
    rays that are lost (`Status.lost`).
    """
    with runtime.using(scene.variant):
        import drjit as dr
        import mitsuba as mi

        from iriftrace.plugins.kernels.bundle import is_lost
        from iriftrace.plugins.kernels.queries import HIT_PART

        prepared = scene.integrator.prepare(scene.mitsuba_scene)
        bend = scene.integrator.bender(prepared, coherent=True)
        rays = dr.arange(mi.UInt32, len(directions))
        heading = dr.gather(mi.Vector3d, _on_device(directions), rays)
        start = mi.Point3d(*(dr.opaque(mi.Float64, float(value)) for value in origin))
        ends = bend(start, heading)
        lost = is_lost(heading, ends)
        dr.eval(*ends, lost)
        face = np.array(ends.face, dtype=np.int64) - prepared.tables.part_first_face
        return (
            np.array(ends.point, dtype=np.float64).T,
            np.array(ends.direction, dtype=np.float64).T,
            np.where(np.array(ends.outcome) == HIT_PART, face, -1),
            np.array(ends.crossings, dtype=np.int64),
            np.array(lost),
        )


def _on_device(vectors: FloatArray) -> Any:
    """Coordinates one after the other (Float64), of which Dr.Jit gathers vectors."""
    import mitsuba as mi

    from iriftrace.plugins.kernels.tables import aligned

    return mi.Float64(aligned(vectors.ravel()))


def is_inside(scene: LoadedScene, points: ArrayLike) -> NDArray[np.bool_]:
    """Mask of points in the hot air or in the part, (n, 3) array, mm, world to (n,) array.

    Of an ensemble in the hot air of any member.
    """
    positions = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    inside = np.zeros(len(positions), dtype=bool)
    with runtime.using(scene.variant):
        for one in (scene,) if scene.ensemble is None else scene.ensemble.scenes():
            for number in np.flatnonzero(~inside):
                found = one.integrator.surroundings_of(one.mitsuba_scene, positions[number])
                inside[number] = found is not None
    return inside


def _bundle(origins: ArrayLike, directions: ArrayLike) -> tuple[FloatArray, FloatArray]:
    start = np.asarray(origins, dtype=np.float64)
    heading = np.asarray(directions, dtype=np.float64)
    if start.shape != heading.shape or start.ndim != 2 or start.shape[1:] != (3,) or not len(start):
        raise InputError(
            f"A bundle of rays needs origins and directions of one shape (n, 3) with n > 0; given "
            f"are {start.shape} and {heading.shape}."
        )
    length = row_lengths(heading)[:, None]
    if not (np.isfinite(start).all() and np.isfinite(heading).all() and (length > 0).all()):
        raise InputError(
            "A ray has an origin or direction that is not finite, or a direction of length zero; "
            "remove it."
        )
    return start, heading / length


def _refuse_empty(image: AovImage) -> None:
    if (image.channels["status.code"] == Status.GOOD).any():
        return
    status = image.status
    if (status == Status.MISSED).all():
        raise InputError(
            "No ray of the camera hits the part; point the camera at it (lookat in the scene file)."
        )
    if np.isin(status, (Status.MISSED, Status.OUT_OF_FOCUS, Status.BLOCKED)).all():
        camera = image.camera
        hit = status == Status.OUT_OF_FOCUS
        if not hit.any():
            raise InputError("Another object hides the part from every pixel; move the camera.")
        lengths = np.linalg.norm(image.vector("straight")[hit] - camera.origin, axis=1)
        raise InputError(
            f"No ray that hits the part is in focus: the hits are {lengths.min():.1f} to "
            f"{lengths.max():.1f} mm away, the focus interval is {camera.focus_mm[0]:g} to "
            f"{camera.focus_mm[1]:g} mm; move the camera or change focus_near and focus_far."
        )
