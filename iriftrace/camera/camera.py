"""The camera a user describes: intrinsics, focus interval and pose, in plain NumPy.

Frame of the camera: x right, y down, z forward. Image positions count as in OpenCV: the centre of
the first pixel is (0, 0), so pixel ``i`` covers ``[i - 0.5, i + 0.5)``. Mitsuba's film counts from
the pixel's edge, 0.5 more; the plugins add it.

With lens distortion image positions are converted to those of a pinhole camera and back by
`iriftrace.camera.distortion`; without it nothing is converted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from attrs import evolve, field, frozen
from numpy.typing import ArrayLike

from iriftrace.camera.distortion import (
    Distortion,
    distorted,
    fold_radius,
    newton_steps,
    undistorted,
)
from iriftrace.camera.pose_set import fixed
from iriftrace.camera.tiles import within
from iriftrace.core.arrays import BoolArray, FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.mesh.triangles import unit_vectors
from iriftrace.core.plain import JsonObject

PROJECTIONS = ("pinhole", "orthographic")


def _pair(value: Sequence[float]) -> tuple[float, float]:
    first, second = value
    return float(first), float(second)


def _distortion(value: Distortion | None) -> Distortion | None:
    # No distortion has one form only, so that it costs nothing and changes no bit.
    return None if value is None or value.vanishes else value


def _resolution(value: Sequence[int]) -> tuple[int, int]:
    width, height = value
    return int(width), int(height)


@frozen(eq=False, kw_only=True)
class Camera:
    """Intrinsics, focus interval and pose of one camera.

    Parameters
    ----------
    focal_length_mm : float, mm
        Distance from the pinhole to the sensor. Not used by an orthographic camera.
    sensor_mm : (2,) sequence, mm
        Width and height of the sensor; of the field of view for an orthographic camera.
    resolution : (2,) sequence of int
        Pixels across and down, which need not be square.
    principal_point_px : (2,) sequence, px, optional
        Where the optical axis meets the sensor, as OpenCV's ``cx, cy``: the centre of the first
        pixel is (0, 0). The sensor's centre by default.
    focus_mm : (2,) sequence, mm
        Nearest and farthest distance along the ray at which the picture is sharp.
    matrix : (4, 4) array
        Camera to world; x right, y down, z forward.
    projection : str
        ``"pinhole"`` or ``"orthographic"``.
    distortion : Distortion, optional
        Of the lens, for a pinhole camera; none by default. Only the ratio of focal length and pixel
        pitch counts, so that a calibration in pixels is complete but for lengths in mm.

    Raises
    ------
    InputError
        If a length is not positive, the focus interval is empty, the pose is not a rigid motion or
        the distortion folds the picture.
    """

    focal_length_mm: float = field(default=math.nan, converter=float)
    sensor_mm: tuple[float, float] = field(converter=_pair)
    resolution: tuple[int, int] = field(converter=_resolution)
    principal_point_px: tuple[float, float] = field(default=None)
    focus_mm: tuple[float, float] = field(default=(0.0, math.inf), converter=_pair)
    matrix: FloatArray = field(factory=lambda: np.eye(4), converter=fixed)
    projection: str = "pinhole"
    distortion: Distortion | None = field(default=None, converter=_distortion)

    def __attrs_post_init__(self) -> None:
        point = self.principal_point_px
        if point is None:
            point = ((self.resolution[0] - 1) / 2, (self.resolution[1] - 1) / 2)
        object.__setattr__(self, "principal_point_px", _pair(point))
        self._check()
        if self.distortion is not None:
            _ = self.newton_steps  # refuses a picture that the lens folds

    def _check(self) -> None:
        """Refuse a camera that cannot form a picture."""
        focal, pinhole = self.focal_length_mm, self.projection == "pinhole"
        (width, height), (near, far) = self.sensor_mm, self.focus_mm
        if self.projection not in PROJECTIONS:
            raise InputError(
                f"Unknown projection '{self.projection}'; use one of {PROJECTIONS}.",
                code="camera.unknown_projection",
            )
        if pinhole and not 0 < focal < math.inf:
            raise InputError(
                f"Focal length is {focal} mm, so no picture forms; give a positive length.",
                code="camera.focal_length_not_positive",
                argument="focal_length",
            )
        if not (0 < width < math.inf and 0 < height < math.inf):
            raise InputError(
                f"Sensor size is {width} x {height} mm, so no picture forms; make both positive.",
                code="camera.sensor_not_positive",
                argument="sensor",
            )
        if min(self.resolution) < 1:
            raise InputError(
                f"Resolution is {self.resolution[0]} x {self.resolution[1]} pixels; both must be "
                "at least 1.",
                code="camera.no_pixels",
                argument="resolution",
            )
        if not 0 <= near < far:
            raise InputError(
                f"Focus interval {near} to {far} mm is empty; the near distance must be at least 0 "
                "and smaller than the far one.",
                code="camera.focus_empty",
                argument="focus",
            )
        matrix = self.matrix
        rotation = matrix[:3, :3] if matrix.shape == (4, 4) else np.zeros((3, 3))
        rigid = np.allclose(rotation.T @ rotation, np.eye(3), atol=1e-6)
        if not (rigid and np.linalg.det(rotation) > 0 and np.isfinite(matrix).all()):
            raise InputError(
                "The camera pose is not a rigid motion (4 x 4, rotation and translation only); "
                "remove scale and mirroring.",
                code="poses.not_rigid",
            )
        if self.distortion is not None and not pinhole:
            raise InputError(
                f"A lens distortion is given for an {self.projection} camera, for which it is not "
                "defined; leave it out.",
                code="camera.distortion_without_lens",
                argument="distortion",
            )

    @property
    def lens(self) -> str:
        """Assumption about the rays in the camera, in words."""
        if self.distortion is None:
            return f"{self.projection}, no lens distortion"
        return f"distorted: pinhole with Brown-Conrady lens distortion {self.distortion}"

    @property
    def origin(self) -> FloatArray:
        """(3,) array, mm, world: the pinhole."""
        return self.matrix[:3, 3]

    @property
    def forward(self) -> FloatArray:
        """(3,) unit vector, world: the optical axis."""
        return self.matrix[:3, 2]

    @property
    def pixel_pitch_mm(self) -> tuple[float, float]:
        """Width and height of one pixel on the sensor, mm."""
        return self.sensor_mm[0] / self.resolution[0], self.sensor_mm[1] / self.resolution[1]

    @property
    def focal_px(self) -> tuple[float, float]:
        """Focal length in pixel widths and heights."""
        width, height = self.pixel_pitch_mm
        return self.focal_length_mm / width, self.focal_length_mm / height

    @property
    def newton_steps(self) -> int:
        """Newton steps that suffice to undistort each position of the picture.

        Raises InputError if a position in the picture has no line of sight, because the distortion
        turns back before it.
        """
        assert self.distortion is not None
        ends = self._normalised(self.corners[[0, 2]])
        upper_left, lower_right = (tuple(end) for end in ends.tolist())
        steps = newton_steps(self.distortion, upper_left, lower_right)
        if steps is None:
            width, height = self.resolution
            raise InputError(
                f"The lens distortion ({self.distortion}) turns back inside the picture of {width} "
                f"x {height} pixels, so that some pixels have no line of sight or two; crop the "
                "picture to what the calibration covered, or calibrate with fewer coefficients.",
                code="camera.distortion_folds",
            )
        return steps

    @property
    def corners(self) -> FloatArray:
        """(4, 2) outer corners of the picture, px, clockwise from the upper left one."""
        x, y = self.resolution
        return np.array(((0, 0), (x, 0), (x, y), (0, y)), dtype=np.float64) - 0.5

    def holds(self, places: ArrayLike) -> BoolArray:
        """(n,) mask of the image positions (n, 2), px, that lie in the picture; of NaN False."""
        return within(np.asarray(places), *self.corners[[0, 2]])

    def _pixel_centres(self) -> FloatArray:
        """(n, 2) centres of all pixels, px, row by row."""
        columns, rows = np.meshgrid(*(np.arange(n, dtype=np.float64) for n in self.resolution))
        return np.stack((columns.ravel(), rows.ravel()), axis=1)

    def _normalised(self, pixels: FloatArray) -> FloatArray:
        """(n, 2) image positions, px, as x/z and y/z of the distorted picture."""
        on_sensor: FloatArray = (pixels - self.principal_point_px) * self.pixel_pitch_mm
        return on_sensor / self.focal_length_mm

    @property
    def pixel_area_mm2(self) -> float:
        """Area of one pixel on the sensor, mm^2 (on the object, for an orthographic camera)."""
        return self.pixel_pitch_mm[0] * self.pixel_pitch_mm[1]

    def at(self, matrix: ArrayLike) -> Camera:
        """The same camera at another pose ((4, 4) array, camera to world)."""
        return evolve(self, matrix=matrix)

    def check_movable(self) -> None:
        """Refuse a camera of parallel rays, which no plugin of ours renders in another pose."""
        if self.projection == "orthographic":
            raise InputError(
                "The camera is orthographic: it can be rendered where its scene has it, but not "
                "moved or given other pixels; use calibrated_camera or perspective.",
                code="camera.orthographic",
            )

    def scaled(self, scale: float) -> Camera:
        """The same camera with ``scale`` times the pixels across and down (rounded, at least 1)."""
        if not (math.isfinite(scale) and scale > 0):
            raise InputError(
                f"scale is {scale}, so no pixel is left; give a positive number.",
                code="camera.no_pixels",
                argument="scale",
            )
        (width, height), (x, y) = self.resolution, self.principal_point_px
        resolution = max(1, round(width * scale)), max(1, round(height * scale))
        if max(resolution) >= 2**31:  # Mitsuba counts them in 32 bits
            raise InputError(
                f"scale is {scale:g}: over 2^31 pixels a side; give a smaller one.",
                code="camera.too_many_pixels",
                argument="scale",
            )
        point = (
            (x + 0.5) * resolution[0] / width - 0.5,
            (y + 0.5) * resolution[1] / height - 0.5,
        )
        return evolve(self, resolution=resolution, principal_point_px=point)

    def cropped(self, left: int, top: int, width: int, height: int) -> Camera:
        """The camera that sees a window of the picture, given by its first pixel and its size."""
        pitch_x, pitch_y = self.pixel_pitch_mm
        x, y = self.principal_point_px
        return evolve(
            self,
            sensor_mm=(width * pitch_x, height * pitch_y),
            resolution=(width, height),
            principal_point_px=(x - left, y - top),
        )

    def rays(self, pixels: ArrayLike | None = None) -> tuple[FloatArray, FloatArray]:
        """Rays through image positions.

        Parameters
        ----------
        pixels : (n, 2) array, px, optional
            Positions in the picture, a pixel's centre at whole numbers; by default every
            pixel's centre, row by row.

        Returns
        -------
        origins, directions : (n, 3) arrays, mm and unit vectors, world
        """
        if pixels is None:
            position = self._pixel_centres()
        else:
            position = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
        on_sensor = self._without_distortion(position)
        rotation = self.matrix[:3, :3]
        if self.projection == "orthographic":
            origins = on_sensor @ rotation[:, :2].T + self.origin
            return origins, np.broadcast_to(self.forward, origins.shape).copy()
        local = np.full((len(on_sensor), 3), self.focal_length_mm)
        local[:, :2] = on_sensor
        # Not by BLAS, as in `to_camera`.
        directions = np.asarray(np.einsum("ij,kj->ik", unit_vectors(local), rotation))
        return np.broadcast_to(self.origin, directions.shape).copy(), directions

    def _without_distortion(self, position: FloatArray) -> FloatArray:
        """(n, 2) places on the sensor, mm from the axis, where a pinhole camera would see them."""
        if self.distortion is None:
            return (position - self.principal_point_px) * self.pixel_pitch_mm
        found = undistorted(self._normalised(position), self.distortion)
        lost = np.flatnonzero(np.isnan(found[:, 0]))
        if len(lost):
            x, y = position[lost[0]]
            raise InputError(
                f"Image position ({x:g}, {y:g}) px has no line of sight: the lens distortion turns "
                "back before it; stay inside the picture.",
                code="camera.no_line_of_sight",
            )
        return found * self.focal_length_mm

    def to_camera(self, points: ArrayLike) -> FloatArray:
        """(n, 3) points from the world's frame to the camera's, mm."""
        offset = np.asarray(points, dtype=np.float64) - self.origin
        # Not by BLAS, whose threads wait for cores that the tracer's own threads still hold.
        return np.asarray(np.einsum("ij,jk->ik", offset, self.matrix[:3, :3]))

    def project(self, points: ArrayLike) -> FloatArray:
        """Image positions of world points.

        Parameters
        ----------
        points : (n, 3) array, mm, world

        Returns
        -------
        (n, 2) array, px
            The centre of the first pixel is (0, 0). NaN for points that are not in front of a
            pinhole camera, or so far outside the picture that the distortion is not defined.
        """
        local = self.to_camera(points)
        if self.projection == "orthographic":
            on_sensor = local[:, :2]
        elif self.distortion is None:
            depth = np.where(local[:, 2:] > 0, local[:, 2:], np.nan)
            on_sensor = local[:, :2] / depth * self.focal_length_mm
        else:
            depth = np.where(local[:, 2] > 0, local[:, 2], np.nan)
            x, y = local[:, 0] / depth, local[:, 1] / depth
            places = np.stack(distorted(x, y, self.distortion.coefficients), axis=1)
            places[~(np.hypot(x, y) < fold_radius(self.distortion))] = np.nan
            on_sensor = places * self.focal_length_mm
        return on_sensor / self.pixel_pitch_mm + self.principal_point_px

    def as_dict(self) -> JsonObject:
        """Plain values for JSON; an unlimited far focus is None."""
        near, far = self.focus_mm
        pinhole = self.projection == "pinhole"
        return {
            "projection": self.projection,
            "focal_length_mm": self.focal_length_mm if pinhole else None,
            "sensor_mm": list(self.sensor_mm),
            "resolution": list(self.resolution),
            "principal_point_px": list(self.principal_point_px),
            "focus_mm": [near, far if math.isfinite(far) else None],
            "matrix": self.matrix.tolist(),
            "distortion": None if self.distortion is None else self.distortion.as_dict(),
        }

    @classmethod
    def from_dict(cls, values: JsonObject) -> Camera:
        """Inverse of :meth:`as_dict`; an InputError for values of a damaged file."""
        try:
            near, far = values["focus_mm"]
            focal = values["focal_length_mm"]
            distortion = values["distortion"]
            return cls(
                projection=values["projection"],
                focal_length_mm=math.nan if focal is None else focal,
                sensor_mm=values["sensor_mm"],
                resolution=values["resolution"],
                principal_point_px=values["principal_point_px"],
                focus_mm=(near, math.inf if far is None else far),
                matrix=values["matrix"],
                distortion=None if distortion is None else Distortion(**distortion),
            )
        except InputError:
            raise
        except (ValueError, TypeError, LookupError, AttributeError, OverflowError) as error:
            raise InputError(
                f"The camera in the file has missing or misspelt entries ({error}); write the file "
                "again.",
                code="camera.damaged_entries",
            ) from error
