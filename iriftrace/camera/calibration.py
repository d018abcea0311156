"""Camera calibrations: lenses in pixels, poses, and how two cameras stand to each other.

Calibrations know lengths in pixels only: a focal length of 3650 px is that of a 10 mm lens before
pixels of 2.74 um as well as of any other with the same ratio. All rays are the same; only the size
of a pixel turns them into the focal length and the sensor's size that results state.
"""

from __future__ import annotations

import math

import numpy as np
from attrs import evolve, frozen
from numpy.typing import ArrayLike

from iriftrace.camera.camera import Camera
from iriftrace.camera.distortion import Distortion
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, warn

LARGEST_PIXEL_MM = 0.5
"""Larger than for any camera; a number of this size is in micrometres."""


@frozen(eq=False, kw_only=True)
class Calibration:
    """Camera as a calibration describes it.

    Attributes
    ----------
    focal_px : (2,) float, px
        Focal length in pixel widths and heights.
    centre_px : (2,) float, px
        Principal point as OpenCV counts: the first pixel's centre is (0, 0).
    resolution : (2,) int
        Pixels across and down of the pictures that were calibrated with.
    distortion : Distortion
    matrix : (4, 4) array or None
        Camera to world, mm, where the calibration has one pose.
    views : int
        Poses of a calibration board; the camera's own pose is known only from one.
    """

    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    resolution: tuple[int, int]
    distortion: Distortion
    matrix: FloatArray | None = None
    views: int = 0

    def camera(
        self,
        *,
        pixel_size_mm: float,
        focus_mm: tuple[float, float] = (0.0, math.inf),
        matrix: ArrayLike | None = None,
    ) -> Camera:
        """The calibrated camera.

        Parameters
        ----------
        pixel_size_mm : float, mm
            Width of a pixel. Its height follows from the two focal lengths, which belong to one
            lens.
        focus_mm, matrix
            As in :class:`iriftrace.camera.camera.Camera`; by default the calibration's own pose, or
            that of the world's axes, with a warning, if it has none.
        """
        if not 0 < pixel_size_mm < LARGEST_PIXEL_MM:
            raise InputError(
                f"Pixel size is {pixel_size_mm:g} mm; give the width of a pixel, such as "
                "0.00274 mm.",
                code="calibration.pixel_size",
                argument="pixel_size",
            )
        pose = self.matrix if matrix is None else matrix
        if pose is None:
            warn(
                "The calibration has no pose, so its camera is at (0, 0, 0), along +z; give matrix."
            )
        across, down = self.focal_px
        width, height = self.resolution
        return Camera(
            focal_length_mm=across * pixel_size_mm,
            sensor_mm=(width * pixel_size_mm, height * pixel_size_mm * across / down),
            resolution=self.resolution,
            principal_point_px=self.centre_px,
            distortion=self.distortion,
            focus_mm=focus_mm,
            matrix=np.eye(4) if pose is None else pose,
        )


@frozen(eq=False, kw_only=True)
class StereoCalibration:
    """Two calibrated cameras, and how the second one stands to the first.

    Attributes
    ----------
    first, second : Calibration
        Without poses.
    rotation : (3, 3) array
        From the frame of camera 1 to that of camera 2, as ``R`` of OpenCV's stereoCalibrate.
    translation_mm : (3,) array, mm
        ``T`` of stereoCalibrate.
    length_unit : str
        Unit in which T was read.
    """

    first: Calibration
    second: Calibration
    rotation: FloatArray
    translation_mm: FloatArray
    length_unit: str

    @property
    def baseline_mm(self) -> float:
        """Distance of the two cameras, mm."""
        return float(np.linalg.norm(self.translation_mm))

    @property
    def angle_deg(self) -> float:
        """Angle between the axes of the two cameras, degrees."""
        return float(np.degrees(np.arccos(np.clip(self.rotation[2, 2], -1.0, 1.0))))

    @property
    def side(self) -> str:
        """Where camera 2 stands, such as "to the right of", as camera 1 sees it."""
        centre = -self.rotation.T @ self.translation_mm
        axis = int(np.abs(centre).argmax())
        sides = ("to the left of", "to the right of"), ("above", "below"), ("behind", "in front of")
        return sides[axis][int(centre[axis] > 0.0)]

    def placed(self, matrix: FloatArray) -> tuple[Calibration, Calibration]:
        """Both calibrations with their poses, where camera 1 has the pose (4, 4), to world, mm."""
        rotation = matrix[:3, :3].T
        translation = -rotation @ matrix[:3, 3]
        second = to_world(
            self.rotation @ rotation, self.rotation @ translation + self.translation_mm
        )
        return (
            evolve(self.first, matrix=to_world(rotation, translation)),
            evolve(self.second, matrix=second),
        )


def to_world(rotation: FloatArray, translation: FloatArray) -> FloatArray:
    """Camera to world, (4, 4), of the rotation (3, 3) and translation (3,) world to camera."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation.T
    matrix[:3, 3] = -rotation.T @ translation
    return matrix
