"""Films that our integrators can fill: their size, their pixels, and the camera behind them."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import mitsuba as mi
import psutil

from iriftrace.core.errors import InputError
from iriftrace.core.runtime.variant import cuda_state, current_variant
from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.stock_sensor import StockSensor

BYTES_PER_PIXEL = 170
"""Least memory of a picture: channels, straight rays, their state and the metrics.

Measured where a fifth of the rays hit the part; more hits need more.
"""

MOST_VALUES = 2**32 - 1
"""Entries of one of Dr.Jit's arrays, such as all channels of a picture."""

_LIMIT_OF_CONTAINER = Path("/sys/fs/cgroup/memory.max")


def memory_bytes() -> float:
    """Memory of the GPU (infinite where it does not say), machine or container."""
    if (current_variant() or "").startswith("cuda"):
        return cuda_state().memory_bytes or float("inf")
    installed = float(psutil.virtual_memory().total)
    try:
        # "max" where there is no limit.
        return min(installed, float(_LIMIT_OF_CONTAINER.read_text(encoding="utf-8")))
    except (OSError, ValueError):
        return installed


def check_picture_size(width: int, height: int, channels: int) -> None:
    """Raise InputError for traced pixels and channels beyond memory, or than an array can hold."""
    pixels = width * height
    advice = "lower the resolution or the scale, or crop the film"
    needed, there = BYTES_PER_PIXEL * pixels, memory_bytes()
    if needed > there:
        raise InputError(
            f"A picture of {width} x {height} pixels needs at least {needed:,} bytes of memory, "
            f"but this machine has {int(there):,}; {advice}.",
            code="picture.too_large",
        )
    if channels * pixels > MOST_VALUES:
        raise InputError(
            f"A picture of {width} x {height} pixels has {channels * pixels:,} values in "
            f"{channels} channels ({4 * channels * pixels:,} bytes), but one array holds at most "
            f"{MOST_VALUES:,}; {advice}.",
            code="picture.too_large",
        )


def check_film(film: mi.Film) -> None:
    """Refuse films that would smear or round the channels."""
    text = str(film)
    if film.class_name() != "HDRFilm" or "component_format = float32" not in text:
        raise InputError(
            "The film must be an hdrfilm with component_format float32: half precision (its "
            'default) rounds millimetres to 0.06; add <string name="component_format" '
            'value="float32"/>.',
            code="film.not_float32",
        )
    if not film.rfilter().is_box_filter():
        raise InputError(
            "The film's reconstruction filter mixes neighbouring pixels, so hits and misses would "
            'run into each other; use <rfilter type="box"/>.',
            code="film.filter",
        )


def check_film_size(film: mi.Film, resolution: tuple[int, ...]) -> None:
    """Refuse a film of another size than its sensor's, of which it would show a corner."""
    width, height = map(int, film.size())
    if (width, height) != tuple(resolution):
        raise InputError(
            f"The film was given {width} x {height} px by mi.traverse, but the sensor is of "
            f"{resolution[0]} x {resolution[1]}; change its crop window, or load another sensor "
            "(with optimize=False if the scene has several, as Mitsuba merges equal films).",
            code="film.size",
        )


def refuse_shared_films(sensors: list[mi.Sensor]) -> None:
    """Refuse sensors that share a film: each of them would scale and crop it for the others."""
    for first, second in combinations(sensors, 2):
        if first.film() is second.film():
            raise InputError(
                f"The sensors '{first.id()}' and '{second.id()}' share one film, so that a scale "
                "or crop window of one changes the other's picture. Mitsuba merges equal films by "
                "default: load the scene with optimize=False.",
                code="film.shared",
            )


def camera_of(sensor: dt.Sensor) -> dt.RayCamera:
    """The sensor itself if it gives rays in double precision, else an adapter."""
    return sensor if hasattr(sensor, "rays64") else StockSensor(sensor)
