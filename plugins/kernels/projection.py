"""Central and parallel projection in double precision Dr.Jit arrays.

Knows intrinsics and a pose, but no Mitsuba sensor. Camera frame: x right, y down, z forward; pixel
``i`` covers ``[i, i + 1)``. Mitsuba's own camera frame has x left and y up: :func:`flip_axes` is
the one place that converts.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike

from iriftrace.camera.camera import Camera
from iriftrace.camera.distortion import ORDER, distorted, fold_radius, newton_step
from iriftrace.core.arrays import FloatArray
from iriftrace.plugins.kernels import types as dt


def flip_axes(matrix: ArrayLike) -> FloatArray:
    """Camera-to-world matrix from Mitsuba's convention to the camera frame's, and back."""
    return np.asarray(matrix, dtype=np.float64) @ np.diag((-1.0, -1.0, 1.0, 1.0))


class Projection:
    """Rays through a camera's image positions, and image positions of points."""

    def __init__(self, camera: Camera) -> None:
        def opaque(value: float) -> dt.Float64:
            # A literal would become part of the kernel, and every pose would compile again.
            return dr.opaque(mi.Float64, float(value))

        self.orthographic = camera.projection == "orthographic"
        self.right, self.down, self.forward = (
            mi.Vector3d(*(opaque(x) for x in camera.matrix[:3, axis])) for axis in range(3)
        )
        self.origin = mi.Point3d(*(opaque(x) for x in camera.matrix[:3, 3]))
        self.centre_x, self.centre_y = (opaque(x + 0.5) for x in camera.principal_point_px)
        self.pitch_x, self.pitch_y = (
            opaque(size / count)
            for size, count in zip(camera.sensor_mm, camera.resolution, strict=True)
        )
        self.focal_length: dt.Float64 = (
            None if self.orthographic else opaque(camera.focal_length_mm)
        )
        self.coefficients = None
        if camera.distortion is not None:
            self.coefficients = [opaque(value) for value in camera.distortion.coefficients]
            self.rounds = camera.newton_steps
            self.fold_radius = opaque(fold_radius(camera.distortion))

    def attached(
        self, to_world: dt.Array, values: Mapping[str, dt.Float64], scale: tuple[float, float]
    ) -> Projection:
        """The same projection as a function of the pose and numbers that it was made of.

        The pose is in Mitsuba's convention (Matrix4d); `values` are those of `CalibratedCamera`,
        and `scale` is the width and height of the picture over those its principal point is for.
        """
        other = copy(self)
        right, down, forward, origin = (
            [to_world[row, column] for row in range(3)] for column in range(4)
        )
        other.right, other.down = -mi.Vector3d(*right), -mi.Vector3d(*down)
        other.forward, other.origin = mi.Vector3d(*forward), mi.Point3d(*origin)
        other.focal_length = values["focal_length"]
        other.centre_x = values["principal_point_x"] * scale[0]
        other.centre_y = values["principal_point_y"] * scale[1]
        coefficients = [values[name] for name in ORDER]
        if self.coefficients is None and dr.grad_enabled(coefficients):
            # Newton's method starts at the solution: one step is the derivative.
            other.rounds, other.fold_radius = 1, mi.Float64(dr.inf)
        if self.coefficients is not None or dr.grad_enabled(coefficients):
            other.coefficients = coefficients
        return other

    def rays64(self, x: dt.Float64, y: dt.Float64) -> tuple[dt.Point3d, dt.Vector3d]:
        """Origins (Point3d, mm) and unit directions (Vector3d) through image positions, world."""
        across = (x - self.centre_x) * self.pitch_x
        along = (y - self.centre_y) * self.pitch_y
        if self.coefficients is not None:
            across, along = self._undistorted(across, along)
        offset = self.right * across + self.down * along
        if self.orthographic:
            return self.origin + offset, self.forward + 0 * offset
        return self.origin + 0 * offset, dr.normalize(offset + self.forward * self.focal_length)

    def _undistorted(self, across: dt.Float64, along: dt.Float64) -> tuple[dt.Float64, dt.Float64]:
        """Places on the sensor (mm from the axis) without distortion; NaN where nothing is seen."""
        seen_x, seen_y = across / self.focal_length, along / self.focal_length
        x, y = seen_x, seen_y
        for _ in range(self.rounds):
            x, y = newton_step(x, y, seen_x, seen_y, self.coefficients)
        at_x, at_y = distorted(x, y, self.coefficients)
        radius = dr.sqrt(x * x + y * y)
        off = dr.sqrt(dr.square(at_x - seen_x) + dr.square(at_y - seen_y))
        # The camera has refused pictures with such positions; this is for positions outside them.
        right = (off < 1e-14 * (1 + radius)) & (radius < self.fold_radius)
        factor = dr.select(right, self.focal_length, dr.nan)
        return x * factor, y * factor

    def project64(self, point: dt.Point3d) -> tuple[dt.Float64, dt.Float64, dt.Bool]:
        """Image position (Float64, px) of points (Point3d, mm, world), and if it means anything.

        It does (Bool) before the pinhole, and not so far outside the picture that the lens
        distortion turns back; always for parallel projection.
        """
        local = point - self.origin
        across, along = dr.dot(local, self.right), dr.dot(local, self.down)
        in_front = mi.Bool(True)
        if not self.orthographic:
            depth = dr.dot(local, self.forward)
            in_front = depth > 0
            if self.coefficients is None:
                magnification = self.focal_length / depth
                across, along = across * magnification, along * magnification
            else:
                across, along = across / depth, along / depth
                in_front &= across * across + along * along < dr.square(self.fold_radius)
                across, along = (
                    seen * self.focal_length for seen in distorted(across, along, self.coefficients)
                )
        x, y = across / self.pitch_x + self.centre_x, along / self.pitch_y + self.centre_y
        return x, y, in_front
