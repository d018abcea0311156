"""The base of both integrators: a picture of channels, one ray through each pixel's centre.

Pictures that cannot fit into memory, and films that would smear the channels, are refused first.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iriftrace.camera.camera import Camera
from iriftrace.camera.tiles import pixels_in_tiles
from iriftrace.core.errors import InputError
from iriftrace.image.aov_image import CHANNELS
from iriftrace.plugins.kernels.bundle import Bundle, Trace, straight_twins, trace_bundle
from iriftrace.plugins.kernels.prepared import PreparedScene
from iriftrace.plugins.kernels.queries import HIT_PART, StraightHits
from iriftrace.plugins.stock_sensor import StockSensor
from iriftrace.runtime.variant import cuda_state, current_variant, full_precision

BYTES_PER_PIXEL = 170
"""Least memory of a picture: channels, straight rays, their state and the metrics.

Measured where a fifth of the rays hit the part; more hits need more.
"""

MOST_VALUES = 2**32 - 1
"""Entries of one of Dr.Jit's arrays, such as all channels of a picture."""

_LIMIT_OF_CONTAINER = Path("/sys/fs/cgroup/memory.max")


def memory_bytes() -> float:
    """Memory of the GPU, machine or container; infinite where the system does not say."""
    if (current_variant() or "").startswith("cuda"):
        return cuda_state().memory_bytes or float("inf")
    try:
        installed = float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):
        installed = float("inf")
    try:
        # "max" where there is no limit.
        return min(installed, float(_LIMIT_OF_CONTAINER.read_text()))
    except (OSError, ValueError):
        return installed


def check_picture_size(width: int, height: int, channels: int) -> None:
    """Refuse a picture that is larger than memory, or than an array can be.

    Parameters
    ----------
    width, height : int
        Pixels that are traced.
    channels : int

    Raises
    ------
    InputError
    """
    pixels = width * height
    advice = "lower the resolution (-D scale=...), or crop the film"
    needed, there = BYTES_PER_PIXEL * pixels, memory_bytes()
    if needed > there:
        raise InputError(
            f"A picture of {width} x {height} pixels needs at least {needed:,} bytes of memory, "
            f"but this machine has {int(there):,}; {advice}."
        )
    if channels * pixels > MOST_VALUES:
        raise InputError(
            f"A picture of {width} x {height} pixels has {channels * pixels:,} values in "
            f"{channels} channels ({4 * channels * pixels:,} bytes), but one array holds at most "
            f"{MOST_VALUES:,}; {advice}."
        )


Window = tuple[tuple[int, int], tuple[int, int]]
"""Left upper and right lower corner of a part of the picture, px."""


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
            'run into each other; use <rfilter type="box"/>.'
        )


def camera_of(sensor: Any) -> Any:
    """The sensor itself if it gives rays in double precision, else an adapter."""
    return sensor if hasattr(sensor, "rays64") else StockSensor(sensor)


@cache
def integrator_class(variant: str) -> type:
    """Build the integrators' common class for one Mitsuba variant, the one in force."""
    import drjit as dr
    import mitsuba as mi

    @lru_cache(maxsize=2)
    def tiles(width: int, height: int) -> Any:
        """Row-major numbers of a picture's pixels, tile by tile (UInt32), on the device."""
        return mi.UInt32(pixels_in_tiles(width, height))

    class AovIntegrator(mi.SamplingIntegrator):  # type: ignore[misc]
        """Straight and bent first hits of each pixel's ray; what bends them is left open."""

        engine = "shells"
        trace_all = False

        def __init__(self, props: mi.Properties) -> None:
            super().__init__(props)
            self._prepared: PreparedScene | None = None

        def aov_names(self) -> list[str]:
            return list(CHANNELS)

        def prepare(self, scene: Any) -> PreparedScene:
            """Tables and sub-scene of a scene; kept until another scene is given."""
            if self._prepared is None or self._prepared.scene is not scene:
                with full_precision():
                    self._prepared = PreparedScene(scene)
            return self._prepared

        def prepare_as(self, other: Any) -> None:
            """Take over what another integrator has prepared, for the same scene."""
            self._prepared = other._prepared

        def forget(self) -> None:
            """Let go of the scene, which holds this integrator and would never be freed else."""
            self._prepared = None

        def surroundings(self, scene: Any, sensor: Any) -> str | None:
            """The surroundings of a sensor: ``"part"``, ``"hot air"`` or None for neither."""
            matrix = np.asarray(camera_of(sensor).description()["matrix"])
            return self.surroundings_of(scene, matrix[:3, 3])

        def surroundings_of(self, scene: Any, point: NDArray[np.float64]) -> str | None:
            """The surroundings of a point (3,), mm, world, in the same words."""
            return self.prepare(scene).surroundings(point)

        def trace(
            self,
            scene: Any,
            rays: Any,
            count: int,
            *,
            focus: tuple[float, float],
            coherent: bool,
            trace_all: bool,
            straight: StraightHits | None = None,
        ) -> Bundle:
            """Trace a bundle of rays; see :func:`iriftrace.plugins.kernels.bundle.trace_bundle`."""
            prepared = self.prepare(scene)
            return trace_bundle(
                prepared,
                rays,
                count,
                bend=self.bender(prepared, coherent),
                check=self.checking(prepared),
                focus=focus,
                coherent=coherent,
                trace_all=trace_all,
                straight=straight,
            )

        def bender(self, prepared: PreparedScene, coherent: bool) -> Callable[[Any, Any], Any]:
            """The rule that bends rays: from origins and directions to where they end."""
            raise NotImplementedError

        def checking(self, prepared: PreparedScene) -> Callable[[Any], tuple[Any, Any]]:
            """The check of the index along the bent rays; see ``trace_bundle``."""
            raise NotImplementedError

        def shell_triangles(self, scene: Any, camera: Any, window: Window) -> int | None:
            """Triangles of shells in a window of the picture, None where rays pass by them."""
            return self.prepare(scene).tables.triangles_in_view(camera.project64, *window)

        def pixel_rays(self, sensor: Any) -> tuple[Any, Callable[[Any], tuple[Any, Any]]]:
            """Row-major numbers of a picture's pixels (UInt32), tile by tile, and their rays.

            The latter are a rule that gives origins (Point3d, mm) and unit directions (Vector3d)
            of the pixels by their places in that order (UInt32). An InputError if the film would
            smear the channels, or the picture is larger than memory.
            """
            camera, film = camera_of(sensor), sensor.film()
            check_film(film)
            width, height = (int(n) for n in film.crop_size())
            check_picture_size(width, height, len(self.aov_names()))
            left, top = (int(n) for n in film.crop_offset())
            columns = dr.opaque(mi.UInt32, width)
            pixels = tiles(width, height)

            def rays(place: Any) -> tuple[Any, Any]:
                pixel = dr.gather(mi.UInt32, pixels, place)
                x = mi.Float64(pixel % columns) + (left + 0.5)
                y = mi.Float64(pixel // columns) + (top + 0.5)
                return camera.rays64(x, y)

            return pixels, rays

        def straight(self, scene: Any, sensor: Any) -> StraightHits:
            """Straight hits of a sensor's picture, for `image` and `sharp_rays`."""
            pixels, rays = self.pixel_rays(sensor)
            return straight_twins(self.prepare(scene), rays, dr.width(pixels), coherent=True)

        def sharp_rays(
            self, sensor: Any, straight: StraightHits, most: int
        ) -> tuple[Any, Any] | None:
            """Rays of a sensor whose straight hits are on the part, in focus: a sample of them.

            Origins (Point3d, mm) and unit directions (Vector3d); None if there are none.
            """
            near, far = camera_of(sensor).description()["focus_mm"]
            sharp = (straight.outcome == HIT_PART) & (
                straight.distance >= dr.opaque(mi.Float64, near)
            )
            if far is not None:
                sharp &= straight.distance <= dr.opaque(mi.Float64, far)
            places = dr.compress(sharp)
            there = dr.width(places)
            if there == 0:
                return None
            number = mi.Float64(dr.arange(mi.UInt32, min(most, there)))
            apart = dr.opaque(mi.Float64, max(there / most, 1.0))
            _, rays = self.pixel_rays(sensor)
            sample = rays(dr.gather(mi.UInt32, places, mi.UInt32(number * apart)))
            dr.eval(sample)
            return sample

        def image(
            self, scene: Any, sensor: Any, straight: StraightHits | None = None
        ) -> tuple[Any, dict[str, Any]]:
            """All channels of a sensor's picture.

            Parameters
            ----------
            scene : mi.Scene
            sensor : mi.Sensor
            straight : StraightHits, optional
                Of the same sensor's picture of the same part, perhaps in other air.

            Returns
            -------
            channels : TensorXf, (c, h, w)
                In the order of ``aov_names()``, the crop window only.
            report : dict
                ``time_s`` per stage, ``counts`` (``open_boundary`` rays,
                ``triangles_in_view`` where shells bend) and ``camera`` of the crop window
                (as of ``iriftrace.Camera.as_dict``), and ``straight`` (StraightHits).
            """
            pixels_of, rays = self.pixel_rays(sensor)
            film, camera = sensor.film(), camera_of(sensor)
            description = camera.description()
            width, height = (int(n) for n in film.crop_size())
            left, top = (int(n) for n in film.crop_offset())
            count = width * height
            near, far = description["focus_mm"]
            bundle = self.trace(
                scene,
                rays,
                count,
                focus=(near, float("inf") if far is None else far),
                coherent=True,
                trace_all=self.trace_all,
                straight=straight,
            )
            started = time.perf_counter()
            trace = bundle.trace
            names = self.aov_names()
            pixels = dr.zeros(mi.Float, len(names) * count)
            status_row = names.index("status.code")
            dr.scatter(pixels, mi.Float(bundle.status), pixels_of + status_row * count)
            dr.eval(pixels)
            counts = {"open_boundary": 0}
            if trace is not None:
                pixel = dr.gather(mi.UInt32, pixels_of, trace.ray)
                for row, (value, exists) in enumerate(self.channel_values(trace, camera)):
                    value = mi.Float(dr.select(exists, value, 0))
                    # Without conflicts, scatters need no kernel each.
                    place = pixel + row * count
                    dr.scatter(pixels, value, place, mode=dr.ReduceMode.NoConflicts)
                dr.eval(pixels)
                counts = self.counts(trace)
            triangles = self.shell_triangles(
                scene, camera, ((left, top), (left + width, top + height))
            )
            if triangles is not None:
                counts["triangles_in_view"] = triangles
            dr.sync_thread()
            report = {
                "time_s": {**bundle.time_s, "channels": time.perf_counter() - started},
                "counts": counts,
                "camera": Camera.from_dict(description).cropped(left, top, width, height).as_dict(),
                "straight": bundle.straight,
            }
            return mi.TensorXf(pixels, (len(names), height, width)), report

        def counts(self, trace: Trace) -> dict[str, int]:
            """Numbers of rays for the report."""
            return {"open_boundary": int(dr.count(trace.open_boundary)[0])}

        def channel_values(self, trace: Trace, camera: Any) -> list[tuple[Any, Any]]:
            """Value of each channel and where it exists, in the order of ``aov_names()``."""
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
