"""Options about the camera, and the camera they stand for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from attrs import frozen
from cyclopts import Group, Parameter

from iriftrace.cli.options import finite_numbers, numbers, quantity
from iriftrace.errors import InputError

if TYPE_CHECKING:
    from iriftrace.camera import Camera
    from iriftrace.field import IndexField
    from iriftrace.part import Part
    from iriftrace.shell_stack import ShellStack

CAMERA = Group("Camera", sort_key=5)


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
    focus
        Nearest and farthest sharp distance NEAR:FAR; "0:inf" for no limit.
    origin
        Camera position in mm, "150,-100,120"; by default diagonally above, outside the hot air
        and not nearer than the focus interval.
    target
        Point that is looked at; by default the part's centre.
    up
        Direction that is up in the picture.
    scale
        Factor on the resolution.
    """

    focal_length: str = "10 mm"
    sensor: str = "6.7 mm,5.6 mm"
    resolution: str = "2448,2048"
    principal_point: str | None = None
    focus: str = "50:250"
    origin: str | None = None
    target: str | None = None
    up: str = "0,0,1"
    scale: float = 0.5

    def camera(self, part: Part, field: IndexField | None, stack: ShellStack) -> Camera:
        """The camera these options describe."""
        from iriftrace.camera import Camera, look_at
        from iriftrace.viewpoint import default_viewpoint

        sizes = [quantity(piece, "mm", "--sensor") for piece in self.sensor.split(",")]
        if len(sizes) != 2:
            raise InputError(
                f'--sensor is "{self.sensor}"; give width and height, "6.7 mm,5.6 mm".'
            )
        width, height = finite_numbers(self.resolution, 2, "--resolution")
        if width % 1 or height % 1:
            raise InputError(f'--resolution is "{self.resolution}"; pixels are whole numbers.')
        near, far = numbers(self.focus, 2, "--focus", ":")
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
        point = [width / 2, height / 2]
        if self.principal_point is not None:
            point = finite_numbers(self.principal_point, 2, "--principal-point")
        camera = Camera(
            focal_length_mm=quantity(self.focal_length, "mm", "--focal-length"),
            sensor_mm=(sizes[0], sizes[1]),
            resolution=(int(width), int(height)),
            principal_point_px=(point[0], point[1]),
            focus_mm=(near, far),
            matrix=look_at(origin, target, up),
        )
        camera.scaled(self.scale)  # refuses a scale that leaves no pixel
        return camera
