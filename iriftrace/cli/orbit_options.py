"""Options about the poses of a sweep, and the poses that they define."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from attrs import frozen
from cyclopts import Group, Parameter

from iriftrace.cli.console import say
from iriftrace.cli.options import (
    Lengths,
    Vector,
    Whole,
    read_motion,
    refuse_given,
)
from iriftrace.core.errors import InputError
from iriftrace.io.robot_poses import RobotName

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from iriftrace.camera.pose_set import PoseSet
    from iriftrace.core.arrays import FloatArray
    from iriftrace.tracing.scene import Scene


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
        "200mm,225mm"; by default as far as all of the part is in focus from every direction, or the
        middle of the focus interval if that is farther.
    semi_axes
        Semi-axes of the ellipsoid in mm, "310,240,240".
    angles
        Whether angles are the ellipsoid's parameters, as by default, or directions from its
        centre.
    fibonacci
        Instead of angles: number of poses spread evenly over the ellipsoid.
    poses
        Instead of an orbit: file with a list of poses, .npy, .csv or .json.
    turntable
        Instead of an orbit: the sensor stands where the scene has it, and the part turns with its
        air about a vertical axis through its centre, "z:0:360:30" (axis, start, stop and step in
        degrees).
    convention
        Camera axes in that file, opencv by default.
    length_unit
        Unit of the positions in that file, mm by default; robots often write m.
    robot
        Robot whose orientations that file has.
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
    def is_default(self) -> bool:
        """True if no option states how far from the part the cameras stand."""
        return self.is_orbit and not (self.stand_off or self.semi_axes)

    @property
    def is_orbit(self) -> bool:
        """True if poses are computed around the part and not given."""
        return self.poses is None and self.turntable is None

    def look_at(self, scene: Scene) -> FloatArray | tuple[float, float, float]:
        """The point that the camera looks at, (3,), mm, world."""
        return scene.part.centre if self.target is None else self.target

    def pose_sets(self, scene: Scene) -> dict[float, PoseSet]:
        """Poses by the stand-off (mm) of their orbit, NaN for any other poses."""
        import numpy as np

        from iriftrace.camera.orbit import (
            Orbit,
            fibonacci_poses,
            orbit_poses,
            parse_range,
            turntable_poses,
        )
        from iriftrace.io.poses import read_poses

        self._refuse_contradictions()
        if self.poses is not None and self.turntable is not None:
            raise InputError(
                "Poses come from a file or a turntable; leave out --poses or --turntable."
            )
        if self.poses is not None:
            convention, unit = self.convention or "opencv", self.length_unit or "mm"
            frames = {"hand_eye": self.hand_eye, "base_to_part": self.base_to_part}
            motions = {name: read_motion(file) for name, file in frames.items()}
            read = {name: motion for name, motion in motions.items() if motion is not None}
            poses = read_poses(self.poses, convention, length_unit=unit, robot=self.robot, **read)
            far = np.linalg.norm(poses.origins - scene.part.centre, axis=1)
            say(f"Poses {far.min():.4g} to {far.max():.4g} mm from the part's middle.")
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
            "--angles": self.angles,
            "--fibonacci": self.fibonacci,
        }
        refuse_given(
            orbit,
            f"describes an orbit, but the poses come from {self.poses or 'a turntable'}; leave out "
            "one of the two.",
        )

    def _axes(self, scene: Scene) -> list[tuple[float, ArrayLike]]:
        """Stand-off and semi-axes, mm, of each orbit."""
        from iriftrace.camera.orbit import default_stand_off, semi_axes

        if self.semi_axes is not None:
            if self.stand_off is not None:
                raise InputError("Give only one of --stand-off and --semi-axes.")
            return [(math.nan, self.semi_axes)]
        if self.stand_off is not None:
            return [(length, semi_axes(scene.part, length)) for length in self.stand_off]
        if not math.isfinite(scene.camera.focus_mm[1]):
            raise InputError(
                "The camera's focus has no far end from which to compute a distance; give "
                "--stand-off or --semi-axes."
            )
        length = default_stand_off(scene.part, scene.camera.focus_mm)
        return [(length, semi_axes(scene.part, length))]
