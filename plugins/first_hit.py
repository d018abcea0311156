"""The integrator ``first_hit``: where each pixel's ray meets the part, straight and refracted."""

from __future__ import annotations

import time
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from iriftrace.channels import CHANNELS
from iriftrace.errors import InputError
from iriftrace.status import Status

from .aligned import aligned
from .prepared import PreparedScene
from .properties import choice, flag, whole_number
from .stock_sensor import StockSensor
from .tracing import (
    GAVE_UP,
    HIT_BLOCKER,
    HIT_PART,
    RefractedHits,
    refracted_hits,
    straight_hits,
)

NORMALS = ("gradient", "facet")


class Trace(NamedTuple):
    """What became of a bundle of rays; one entry per traced ray (see ``FirstHit.trace``)."""

    ray: Any  # UInt32: number of the ray in the bundle
    origin: Any  # Point3d
    direction: Any  # Vector3d
    straight: Any  # Point3d
    straight_length: Any  # Float64
    straight_outcome: Any  # UInt32
    straight_face: Any  # UInt32: face of the part
    incidence: Any  # Float64, rad
    refracted: RefractedHits
    status: Any  # UInt32
    open_boundary: Any  # Bool


class Bundle(NamedTuple):
    """A trace and what was found of the rays that were not refracted."""

    trace: Trace | None  # None if no ray was to be traced on
    status: Any  # UInt32, every ray of the bundle: its status if it was not traced on
    time_s: dict[str, float]


def check_film(film: Any) -> None:
    """Refuse films that would smear or round the channels."""
    text = str(film)
    if film.class_name() != "HDRFilm" or "component_format = float32" not in text:
        raise InputError(
            "The film must be an hdrfilm with component_format float32: half precision (its "
            'default) rounds millimetres to 0.06; add <string name="component_format" '
            'value="float32"/>.'
        )
    if not film.rfilter().is_box_filter():
        raise InputError(
            "The film's reconstruction filter mixes neighbouring pixels, so hits and misses would "
            'blur into each other; use <rfilter type="box"/>.'
        )


def camera_of(sensor: Any) -> Any:
    """The sensor itself if it gives rays in double precision, else an adapter."""
    return sensor if hasattr(sensor, "rays64") else StockSensor(sensor)


@cache
def plugin_class(variant: str) -> type:
    """Build the plugin's class for one Mitsuba variant, which must be the one in force."""
    import drjit as dr
    import mitsuba as mi

    class FirstHit(mi.SamplingIntegrator):  # type: ignore[misc]
        r"""First hits, straight and refracted (``first_hit``).

        =================  =======  ==================================================  ========
        Parameter          Type     Meaning                                             Default
        =================  =======  ==================================================  ========
        ``normals``        string   refract at normals interpolated from grad(n)        gradient
                                    (``gradient``) or at the triangles' (``facet``)
        ``max_crossings``  integer  a ray with more crossings gives up (status 6)       1000
        ``trace_all``      boolean  refract also the rays whose straight twin misses    false
                                    the part (then status 4 exists)
        =================  =======  ==================================================  ========

        One ray through every pixel's centre. A shape with an ``iso_shell`` bsdf (or Mitsuba's
        ``dielectric``, with the loss of its single precision) is a shell, the shape with id
        ``part`` is the measured part, any other shape blocks the view. The film must be an
        ``hdrfilm`` with component format float32 and box filter. The focus interval comes from the
        sensor. The channels are those of ``CHANNELS``; quantities that do not exist are 0 and
        ``status.code`` says why.

        Limits: geometrical optics, one ray a pixel, no moving shapes, no instances. ``gradient``
        needs vertex normals in the shells' files: Mitsuba invents its own for a PLY without.

        .. code-block:: xml

            <integrator type="first_hit">
                <string name="normals" value="gradient"/>
            </integrator>

        .. code-block:: python

            mi.load_dict({"type": "first_hit", "normals": "gradient"})
        """

        def __init__(self, props: mi.Properties) -> None:
            super().__init__(props)
            self.normals = choice(props, "normals", NORMALS)
            self.max_crossings = whole_number(props, "max_crossings", 1000)
            self.trace_all = flag(props, "trace_all", False)
            self._prepared: PreparedScene | None = None

        def aov_names(self) -> list[str]:
            return list(CHANNELS)

        def to_string(self) -> str:
            return f"FirstHit[normals={self.normals}, max_crossings={self.max_crossings}]"

        def prepare(self, scene: Any) -> PreparedScene:
            """Tables and sub-scene of a scene; kept until another scene is given."""
            if self._prepared is None or self._prepared.scene is not scene:
                self._prepared = PreparedScene(scene)
            return self._prepared

        def surroundings(self, scene: Any, sensor: Any) -> str | None:
            """What a sensor stands in: ``"part"``, ``"hot air"`` or None for neither."""
            matrix = np.asarray(camera_of(sensor).description()["matrix"])
            return self.prepare(scene).surroundings(matrix[:3, 3])

        def trace(
            self,
            scene: Any,
            rays: Any,
            count: int,
            *,
            focus: tuple[float, float],
            coherent: bool,
            trace_all: bool,
        ) -> Bundle:
            """Trace a bundle of rays.

            Parameters
            ----------
            scene : mi.Scene
            rays : callable
                From ray numbers (UInt32) to origins (Point3d, mm) and unit directions (Vector3d).
            count : int
                Number of rays.
            focus : (2,) float, mm
                Nearest and farthest length of a straight ray that counts as sharp.
            coherent : bool
                Neighbouring rays run alike.
            trace_all : bool
                Refract every ray, not only those whose straight twin hits the part.
            """
            prepared = self.prepare(scene)
            tables = prepared.tables
            started = time.perf_counter()
            straight = straight_hits(
                prepared.opaque,
                tables,
                *rays(dr.arange(mi.UInt32, count)),
                coherent=coherent,
                step=prepared.step,
            )
            dr.eval(*straight)
            dr.sync_thread()
            straight_done = time.perf_counter()

            hit = straight.outcome == HIT_PART
            untraced = dr.select(
                straight.outcome == HIT_BLOCKER, mi.UInt32(int(Status.BLOCKED)), int(Status.MISSED)
            )
            chosen = dr.arange(mi.UInt32, count) if trace_all else dr.compress(hit)
            if dr.width(chosen) == 0:
                return Bundle(
                    None, untraced, {"straight": straight_done - started, "refracted": 0.0}
                )
            origin, direction = rays(chosen)
            refracted = refracted_hits(
                scene,
                prepared.opaque,
                tables,
                origin,
                direction,
                coherent=coherent,
                gradient_normals=self.normals == "gradient" and tables.has_normals,
                max_crossings=self.max_crossings,
                step=prepared.step,
            )
            dr.eval(*refracted)
            dr.sync_thread()
            refracted_done = time.perf_counter()

            trace = self._finish(prepared, chosen, origin, direction, straight, refracted, focus)
            return Bundle(
                trace,
                untraced,
                {
                    "straight": straight_done - started,
                    "refracted": refracted_done - straight_done,
                },
            )

        def _finish(
            self,
            prepared: PreparedScene,
            chosen: Any,
            origin: Any,
            direction: Any,
            straight: Any,
            refracted: RefractedHits,
            focus: tuple[float, float],
        ) -> Trace:
            """Join both rays' hits and judge them."""
            tables = prepared.tables
            length = dr.gather(mi.Float64, straight.distance, chosen)
            outcome = dr.gather(mi.UInt32, straight.outcome, chosen)
            face = dr.gather(mi.UInt32, straight.face, chosen)
            on_part = outcome == HIT_PART
            _, normal = tables.plane(face, on_part)
            # The arc cosine alone loses digits near normal incidence.
            sine = dr.norm(dr.cross(direction, normal))
            incidence = dr.atan2(sine, dr.abs(dr.dot(direction, normal)))

            bent_hit = refracted.outcome == HIT_PART
            consistent, from_outside = self._index_check(prepared, refracted)

            near, far = (dr.opaque(mi.Float64, limit) for limit in focus)
            status = mi.UInt32(int(Status.GOOD))
            for code, applies in (
                (Status.INDEX_MISMATCH, ~consistent),
                (Status.ONLY_REFRACTED, ~on_part & bent_hit),
                (Status.REFRACTED_MISSED, on_part & ~bent_hit),
                (Status.GAVE_UP, refracted.outcome == GAVE_UP),
                (
                    Status.BLOCKED,
                    (outcome == HIT_BLOCKER) | (refracted.outcome == HIT_BLOCKER),
                ),
                (Status.OUT_OF_FOCUS, on_part & ((length < near) | (length > far))),
                (Status.MISSED, (outcome + refracted.outcome) == 0),
            ):
                status = dr.select(applies, mi.UInt32(int(code)), status)
            return Trace(
                ray=chosen,
                origin=origin,
                direction=direction,
                straight=dr.select(on_part, origin + direction * length, 0),
                straight_length=length,
                straight_outcome=outcome,
                straight_face=face - tables.part_first_face,
                incidence=dr.select(on_part, incidence, 0),
                refracted=refracted,
                status=status,
                open_boundary=~from_outside & (status == int(Status.GOOD)),
            )

        def _index_check(
            self, prepared: PreparedScene, refracted: RefractedHits
        ) -> tuple[Any, Any]:
            """Whether a ray's index steps lead to the layer at its hit, and start from ambient.

            The steps of a ray and the index before the first of them give the layer in which it
            ended. It must be one of those that touch the part there.
            """
            tables = prepared.tables
            hit = refracted.outcome == HIT_PART
            face = refracted.face - tables.part_first_face
            ambient, slack, open_steps = (
                dr.opaque(mi.Float64, value)
                for value in (tables.ambient, tables.half_step, tables.open_steps)
            )
            entry = dr.select(refracted.entry_index != 0, refracted.entry_index, ambient)
            layer = entry + refracted.index_sum
            lowest = dr.gather(mi.Float64, prepared.lowest_wall_index, face, hit) - slack
            highest = dr.gather(mi.Float64, prepared.highest_wall_index, face, hit) + slack
            missing = dr.abs(entry - ambient)
            fits = (layer > lowest) & (layer < highest)
            # A ray without a crossing does not tell in which air it runs, unless the part's wall
            # has one kind only.
            silent = hit & (refracted.entry_index == 0) & dr.isfinite(lowest)
            silent &= (lowest < ambient - 2 * slack) | (highest > ambient + 2 * slack)
            dr.eval(layer, missing, fits, silent)
            doubtful = dr.compress(hit & (~fits | silent))
            if dr.width(doubtful) > 0:
                number = np.array(doubtful)
                near = prepared.layers_near(*self._hits(prepared, refracted, number))
                right = (np.abs(np.array(layer)[number] - near) < tables.half_step).any(axis=0)
                # It has come all its way in the air before the wall then, through an open end.
                astray = np.array(silent)[number] & ~right
                steps, exact = np.array(missing), np.array(fits)
                steps[number[astray]] = np.abs(near[0, astray] - tables.ambient)
                exact[number] = right | astray
                missing, fits = mi.Float64(aligned(steps)), mi.Bool(aligned(exact))
            return fits & (missing < open_steps + slack), missing < slack

        def _hits(
            self, prepared: PreparedScene, refracted: RefractedHits, number: Any
        ) -> tuple[Any, Any]:
            """Points (n, 3) and outward normals (n, 3) of some of the refracted hits."""
            vertices, faces = prepared.tables.part_arrays()
            face = np.array(refracted.face)[number] - prepared.tables.part_first_face
            a, b, c = np.moveaxis(vertices[faces[face]], 1, 0)
            normals = np.cross(b - a, c - a)
            normals /= np.linalg.norm(normals, axis=1, keepdims=True)
            # Axis by axis: Dr.Jit compiles a kernel for every length when it interleaves them.
            return np.stack([np.array(axis)[number] for axis in refracted.point], axis=1), normals

        def image(self, scene: Any, sensor: Any) -> tuple[Any, dict[str, Any]]:
            """All channels of a sensor's picture.

            Parameters
            ----------
            scene : mi.Scene
            sensor : mi.Sensor

            Returns
            -------
            channels : TensorXf, (c, h, w)
                In the order of ``CHANNELS``, the crop window only.
            report : dict
                ``time_s`` per stage, ``open_boundary`` rays, ``shell_triangles_in_view`` and
                ``camera`` (as of ``iriftrace.camera.Camera.as_dict``).
            """
            film = sensor.film()
            check_film(film)
            camera = camera_of(sensor)
            description = camera.description()
            width, height = (int(n) for n in film.crop_size())
            left, top = (int(n) for n in film.crop_offset())
            columns = dr.opaque(mi.UInt32, width)

            def rays(number: Any) -> tuple[Any, Any]:
                x = mi.Float64(number % columns) + (left + 0.5)
                y = mi.Float64(number // columns) + (top + 0.5)
                return camera.rays64(x, y)

            count = width * height
            near, far = description["focus_mm"]
            bundle = self.trace(
                scene,
                rays,
                count,
                focus=(near, float("inf") if far is None else far),
                coherent=True,
                trace_all=self.trace_all,
            )
            started = time.perf_counter()
            trace = bundle.trace
            pixels = dr.zeros(mi.Float, len(CHANNELS) * count)
            everywhere = dr.arange(mi.UInt32, count)
            status_row = len(CHANNELS) - 1
            dr.scatter(pixels, mi.Float(bundle.status), everywhere + status_row * count)
            dr.eval(pixels)
            open_boundary = 0
            if trace is not None:
                for row, (value, exists) in enumerate(self._channel_values(trace, camera)):
                    value = mi.Float(dr.select(exists, value, 0))
                    dr.scatter(pixels, value, trace.ray + row * count)
                dr.eval(pixels)
                open_boundary = int(dr.count(trace.open_boundary)[0])
            dr.sync_thread()
            report = {
                "time_s": {**bundle.time_s, "channels": time.perf_counter() - started},
                "open_boundary": open_boundary,
                "shell_triangles_in_view": self.prepare(scene).tables.triangles_in_view(
                    camera.project64, tuple(description["resolution"])
                ),
                "camera": description,
            }
            return mi.TensorXf(pixels, (len(CHANNELS), height, width)), report

        def _channel_values(self, trace: Trace, camera: Any) -> list[tuple[Any, Any]]:
            """Value of each channel and where it exists, in the order of ``CHANNELS``."""
            straight_hit = trace.straight_outcome == HIT_PART
            bent_hit = trace.refracted.outcome == HIT_PART
            both = straight_hit & bent_hit
            point = trace.refracted.point
            displacement = point - trace.straight
            # A point of the straight ray at the depth of the refracted hit appears at the pixel's
            # centre; projecting it too cancels what rounding the projection has.
            unbent = trace.origin + trace.direction * dr.dot(point - trace.origin, trace.direction)
            x_unbent, y_unbent, _ = camera.project64(unbent)
            x, y, in_front = camera.project64(point)
            visible = bent_hit & in_front
            always = mi.Bool(True)
            return [
                *((value, straight_hit) for value in trace.straight),
                *((value, bent_hit) for value in point),
                *((value, both) for value in displacement),
                (dr.norm(displacement), both),
                (x_unbent - x, visible),
                (y_unbent - y, visible),
                (trace.incidence, straight_hit),
                (trace.refracted.path_length, bent_hit),
                (trace.refracted.crossings, always),
                (trace.straight_face + 1, straight_hit),
                (trace.status, always),
            ]

        def render(
            self,
            scene: Any,
            sensor: Any = 0,
            seed: Any = 0,
            spp: int = 0,
            develop: bool = True,
            evaluate: bool = True,
        ) -> Any:
            """Picture of all channels, for ``mi.render``; the film keeps the channels' names."""
            sensor = scene.sensors()[sensor] if isinstance(sensor, int) else sensor
            film = sensor.film()
            channels, _ = self.image(scene, sensor)
            count, height, width = channels.shape
            base = film.prepare(self.aov_names()) - count
            block = film.create_block()
            pixel = dr.arange(mi.UInt32, height * width)
            position = mi.Point2f(
                mi.Float(pixel % width) + 0.5 + film.crop_offset().x,
                mi.Float(pixel // width) + 0.5 + film.crop_offset().y,
            )
            # The film's own channels come first: nothing in them but the weight, the last.
            values = [mi.Float(0)] * (base - 1) + [mi.Float(1)]
            for row in range(count):
                values.append(dr.gather(mi.Float, channels.array, pixel + row * height * width))
            block.put(position, values)
            film.put_block(block)
            return film.develop() if develop else mi.TensorXf()

    return FirstHit
