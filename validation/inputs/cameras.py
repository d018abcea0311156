"""A small camera at a place, as most tests need one."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from iriftrace.camera.camera import Camera
from iriftrace.camera.pose import look_at


def camera_at(
    origin: ArrayLike = (0.0, -100.0, 0.0),
    target: ArrayLike = (0.0, 0.0, 0.0),
    *,
    up: ArrayLike = (0.0, 0.0, 1.0),
    focal_length_mm: float = 10.0,
    sensor_mm: tuple[float, float] = (6.0, 5.0),
    resolution: tuple[int, int] = (48, 40),
    **more: Any,
) -> Camera:
    """A camera that looks from one point at another, mm, world; `more` is for `Camera`."""
    return Camera(
        focal_length_mm=focal_length_mm,
        sensor_mm=sensor_mm,
        resolution=resolution,
        matrix=look_at(origin, target, up),
        **more,
    )
