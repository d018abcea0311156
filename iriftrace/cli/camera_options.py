"""Options about the camera and its orbit, and the camera and poses that they define."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from attrs import frozen
from cyclopts import Group, Parameter

from iriftrace.camera.robot_poses import RobotName
from iriftrace.cli.options import (
    Interval,
    Length,
    Lengths,
    Numbers,
    Pair,
    Size,
    Vector,
    Whole,
    refuse_given,
)
from iriftrace.core.errors import InputError, warn

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from iriftrace.camera.calibration import Calibration
    from iriftrace.camera.camera import Camera
    from iriftrace.camera.pose_set import PoseSet
    from iriftrace.core.arrays import FloatArray
    from iriftrace.field.index_field import IndexField
    from iriftrace.part.part import Part
    from iriftrace.scene.loaded import LoadedScene
    from iriftrace.shells.stack import ShellStack


CAMERA = Group("Camera", sort_key=5)

FOCUS_MM = (50.0, 250.0)
"""Nearest and farthest sharp distance of the camera of Kern et al. (2025)."""

FEWEST_PIXELS = 10
"""Minimum number of pixels across the whole part for a measurement."""

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
        Point where the axis meets the sensor, in pixels as OpenCV counts them, from the centre of
        the first one, "1223.5,1023.5".
    distortion
        Lens distortion in OpenCV's order k1,k2,p1,p2[,k3[,k4,k5,k6]].
    calibration
        Calibration of OpenCV, ROS or MATLAB (.yaml, .xml or .json) instead of the five options
        above; its pose, if it has one, is used unless origin or target is given.
    pixel_size
        Width of a pixel, "2.74 um". A calibration, which is in pixels only, needs it for the
        lengths in mm that results state; no ray depends on it.
    calibration_length_unit
        Unit of the translation in the calibration, mm by default; for a stereo calibration the
        unit that the file states, and m for ROS and Kalibr.
    focus
        Nearest and farthest sharp distance NEAR:FAR; "0:inf" for no limit. By default 50:250, and
        to the part's far end if the camera stands by default or as its calibration states.
    origin
        Camera position in mm, "150,-100,120"; by default diagonally above, outside the hot air,
        beyond the near end of the focus and so far that the picture shows the whole part.
    target
        Point that the camera looks at; by default the part's centre.
    up
        Direction that is up in the picture.
    """

    focal_length: Length = 10.0
    sensor: Size = (6.7, 5.6)
    resolution: Pair = (2448.0, 2048.0)
    principal_point: Pair | None = None
    distortion: Numbers | None = None
    calibration: Path | None = None
    pixel_size: Length | None = None
    calibration_length_unit: str | None = None
    focus: Interval | None = None
    origin: Vector | None = None
    target: Vector | None = None
    up: Vector = (0.0, 0.0, 1.0)

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
            "give the unit of its translation (--calibration-length-unit), or --origin and "
            "--target. OpenCV's pose leads from the part's frame to the camera's, and not back.",
        )
        return camera if self.focus is not None else with_all_in_focus(camera, camera, part)

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
                f"--pixel-size is {self.pixel_size:g} mm, which belongs to --calibration; without "
                "it give --sensor and --resolution."
            )
        width, height = self.resolution
        if width % 1 or height % 1:
            raise InputError(f'--resolution is "{width:g},{height:g}"; pixels are whole numbers.')
        lens = None if self.distortion is None else Distortion.of_sequence(self.distortion)
        return Camera(
            focal_length_mm=self.focal_length,
            sensor_mm=self.sensor,
            resolution=(int(width), int(height)),
            principal_point_px=self.principal_point or ((width - 1) / 2, (height - 1) / 2),
            focus_mm=self.focus or FOCUS_MM,
            distortion=lens,
        )

    def _calibration(self) -> Calibration | None:
        """Content of the calibration's file, if one is given."""
        from iriftrace.camera.calibration import read_calibration
        from iriftrace.core.units import length_factor

        if self.calibration is None:
            return None
        self.refuse_intrinsics("--calibration")
        try:
            given = self.calibration_length_unit
            unit = None if given is None else length_factor(given)
        except InputError as error:
            raise InputError(f"--calibration-length-unit: {error}") from error
        found = read_calibration(self.calibration, length_mm=unit)
        if found.matrix is None and found.views and self.origin is None and self.target is None:
            warn(
                f"{self.calibration} has {found.views} views of a calibration board, which are not "
                "the camera's pose, so it looks from its usual place; give --origin and --target.",
                stacklevel=2,
            )
        return found

    def refuse_intrinsics(self, option: str) -> None:
        """Refuse options that a calibration, given by `option`, also states."""
        standard = CameraOptions()
        for name in ("focal_length", "sensor", "resolution", "principal_point", "distortion"):
            if getattr(self, name) != getattr(standard, name):
                raise InputError(
                    f'--{name.replace("_", "-")} is "{getattr(self, name)}", but {option} states '
                    "it as well; leave one of them out."
                )

    def _calibrated(self, calibration: Calibration) -> Camera:
        """Intrinsics and the pose, if there is one, of a calibration."""
        return calibration.camera(
            pixel_size_mm=needed_pixel_size(self.pixel_size, self.calibration),
            focus_mm=self.focus or FOCUS_MM,
            matrix=calibration.matrix,
        )

    def placed(
        self, camera: Camera, part: Part, field: IndexField | None, stack: ShellStack
    ) -> Camera:
        """The camera as origin, target and up place it, or where it sees all of the part."""
        from iriftrace.camera.pose import look_at
        from iriftrace.scene.viewpoint import default_viewpoint

        if not any(self.up):
            raise InputError('--up is "0,0,0", which is not a direction; give one, "0,0,1".')
        if self.origin is not None:
            target = part.centre if self.target is None else self.target
            return camera.at(look_at(self.origin, target, self.up))
        camera = camera.at(default_viewpoint(part, field, stack, camera, self.target, self.up))
        return camera if self.focus is not None else with_all_in_focus(camera, camera, part)


def needed_pixel_size(size: float | None, source: object, option: str = "--pixel-size") -> float:
    """Width of a pixel, mm, which a calibration does not state; InputError if it is not given."""
    if size is None:
        raise InputError(
            f"{source} has lengths in pixels only; give the width of a pixel too, such as "
            f'{option} "3.45 um" (no ray depends on it, only the focal length and the sensor\'s '
            "size that results state)."
        )
    return size


def refuse_unseen_part(camera: Camera, part: Part, source: str, remedy: str) -> None:
    """Refuse a pose in a wrong unit or frame: it is in the part, looks past it, or is far away."""
    import numpy as np

    from iriftrace.scene.viewpoint import part_view

    sees = "" if part_view(part, camera).outside < 1.0 else "it sees nothing of the part"
    if not sees and np.ptp(camera.project(part.vertices), axis=0).max() < FEWEST_PIXELS:
        sees = f"the part is less than {FEWEST_PIXELS} pixels large"
    if sees:
        place = ", ".join(f"{value:.6g}" for value in camera.origin)
        raise InputError(f"{source} has its camera at ({place}) mm, from where {sees}; {remedy}")


def with_all_in_focus(device: Camera, camera: Camera, part: Part) -> Camera:
    """A device with a camera's focus interval, extended to the part's farthest point if needed."""
    from attrs import evolve

    from iriftrace.scene.viewpoint import farthest_mm

    near, far = camera.focus_mm
    return evolve(device, focus_mm=(near, max(far, math.ceil(farthest_mm(part, device)))))


@Parameter(name="*", group=Group("Orbit", sort_key=1))
@frozen
class OrbitOptions:
    """Poses of the camera of a sweep.

    Parameters
    ----------
    azimuth
        start:stop:count in degrees, both ends included, or one angle; 0:90:10 by default.
    elevation
        The same for the elevation; at +-90 degrees there is one pose only; -90:90:19 by default.
    target
        Point that the camera looks at in mm, "0,0,0"; by default the part's centre.
    stand_off
        Added to the part's half extents to give the ellipsoid's semi-axes, one or several,
        "200mm,225mm"; by default 0.9 times the far end of the focus interval.
    semi_axes
        Semi-axes of the ellipsoid in mm, "310,240,240".
    paper_axes
        Largest semi-axis in mm of an ellipsoid with the ratio of the part's dimensions.
    angles
        Whether angles are the ellipsoid's parameters, as by default, or directions from its
        centre.
    fibonacci
        Instead of angles: number of poses spread evenly over the ellipsoid.
    poses
        Instead of an orbit: file with a list of poses.
    turntable
        Instead of an orbit: the sensor stands where the scene has it, and the part turns with its
        air about a vertical axis through its centre, "z:0:360:30" (axis, start, stop and step in
        degrees).
    convention
        Camera axes in that file, opencv by default.
    length_unit
        Unit of the positions in that file, mm by default; robots often write m.
    robot
        Robot whose angles that file has, if its columns do not tell (a, b, c or rx, ry, rz).
    hand_eye
        For poses of a robot's flange: text file of the 4 x 4 pose of the camera in the flange's
        frame, mm, as R_cam2gripper and t_cam2gripper of OpenCV's calibrateHandEye.
    base_to_part
        Text file of a 4 x 4 rigid motion, mm, from that file's frame (robot's base) to the scene's.
    """

    azimuth: str | None = None
    elevation: str | None = None
    target: Vector | None = None
    stand_off: Lengths | None = None
    semi_axes: Vector | None = None
    paper_axes: Length | None = None
    angles: Literal["parameter", "geocentric"] | None = None
    fibonacci: Whole | None = None
    poses: Path | None = None
    turntable: str | None = None
    convention: Literal["opencv", "mitsuba", "opengl", "ros"] | None = None
    length_unit: str | None = None
    robot: RobotName | None = None
    hand_eye: Path | None = None
    base_to_part: Path | None = None

    @property
    def is_orbit(self) -> bool:
        """True if poses are computed around the part and not given."""
        return self.poses is None and self.turntable is None

    def look_at(self, scene: LoadedScene) -> FloatArray | tuple[float, float, float]:
        """The point that the camera looks at, (3,), mm, world."""
        return scene.part.centre if self.target is None else self.target

    def pose_sets(self, scene: LoadedScene) -> dict[float, PoseSet]:
        """Poses by the stand-off (mm) of their orbit, NaN for any other poses."""
        from iriftrace.camera.orbit import (
            Orbit,
            fibonacci_poses,
            orbit_poses,
            parse_range,
            turntable_poses,
        )
        from iriftrace.camera.pose_files import read_poses
        from iriftrace.geometry.transform import parse_transform

        self._refuse_contradictions()
        if self.poses is not None and self.turntable is not None:
            raise InputError(
                "Poses come from a file or a turntable; leave out --poses or --turntable."
            )
        if self.poses is not None:
            convention, unit = self.convention or "opencv", self.length_unit or "mm"
            frames = {"hand_eye": self.hand_eye, "base_to_part": self.base_to_part}
            read = {name: parse_transform(str(file)) for name, file in frames.items() if file}
            poses = read_poses(self.poses, convention, length_unit=unit, robot=self.robot, **read)
            return {math.nan: poses}
        if self.turntable is not None:
            centre = scene.part.centre
            return {math.nan: turntable_poses(scene.camera.matrix, self.turntable, centre)}
        target = self.look_at(scene)
        azimuth = parse_range("0:90:10" if self.azimuth is None else self.azimuth)
        elevation = parse_range("-90:90:19" if self.elevation is None else self.elevation)
        kind = self.angles or "parameter"
        sets = {}
        for stand_off, axes in self._axes(scene):
            orbit = Orbit(centre=scene.part.centre, semi_axes_mm=axes, angles=kind)
            if self.fibonacci is None:
                sets[stand_off] = orbit_poses(orbit, azimuth, elevation, target)
            else:
                sets[stand_off] = fibonacci_poses(orbit, self.fibonacci, target)
        return sets

    def _refuse_contradictions(self) -> None:
        """Refuse options that would change nothing."""
        grid = {"--azimuth": self.azimuth, "--elevation": self.elevation}
        of_a_file = {
            "--convention": self.convention,
            "--length-unit": self.length_unit,
            "--robot": self.robot,
            "--hand-eye": self.hand_eye,
            "--base-to-part": self.base_to_part,
        }
        if self.poses is None:
            refuse_given(
                of_a_file,
                "states the format of a list of poses, but none is given; leave it out, or give "
                "--poses.",
            )
            if self.fibonacci is not None:
                refuse_given(
                    grid,
                    "sets a grid of angles, but --fibonacci spreads the poses itself; leave "
                    "out one of the two.",
                )
            if self.turntable is None:
                return
        orbit = {
            **grid,
            "--stand-off": self.stand_off,
            "--semi-axes": self.semi_axes,
            "--paper-axes": self.paper_axes,
            "--angles": self.angles,
            "--fibonacci": self.fibonacci,
        }
        refuse_given(
            orbit,
            f"describes an orbit, but the poses come from {self.poses or 'a turntable'}; leave out "
            "one of the two.",
        )

    def _axes(self, scene: LoadedScene) -> list[tuple[float, ArrayLike]]:
        """Stand-off and semi-axes, mm, of each orbit."""
        from iriftrace.camera.orbit import paper_semi_axes, semi_axes

        given = [self.stand_off, self.semi_axes, self.paper_axes]
        if sum(option is not None for option in given) > 1:
            raise InputError("Give only one of --stand-off, --semi-axes and --paper-axes.")
        if self.semi_axes is not None:
            return [(math.nan, self.semi_axes)]
        if self.paper_axes is not None:
            return [(math.nan, paper_semi_axes(scene.part, self.paper_axes))]
        far = scene.camera.focus_mm[1]
        if self.stand_off is None and not math.isfinite(far):
            raise InputError(
                "The camera's focus has no far end from which to compute a distance; give "
                "--stand-off or --semi-axes."
            )
        lengths = self.stand_off or (0.9 * far,)
        return [(length, semi_axes(scene.part, length)) for length in lengths]
