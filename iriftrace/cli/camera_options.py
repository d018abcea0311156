"""Options about the camera, and the camera they stand for."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from attrs import frozen
from cyclopts import Group, Parameter

from iriftrace.cli.options import finite_numbers, numbers, quantity
from iriftrace.errors import InputError, IriftraceWarning

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from iriftrace.calibration import Calibration
    from iriftrace.camera import Camera
    from iriftrace.field import IndexField
    from iriftrace.part import Part
    from iriftrace.shell_stack import ShellStack

CAMERA = Group("Camera", sort_key=5)

Scale = Annotated[float, Parameter(group=CAMERA, help="Factor on the resolution.")]
"""Not one of the camera's options, because every command has its own default."""


@Parameter(name="*", group=CAMERA)
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
        Where the axis meets the sensor in pixels from the upper left corner, "1224,1024".
    distortion
        Lens distortion in OpenCV's order k1,k2,p1,p2[,k3[,k4,k5,k6]].
    calibration
        Calibration of OpenCV (.yaml or .json) in place of the five options above; its pose, where
        it has one, holds unless origin or target is given.
    pixel_size
        Width of a pixel, "2.74 um". A calibration, which knows pixels only, needs it for the
        lengths in mm that results state; no ray depends on it.
    calibration_length_unit
        Unit of the translation in the calibration's pose.
    focus
        Nearest and farthest sharp distance NEAR:FAR; "0:inf" for no limit.
    origin
        Camera position in mm, "150,-100,120"; by default diagonally above, outside the hot air
        and not nearer than the focus interval.
    target
        Point that is looked at; by default the part's centre.
    up
        Direction that is up in the picture.
    """

    focal_length: str = "10 mm"
    sensor: str = "6.7 mm,5.6 mm"
    resolution: str = "2448,2048"
    principal_point: str | None = None
    distortion: str | None = None
    calibration: Path | None = None
    pixel_size: str | None = None
    calibration_length_unit: str = "mm"
    focus: str = "50:250"
    origin: str | None = None
    target: str | None = None
    up: str = "0,0,1"

    def camera(
        self, part: Part, field: IndexField | None, stack: ShellStack, scale: float
    ) -> Camera:
        """The camera these options describe, at its whole resolution."""
        from attrs import evolve

        calibration = self._calibration()
        camera = self._described() if calibration is None else self._calibrated(calibration)
        placed = self.origin is not None or self.target is not None
        if placed or calibration is None or calibration.matrix is None:
            camera = evolve(camera, matrix=self._pose(part, field, stack, camera.focus_mm[0]))
        camera.scaled(scale)  # refuses a scale that leaves no pixel
        return camera

    def _described(self) -> Camera:
        """Intrinsics from the options for focal length, sensor and the like; no pose."""
        from iriftrace.camera import Camera
        from iriftrace.distortion import Distortion

        if self.pixel_size is not None:
            raise InputError(
                f'--pixel-size is "{self.pixel_size}", which belongs to --calibration; without it '
                "give --sensor and --resolution."
            )
        sizes = [quantity(piece, "mm", "--sensor") for piece in self.sensor.split(",")]
        if len(sizes) != 2:
            raise InputError(
                f'--sensor is "{self.sensor}"; give width and height, "6.7 mm,5.6 mm".'
            )
        width, height = finite_numbers(self.resolution, 2, "--resolution")
        if width % 1 or height % 1:
            raise InputError(f'--resolution is "{self.resolution}"; pixels are whole numbers.')
        near, far = numbers(self.focus, 2, "--focus", ":")
        point = [width / 2, height / 2]
        if self.principal_point is not None:
            point = finite_numbers(self.principal_point, 2, "--principal-point")
        lens = None
        if self.distortion is not None:
            count = self.distortion.count(",") + 1
            lens = Distortion.of_sequence(finite_numbers(self.distortion, count, "--distortion"))
        return Camera(
            focal_length_mm=quantity(self.focal_length, "mm", "--focal-length"),
            sensor_mm=(sizes[0], sizes[1]),
            resolution=(int(width), int(height)),
            principal_point_px=(point[0], point[1]),
            focus_mm=(near, far),
            distortion=lens,
        )

    def _calibration(self) -> Calibration | None:
        """What the calibration's file says."""
        from iriftrace.calibration import read_calibration
        from iriftrace.units import length_factor

        if self.calibration is None:
            return None
        self._refuse_intrinsics()
        unit = length_factor(self.calibration_length_unit)
        found = read_calibration(self.calibration, length_mm=unit)
        if found.matrix is None and found.views and self.origin is None and self.target is None:
            warnings.warn(
                f"{self.calibration} has {found.views} views of a calibration board, which are no "
                "pose of the camera, so it looks from its usual place; give --origin and --target.",
                IriftraceWarning,
                stacklevel=2,
            )
        return found

    def _calibrated(self, calibration: Calibration) -> Camera:
        """Intrinsics and, where there is one, the pose of a calibration."""
        if self.pixel_size is None:
            raise InputError(
                f"{self.calibration} knows lengths in pixels only; give the width of a pixel too, "
                'such as --pixel-size "2.74 um" (no ray depends on it, only the focal length and '
                "the sensor's size that results state)."
            )
        near, far = numbers(self.focus, 2, "--focus", ":")
        pose = {} if calibration.matrix is None else {"matrix": calibration.matrix}
        size = quantity(self.pixel_size, "mm", "--pixel-size")
        return calibration.camera(pixel_size_mm=size, focus_mm=(near, far), **pose)

    def _refuse_intrinsics(self) -> None:
        """A calibration has what these options say, and two answers are none."""
        names = ("focal_length", "sensor", "resolution", "principal_point", "distortion")
        standard = CameraOptions()
        for name in names:
            if getattr(self, name) != getattr(standard, name):
                raise InputError(
                    f'--{name.replace("_", "-")} is "{getattr(self, name)}", but --calibration '
                    "says that too; leave one of them out."
                )

    def _pose(
        self, part: Part, field: IndexField | None, stack: ShellStack, near: float
    ) -> NDArray[np.float64]:
        """Camera to world, from origin, target and up."""
        from iriftrace.camera import look_at
        from iriftrace.viewpoint import default_viewpoint

        if self.origin is None:
            origin = default_viewpoint(part, field, stack, near).tolist()
        else:
            origin = finite_numbers(self.origin, 3, "--origin")
        target = part.centre.tolist()
        if self.target is not None:
            target = finite_numbers(self.target, 3, "--target")
        up = finite_numbers(self.up, 3, "--up")
        if not any(up):
            raise InputError(f'--up is "{self.up}", which is no direction; give one, "0,0,1".')
        return look_at(origin, target, up)
