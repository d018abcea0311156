"""A picture's rays, tile by tile, and the values of its channels."""

from __future__ import annotations

from functools import lru_cache

import drjit as dr
import mitsuba as mi

from iriftrace.camera.tiles import pixels_in_tiles
from iriftrace.plugins.film import camera_of, check_film, check_film_size, check_picture_size
from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.kernels.bundle import StraightHits, Trace
from iriftrace.plugins.kernels.queries import HIT_PART


class PixelRays:
    """Rays through the centres of the pixels of a sensor's crop window, in tiles.

    Called with their places in that order (UInt32), it gives origins (Point3d, mm) and unit
    directions (Vector3d). An InputError if the film would smear the channels, or the picture is
    larger than memory.

    `numbers` are the row-major numbers of the pixels in that order (UInt32), `camera` is the sensor
    as a camera that gives rays in double precision, `corner` the first column and row of the window
    and `size` its width and height, px.
    """

    def __init__(self, sensor: mi.Sensor, channels: int) -> None:
        film = sensor.film()
        check_film(film)
        width, height = (int(n) for n in film.crop_size())
        check_picture_size(width, height, channels)
        left, top = (int(n) for n in film.crop_offset())
        self.camera = camera_of(sensor)
        check_film_size(film, self.camera.description()["resolution"])
        self.corner, self.size = (left, top), (width, height)
        self.numbers = _tiles(width, height, mi.variant())
        self._columns = dr.opaque(mi.UInt32, width)

    def __len__(self) -> int:
        return self.size[0] * self.size[1]

    def __call__(self, place: dt.UInt32) -> tuple[dt.Point3d, dt.Vector3d]:
        pixel = dr.gather(mi.UInt32, self.numbers, place)
        x = mi.Float64(pixel % self._columns) + (self.corner[0] + 0.5)
        y = mi.Float64(pixel // self._columns) + (self.corner[1] + 0.5)
        origin, direction = self.camera.rays64(x, y)
        return origin, direction


@lru_cache(maxsize=2)
def _tiles(width: int, height: int, variant: str) -> dt.UInt32:
    """Row-major numbers of a picture's pixels, tile by tile, on the variant's device."""
    return mi.UInt32(pixels_in_tiles(width, height))


def sharp_rays(
    rays: PixelRays, straight: StraightHits, most: int
) -> tuple[dt.Point3d, dt.Vector3d] | None:
    """Rays whose straight hits are on the part, in focus: a sample of `most` of them.

    Origins (Point3d, mm) and unit directions (Vector3d); None if there are none.
    """
    near, far = rays.camera.description()["focus_mm"]
    sharp = (straight.outcome == HIT_PART) & (straight.distance >= dr.opaque(mi.Float64, near))
    if far is not None:
        sharp &= straight.distance <= dr.opaque(mi.Float64, far)
    places = dr.compress(sharp)
    there = dr.width(places)
    if there == 0:
        return None
    number = mi.Float64(dr.arange(mi.UInt32, min(most, there)))
    apart = dr.opaque(mi.Float64, max(there / most, 1.0))
    sample = rays(dr.gather(mi.UInt32, places, mi.UInt32(number * apart)))
    dr.eval(sample)
    return sample


def channel_values(trace: Trace, camera: dt.RayCamera) -> list[tuple[dt.Array, dt.Bool]]:
    """Value of each channel of `iriftrace.image.aov_image.CHANNELS`, and where it exists."""
    straight_hit = trace.straight_outcome == HIT_PART
    bent_hit = trace.refracted.outcome == HIT_PART
    both = straight_hit & bent_hit
    point = trace.refracted.point
    displacement, shift = trace.displacement, trace.shift_px(camera)
    always = mi.Bool(True)
    return [
        *((value, straight_hit) for value in trace.straight),
        *((value, bent_hit) for value in point),
        *((value, both) for value in displacement),
        (dr.norm(displacement), both),
        *((value, bent_hit) for value in shift),
        (trace.incidence, straight_hit),
        (trace.refracted.path_length, bent_hit),
        (trace.refracted.crossings, always),
        (trace.straight_face + 1, straight_hit),
        (trace.status, always),
    ]


def written(
    rays: PixelRays,
    names: list[str],
    status: dt.UInt32,
    traced: dt.UInt32 | None,
    values: list[tuple[dt.Array, dt.Bool]],
) -> dt.Float:
    """All channels of a picture, (c * h * w,) Float.

    The status of every pixel; the values of the rays that were traced on, given by their places
    (UInt32), where they exist, and 0 elsewhere.
    """
    count = len(rays)
    pixels = dr.zeros(mi.Float, len(names) * count)
    dr.scatter(pixels, mi.Float(status), rays.numbers + names.index("status.code") * count)
    dr.eval(pixels)
    if traced is not None:
        pixel = dr.gather(mi.UInt32, rays.numbers, traced)
        for row, (value, exists) in enumerate(values):
            value = mi.Float(dr.select(exists, value, 0))
            # Without conflicts, scatters need no kernel each.
            dr.scatter(pixels, value, pixel + row * count, mode=dr.ReduceMode.NoConflicts)
        dr.eval(pixels)
    return pixels
