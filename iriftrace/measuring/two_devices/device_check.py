"""Comparison of a measured cloud with the devices that should have measured it.

A measured point is where straight lines of both devices meet. So the camera's projection of it is
its own pixel, whatever the air does, and both devices can see it. A cloud in another frame than the
scene's, or devices elsewhere than in the scene, contradict that. Without the pixels, a cloud that
was moved along the part's surface and stays in both pictures does not.
"""

from __future__ import annotations

import numpy as np
from attrs import frozen
from numpy.typing import ArrayLike

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.core.mesh.triangles import row_lengths, unit_vectors
from iriftrace.measuring.two_devices.correction_status import CorrectionStatus
from iriftrace.measuring.two_devices.devices import Sensor
from iriftrace.tracing.rays import traced_as_chosen
from iriftrace.tracing.scene import Scene

MANY = 0.05
"""Fraction of points, hidden or far from the part, that edges and silhouettes do not explain."""

MOST_PX = 1.0
"""Largest median distance of points from their pixels.

It is 0 but for noise and for half of the gap between two cameras' lines, which are tenths of a
pixel. Where whole numbers are corners of pixels instead of centres it is 0.71 px.
"""

RESIZED = 0.1
"""Relative difference in size from which on pixels can be those of a resized picture."""

SAMPLE = 10_000
"""Number of points that are compared."""


@frozen
class DeviceCheck:
    """Agreement of measured points on the part with the devices of a scene.

    Attributes
    ----------
    unseen : float
        Fraction that is hidden from a device, behind it or outside its picture.
    to_hit_mm : float or None
        Median distance of the points from where the straight rays of their pixels hit the part;
        infinite if most of these miss it, None if few points are `unseen`.
    off : (float, float) or None
        Median distance of the points' projections from their pixels, px, and the same at the
        points, mm; None without pixels.
    resolution : (int, int)
        Of the camera's picture, px.
    """

    unseen: float
    to_hit_mm: float | None
    off: tuple[float, float] | None
    resolution: tuple[int, int]

    @property
    def warning(self) -> str:
        """What contradicts the devices, and what to check; "" if nothing does."""
        text = []
        if self.off is not None and self.off[0] > MOST_PX:
            pixels, millimetres = self.off
            width, height = self.resolution
            text.append(
                f"The points lie {pixels:.3g} px ({millimetres:.3g} mm, medians) from their pixels "
                f"in the camera's picture of {width} x {height} pixels."
            )
        if self.to_hit_mm is not None:
            hits = "miss the part"
            if np.isfinite(self.to_hit_mm):
                hits = f"hit the part {round(self.to_hit_mm, 4):.2g} mm from the points (median)"
            text.append(
                f"{self.unseen:.0%} of the points are hidden from one of the scene's devices or "
                f"lie outside its picture; the straight rays of the points' pixels {hits}."
            )
        if text:
            text.append(
                "The scene's devices cannot have measured them there, so they are corrected for "
                "other lines of sight: check the motion of the cloud to the scene's frame, and "
                "the poses and pixels of the scene's devices."
            )
        return " ".join(text)


def checked_pixels(pixels: ArrayLike, count: int) -> FloatArray:
    """The pixels (n, 2) of `count` points; an InputError if they are not as many."""
    places = np.asarray(pixels, dtype=np.float64)
    if places.shape != (count, 2):
        raise InputError(
            f"The pixels are an array of shape {places.shape}, but there are {count:,} points; "
            "give the column and row of the camera's picture for each, (n, 2).",
            code="pixels.shape",
        )
    return places


def check_devices(
    points: FloatArray,
    status: IntArray,
    scene: Scene,
    sensor: Sensor,
    pixels: FloatArray | None = None,
) -> DeviceCheck:
    """Compare measured points that are not far from the part, or a sample, with the devices.

    Parameters
    ----------
    points : (n, 3) array, mm, world
    status : (n,) array of `CorrectionStatus`
        Not all are far from the part.
    scene : Scene
    sensor : Sensor
    pixels : (n, 2) array, px, optional
        Where the camera saw the points; rows that are not finite are left out.
    """
    rows = np.flatnonzero(status != CorrectionStatus.FAR_FROM_PART)
    rows = np.random.default_rng(0).choice(rows, min(len(rows), SAMPLE), replace=False)
    points, camera = points[rows], sensor.camera
    unseen = status[rows] == CorrectionStatus.HIDDEN
    # The lines of a laser whose sheet is turned do not lie in one picture.
    for device in sensor.devices[: 1 if sensor.system == "laser" else 2]:
        with np.errstate(invalid="ignore"):
            unseen |= ~device.holds(device.project(points))
    fraction = float(unseen.mean())
    return DeviceCheck(
        unseen=fraction,
        to_hit_mm=_to_hit(points, scene, camera) if fraction > MANY else None,
        off=None if pixels is None else _off(points, pixels[rows], camera),
        resolution=camera.resolution,
    )


def _to_hit(points: FloatArray, scene: Scene, camera: Camera) -> float:
    """`DeviceCheck.to_hit_mm` of points (n, 3)."""
    origin = np.broadcast_to(camera.origin, points.shape)
    # Straight rays are the same in the air of all members.
    one_field = next(scene.alone())
    hits = traced_as_chosen(one_field, origin, unit_vectors(points - origin))
    distance = row_lengths(hits.straight - points[hits.ray])
    return float(np.median(np.where(np.isfinite(distance), distance, np.inf)))


def _off(points: FloatArray, pixels: FloatArray, camera: Camera) -> tuple[float, float] | None:
    """`DeviceCheck.off` of points (n, 3) with pixels (n, 2); None if no pair is finite."""
    with np.errstate(invalid="ignore"):
        projected = camera.project(points)
        offset = projected - pixels
    known = np.isfinite(offset).all(axis=1)
    if not known.any():
        return None
    # A smaller or larger picture, as by a scene's parameter ``scale``, has the same lines of sight;
    # half a pixel lies between its corner and the centre of its first pixel.
    ratio = np.median((pixels[known] + 0.5) / (projected[known] + 0.5))
    scaled = projected - ((pixels + 0.5) / ratio - 0.5)
    if abs(ratio - 1.0) > RESIZED and ratio * np.median(row_lengths(scaled[known])) < MOST_PX:
        offset = scaled
    depth = camera.to_camera(points[known])[:, 2]
    at_point = row_lengths(offset[known] * camera.pixel_pitch_mm) * depth / camera.focal_length_mm
    return float(np.median(row_lengths(offset[known]))), float(np.median(at_point))
