"""Mitsuba's own sensors, seen as cameras: which of them can be used, and what they project to."""

from __future__ import annotations

import math

import drjit as dr
import mitsuba as mi
import numpy as np

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.plain import JsonObject
from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.kernels.projection import Projection, flip_axes


class StockSensor:
    """A ``perspective`` or ``orthographic`` sensor with the interface of ``calibrated_camera``.

    Rays come from the sensor itself in single precision and start on its near plane, so
    ``path.length`` counts from there. Only ratios of lengths are known of a perspective sensor; its
    sensor is taken to be 1 mm wide. Sensors of other kinds raise InputError.
    """

    def __init__(self, sensor: dt.Sensor) -> None:
        self._sensor = sensor
        kind = sensor.class_name()
        parameters = mi.traverse(sensor)
        width, height = (int(n) for n in sensor.film().size())
        if kind not in ("PerspectiveCamera", "OrthographicCamera"):
            raise InputError(
                f"The sensor is a {kind}, which has no picture plane that can be projected to; use "
                "calibrated_camera, perspective or orthographic.",
                code="camera.no_picture_plane",
            )
        pose = np.array(parameters["to_world"].matrix, dtype=np.float64).reshape(4, 4)
        scale = np.linalg.norm(pose[:3, :3], axis=0)
        pose[:3, :3] /= scale
        if kind == "PerspectiveCamera":
            half = math.tan(math.radians(float(parameters["x_fov"][0])) / 2)
            offset = [float(parameters[f"principal_point_offset_{axis}"][0]) for axis in "xy"]
            camera = Camera(
                focal_length_mm=0.5 / half,
                sensor_mm=(1.0, height / width),
                resolution=(width, height),
                principal_point_px=(
                    width * (0.5 - offset[0]) - 0.5,
                    height * (0.5 - offset[1]) - 0.5,
                ),
                matrix=flip_axes(pose),
            )
        else:
            camera = Camera(
                projection="orthographic",
                sensor_mm=(2 * scale[0], 2 * scale[1] * height / width),
                resolution=(width, height),
                matrix=flip_axes(pose),
            )
        self._camera = camera
        self._projection = Projection(camera)

    def description(self) -> JsonObject:
        """The camera as ``iriftrace.Camera.as_dict`` gives it."""
        return self._camera.as_dict()

    def full_resolution(self) -> tuple[int, ...]:
        """Width and height of the film, px."""
        return self._camera.resolution

    def rays64(self, x: dt.Float64, y: dt.Float64) -> tuple[dt.Point3d, dt.Vector3d]:
        """Origins and directions through image positions, world, mm."""
        film = self._sensor.film()
        size, offset = film.crop_size(), film.crop_offset()
        position = mi.Point2f(mi.Float((x - offset.x) / size.x), mi.Float((y - offset.y) / size.y))
        ray, _ = self._sensor.sample_ray(0.0, 0.5, position, mi.Point2f(0.5))
        return mi.Point3d(ray.o), dr.normalize(mi.Vector3d(ray.d))

    def starts(self) -> FloatArray:
        """Places on the near plane where rays start, (9, 3) array, mm, world, over the picture."""
        film = self._sensor.film()
        size, offset = np.array(film.crop_size()), np.array(film.crop_offset())
        x, y = (offset[:, None] + size[:, None] * np.array((0.0, 0.5, 1.0))).tolist()
        columns, rows = np.meshgrid(x, y)
        origin, _ = self.rays64(mi.Float64(columns.ravel()), mi.Float64(rows.ravel()))
        return np.array(origin).T

    def project64(self, point: dt.Point3d) -> tuple[dt.Float64, dt.Float64, dt.Bool]:
        """Image position in pixels of points of the world, and whether they are in front."""
        return self._projection.project64(point)
