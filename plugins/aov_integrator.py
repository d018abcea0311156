"""The base of both integrators: a picture of channels, one ray through each pixel's centre."""

from __future__ import annotations

import time
from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.core.runtime.variant import full_precision
from iriftrace.image.aov_image import CHANNELS
from iriftrace.plugins.film import camera_of, refuse_shared_films
from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.kernels.bundle import (
    Bundle,
    StraightHits,
    Trace,
    paired_straight_rays,
    trace_bundle,
)
from iriftrace.plugins.kernels.prepared import PreparedScene
from iriftrace.plugins.kernels.queries import HIT_BLOCKER, counted, ray_query
from iriftrace.plugins.picture import PixelRays, channel_values, sharp_rays, written
from iriftrace.plugins.scene_state import same_state, scene_state
from iriftrace.plugins.stock_sensor import StockSensor

_RENDERED: list[Any] = []
"""The integrator of the latest picture or hits, which alone keeps what it has prepared."""


@cache
def integrator_class(variant: str) -> type:
    """Build the integrators' common class for one Mitsuba variant, the one in force."""

    class AovIntegrator(mi.SamplingIntegrator):
        """Straight and bent first hits of each pixel's ray; what bends them is left open."""

        engine = "shells"
        trace_all = False

        def __init__(self, props: mi.Properties) -> None:
            super().__init__(props)
            self._prepared: PreparedScene | None = None
            self._state: dict[str, object] = {}

        def aov_names(self) -> list[str]:
            return list(CHANNELS)

        def prepare(self, scene: mi.Scene) -> PreparedScene:
            """Tables and sub-scene of a scene; kept until another scene is given."""
            if self._prepared is None or self._prepared.scene is not scene:
                with full_precision():
                    self._prepared = PreparedScene(scene)
                self._state = scene_state(scene, sensors=False)
            return self._prepared

        def refresh(self, scene: mi.Scene) -> None:
            """Forget what was prepared of a scene that `mi.traverse` has changed since."""
            if self._prepared is not None and self._prepared.scene is scene:
                if not same_state(self._state, scene_state(scene, sensors=False)):
                    self.forget_scene()

        def begin(self, scene: mi.Scene) -> None:
            """Prepare a scene of the user's as it is now, and let go of the one before it."""
            self.refresh(scene)
            for other in _RENDERED:
                if other is not self:
                    other.forget_scene()
            _RENDERED[:] = [self]
            if self._prepared is None or self._prepared.scene is not scene:
                self.warn_of_missing_air(self.prepare(scene))

        def prepare_as(self, other: AovIntegrator) -> None:
            """Take over what another integrator has prepared, for the same scene."""
            self._prepared, self._state = other._prepared, other._state

        def forget_scene(self) -> None:
            """Let go of the scene, which holds this integrator and would never be freed else."""
            self._prepared, self._state = None, {}

        def forget(self) -> None:
            """Let go of the scene, and of what was read for it."""
            self.forget_scene()

        def surroundings(self, scene: mi.Scene, sensor: mi.Sensor) -> str | None:
            """The surroundings of a sensor: ``"part"``, ``"hot air"`` or None for neither."""
            matrix = np.asarray(camera_of(sensor).description()["matrix"])
            return self.surroundings_of(scene, matrix[:3, 3])

        def surroundings_of(self, scene: mi.Scene, point: FloatArray) -> str | None:
            """The surroundings of a point (3,), mm, world, in the same words."""
            return self.prepare(scene).surroundings(point)

        def trace(
            self, scene: mi.Scene, rays: dt.Rays, count: int, *, coherent: bool, **options: Any
        ) -> Bundle:
            """Trace a bundle of rays; see :func:`iriftrace.plugins.kernels.bundle.trace_bundle`."""
            prepared = self.prepare(scene)
            return trace_bundle(
                prepared,
                rays,
                count,
                bend=self.bender(prepared, coherent),
                check=self.checking(prepared),
                coherent=coherent,
                **options,
            )

        def trace_pixels(
            self, scene: mi.Scene, sensor: mi.Sensor, straight: StraightHits | None = None
        ) -> tuple[PixelRays, Bundle]:
            """Trace the rays of a sensor's picture; `straight` is that of `image`."""
            self._refuse_clipped_air(scene, sensor)
            rays = PixelRays(sensor, len(self.aov_names()))
            near, far = rays.camera.description()["focus_mm"]
            return rays, self.trace(
                scene,
                rays,
                len(rays),
                focus=(near, float("inf") if far is None else far),
                coherent=True,
                trace_all=self.trace_all,
                straight=straight,
            )

        def bender(self, prepared: PreparedScene, coherent: bool) -> dt.Bend:
            """The rule that bends rays: from origins and directions to where they end."""
            raise NotImplementedError

        def checking(self, prepared: PreparedScene) -> dt.Check:
            """The check of the index along the bent rays; see ``trace_bundle``."""
            raise NotImplementedError

        def straight(self, scene: mi.Scene, sensor: mi.Sensor) -> StraightHits:
            """Straight hits of a sensor's picture, for `image` and `sharp_rays`."""
            rays = PixelRays(sensor, len(self.aov_names()))
            return paired_straight_rays(self.prepare(scene), rays, len(rays), coherent=True)

        def bystanders(
            self, scene: mi.Scene, sensor: mi.Sensor, straight: StraightHits
        ) -> IntArray:
            """Row-major numbers of the pixels where an object without the part behind it is met."""
            prepared = self.prepare(scene)
            if not prepared.has_blockers:
                return np.empty(0, dtype=np.int64)
            rays = PixelRays(sensor, len(self.aov_names()))
            met: dt.UInt32 = dr.compress(straight.outcome == HIT_BLOCKER)
            if dr.width(met) == 0:
                return np.empty(0, dtype=np.int64)
            hidden = ray_query(prepared.part_alone, *rays(met), True, mi.Bool(True)).is_valid()
            pixels = np.array(dr.gather(mi.UInt32, rays.numbers, met), dtype=np.int64)
            found: IntArray = pixels[~np.array(hidden, dtype=bool)]
            return found

        def sharp_rays(
            self, sensor: mi.Sensor, straight: StraightHits, most: int
        ) -> tuple[dt.Point3d, dt.Vector3d] | None:
            """See :func:`iriftrace.plugins.picture.sharp_rays`."""
            return sharp_rays(PixelRays(sensor, len(self.aov_names())), straight, most)

        def image(
            self, scene: mi.Scene, sensor: mi.Sensor, straight: StraightHits | None = None
        ) -> tuple[dt.TensorXf, dict[str, Any]]:
            """All channels of a sensor's picture.

            Those of the crop window, (c, h, w), in the order of ``aov_names()``. `straight`
            are hits of the same sensor's picture of the same part, perhaps in other air. The report
            has ``time_s`` per stage, ``counts`` (``open_boundary`` rays, ``triangles_in_view``
            where shells bend), ``camera`` of the crop window (as of ``iriftrace.Camera.as_dict``)
            and ``straight`` (StraightHits).
            """
            names = self.aov_names()
            rays, bundle = self.trace_pixels(scene, sensor, straight)
            (left, top), (width, height) = rays.corner, rays.size
            description = rays.camera.description()
            started = time.perf_counter()
            trace = bundle.trace
            values = [] if trace is None else self.channel_values(trace, rays.camera)
            traced = None if trace is None else trace.ray
            pixels = written(rays, names, bundle.status, traced, values)
            counts = {"open_boundary": 0 if trace is None else counted(trace.open_boundary)}
            counts |= self.further_counts(scene, rays, trace)
            dr.sync_thread()
            report = {
                "time_s": {**bundle.time_s, "channels": time.perf_counter() - started},
                "counts": counts,
                "camera": Camera.from_dict(description).cropped(left, top, width, height).as_dict(),
                "straight": bundle.straight,
            }
            return mi.TensorXf(pixels, (len(names), height, width)), report

        def _refuse_clipped_air(self, scene: mi.Scene, sensor: mi.Sensor) -> None:
            """Refuse a sensor of Mitsuba whose rays start in the hot air or in the part."""
            if hasattr(sensor, "rays64"):
                return
            for start in StockSensor(sensor).starts():
                where = self.surroundings_of(scene, start)
                if where is not None:
                    clip = float(mi.traverse(sensor)["near_clip"])
                    raise InputError(
                        f"Rays of the {sensor.class_name()} start on its near plane, near_clip "
                        f"{clip:g} mm in front of it, and there inside the {where}, so that what "
                        f"lies before is left out; lower near_clip, or move the sensor out of it.",
                        code="camera.inside_body",
                    )

        def warn_of_missing_air(self, prepared: PreparedScene) -> None:
            """Warn of a scene without shells, where these bend the rays."""
            prepared.tables.warn_of_missing_shells("The scene")

        def further_counts(
            self, scene: mi.Scene, rays: PixelRays, trace: Trace | None
        ) -> dict[str, int]:
            """Further numbers for the report: triangles of shells in the picture's window."""
            tables, project = self.prepare(scene).tables, rays.camera.project64
            return {"triangles_in_view": tables.triangles_in_view(project, rays.corner, rays.size)}

        def channel_values(
            self, trace: Trace, camera: dt.RayCamera
        ) -> list[tuple[dt.Array, dt.Bool]]:
            """Value of each channel and where it exists, in the order of ``aov_names()``."""
            return channel_values(trace, camera)

        def render(
            self,
            scene: mi.Scene,
            sensor: dt.Sensor | int = 0,
            seed: dt.UInt32 | int = 0,
            spp: int = 0,
            develop: bool = True,
            evaluate: bool = True,
        ) -> dt.TensorXf:
            """Picture of all channels, for ``mi.render``; the film keeps the channels' names."""
            refuse_shared_films(scene.sensors())
            self.begin(scene)
            sensor = scene.sensors()[sensor] if isinstance(sensor, int) else sensor
            film = sensor.film()
            with full_precision():
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

    return AovIntegrator
