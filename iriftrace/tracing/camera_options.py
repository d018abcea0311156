"""Options of a scene's camera, for Python and for commands, and the camera that they describe."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from attrs import field, frozen
from attrs.converters import optional

from iriftrace.core.errors import InputError, changed, refuse_given, warn
from iriftrace.core.number_lists import Interval, Numbers, Pair, Size, Vector
from iriftrace.core.units import Length

if TYPE_CHECKING:
    from iriftrace.camera.calibration import Calibration
    from iriftrace.camera.camera import Camera
    from iriftrace.medium.index_field import IndexField
    from iriftrace.medium.shells.stack import ShellStack
    from iriftrace.part.part import Part


FEWEST_PIXELS = 10
"""Minimum number of pixels across the whole part for a measurement."""


@frozen
class CameraOptions:
    """The camera; by default the one of Kern et al. (2025), looking from diagonally above.

    Parameters
    ----------
    focal_length
        Distance from pinhole to sensor.
    sensor
        Width and height of the sensor, "6.7 mm,5.6 mm".
    resolution
        Pixels across and down, "2448,2048".
    principal_point
        Point where the axis meets the sensor, in pixels as OpenCV counts them, from the centre of
        the first one, "1223.5,1023.5".
    distortion
        Lens distortion in OpenCV's order k1,k2,p1,p2[,k3[,k4,k5,k6]].
    calibration
        Calibration of OpenCV, ROS, Kalibr or MATLAB (.yaml, .xml or .json) instead of focal length,
        sensor, resolution, principal point and distortion; its pose, if it has one, is used unless
        origin or target is given.
    pixel_size
        Width of a pixel, "2.74 um". A calibration, which is in pixels only, needs it for the
        lengths in mm that results state; no ray depends on it.
    calibration_length_unit
        Unit of the translation in the calibration, mm by default; for a stereo calibration the
        unit that the file states, and m for ROS and Kalibr.
    focus
        Nearest and farthest sharp distance NEAR:FAR, mm, outside which rays count as out of focus.
        By default there is no limit.
    origin
        Camera position in mm, "150,-100,120"; by default diagonally above, outside the hot air,
        beyond the near end of the focus, and so far that the picture shows the whole part.
    target
        Point that the camera looks at; by default the part's centre.
    up
        Direction that is up in the picture.
    pose
        File with poses, as ``iriftrace plan`` saves them; the first one is the camera's, and a
        second device moves with it as on a rigid frame.
    """

    focal_length: Length = field(default=Length(10.0), converter=Length)
    sensor: Size = field(default=Size((6.7, 5.6)), converter=Size)
    resolution: Pair = field(default=Pair((2448.0, 2048.0)), converter=Pair)
    principal_point: Pair | None = field(default=None, converter=optional(Pair))
    distortion: Numbers | None = field(default=None, converter=optional(Numbers))
    calibration: Path | None = None
    pixel_size: Length | None = field(default=None, converter=optional(Length))
    calibration_length_unit: str | None = None
    focus: Interval = field(default=Interval((0.0, math.inf)), converter=Interval)
    origin: Vector | None = field(default=None, converter=optional(Vector))
    target: Vector | None = field(default=None, converter=optional(Vector))
    up: Vector = field(default=Vector((0.0, 0.0, 1.0)), converter=Vector)
    pose: Path | None = None

    def __attrs_post_init__(self) -> None:
        if self.calibration is not None:
            self.refuse_intrinsics()
        if self.pose is not None:
            reason = f"is given, but {self.pose} places the camera; leave one of them out."
            refuse_given(changed(self, ("origin", "target")), reason, "camera.placed_twice")

    def camera(self, part: Part, field: IndexField | None, stack: ShellStack) -> Camera:
        """The camera that these options describe, at its full resolution."""
        calibration = self._calibration()
        camera = self._described() if calibration is None else self._calibrated(calibration)
        placed = self.origin is not None or self.target is not None
        if placed or calibration is None or calibration.matrix is None:
            return self.placed(camera, part, field, stack)
        refuse_unseen_part(
            camera,
            part,
            f"The pose in {self.calibration}, read in "
            f"{self.calibration_length_unit or 'the unit that it states, else mm'},",
            "give the unit of its translation, or origin and target. OpenCV's pose leads from the "
            "part's frame to the camera's, and not back.",
        )
        return camera

    def has_pose(self) -> bool:
        """True if the calibration states the pose of its camera."""
        calibration = self._calibration()
        return calibration is not None and calibration.matrix is not None

    def _described(self) -> Camera:
        """Intrinsics from the options for focal length, sensor and the like; no pose."""
        from iriftrace.camera.camera import Camera
        from iriftrace.camera.distortion import Distortion

        if self.pixel_size is not None:
            raise InputError(
                f"the size of a pixel is {self.pixel_size!s}, which belongs to a calibration; "
                "without one give sensor and resolution.",
                code="camera.no_calibration",
                argument="pixel_size",
            )
        width, height = self.resolution
        if width % 1 or height % 1:
            raise InputError(
                f"a resolution of {self.resolution} is none; pixels are whole numbers.",
                code="camera.resolution",
                argument="resolution",
            )
        lens = None if self.distortion is None else Distortion.of_sequence(self.distortion)
        return Camera(
            focal_length_mm=self.focal_length,
            sensor_mm=self.sensor,
            resolution=(int(width), int(height)),
            principal_point_px=self.principal_point or ((width - 1) / 2, (height - 1) / 2),
            focus_mm=self.focus,
            distortion=lens,
        )

    def _calibration(self) -> Calibration | None:
        """Content of the calibration's file, if one is given."""
        from iriftrace.core.units import length_factor
        from iriftrace.io.calibration import read_calibration

        if self.calibration is None:
            return None
        given = self.calibration_length_unit
        try:
            unit = None if given is None else length_factor(given)
        except InputError as error:
            name = "calibration_length_unit"
            raise InputError(str(error), code=error.code, argument=name) from error
        found = read_calibration(self.calibration, length_mm=unit)
        if found.matrix is None and found.views and self.origin is None and self.target is None:
            warn(
                f"{self.calibration} has {found.views} views of a calibration board, which are not "
                "the camera's pose, so it looks from its usual place; give origin and target.",
                argument="origin",
            )
        return found

    def refuse_intrinsics(self) -> None:
        """Refuse what a calibration also states."""
        for name in ("focal_length", "sensor", "resolution", "principal_point", "distortion"):
            value = getattr(self, name)
            if value != getattr(USUAL_CAMERA, name):
                raise InputError(
                    f"the {name.replace('_', ' ')} is {value!s}, but the calibration states it as "
                    "well; leave one of them out.",
                    code="camera.stated_twice",
                    argument=name,
                )

    def _calibrated(self, calibration: Calibration) -> Camera:
        """Intrinsics and the pose, if there is one, of a calibration; without one at the origin."""
        import numpy as np

        return calibration.camera(
            pixel_size_mm=needed_pixel_size(self.pixel_size, self.calibration),
            focus_mm=self.focus,
            matrix=np.eye(4) if calibration.matrix is None else calibration.matrix,
        )

    def placed(
        self, camera: Camera, part: Part, field: IndexField | None, stack: ShellStack
    ) -> Camera:
        """The camera as origin, target and up place it, or where it sees all of the part."""
        from iriftrace.camera.pose import look_at
        from iriftrace.tracing.viewpoint import default_viewpoint

        if not any(self.up):
            raise InputError(
                f'up is "{self.up}", which is not a direction; give one, "0,0,1".',
                code="camera.no_direction",
                argument="up",
            )
        if self.origin is not None:
            target = part.centre if self.target is None else self.target
            return camera.at(look_at(self.origin, target, self.up))
        return camera.at(default_viewpoint(part, field, stack, camera, self.target, self.up))


USUAL_CAMERA = CameraOptions()


def needed_pixel_size(size: Length | None, source: object, argument: str = "pixel_size") -> Length:
    """Width of a pixel, mm, which a calibration does not state; InputError if it is not given."""
    if size is None:
        raise InputError(
            f'{source} has lengths in pixels only; give the width of a pixel too, such as "3.45 '
            "um\" (no ray depends on it, only the focal length and the sensor's size that results "
            "state).",
            code="calibration.no_pixel_size",
            argument=argument,
        )
    return size


def refuse_unseen_part(camera: Camera, part: Part, source: str, remedy: str) -> None:
    """Refuse a pose in a wrong unit or frame: it is in the part, looks past it, or is far away."""
    import numpy as np

    from iriftrace.tracing.viewpoint import part_view

    sees = "" if part_view(part, camera).outside < 1.0 else "it sees nothing of the part"
    if not sees and np.ptp(camera.project(part.vertices), axis=0).max() < FEWEST_PIXELS:
        sees = f"the part is less than {FEWEST_PIXELS} pixels large"
    if sees:
        place = ", ".join(f"{value:.6g}" for value in camera.origin)
        raise InputError(
            f"{source} has its camera at ({place}) mm, from where {sees}; {remedy}",
            code="camera.part_unseen",
            argument="calibration_length_unit",
        )
