"""Options of long work, for Python and for commands: workers, and the poses of a sweep."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from attrs import field, frozen
from attrs.converters import optional as if_given

from iriftrace.core.errors import InputError, changed, refuse_given
from iriftrace.core.number_lists import Lengths, Vector
from iriftrace.io.poses import Convention
from iriftrace.io.robot_poses import RobotName

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from iriftrace.camera.pose_set import PoseSet
    from iriftrace.core.arrays import FloatArray
    from iriftrace.tracing.scene import Scene

LOCAL = "local"


@frozen
class Workers:
    """Worker processes, by default none.

    Parameters
    ----------
    scheduler
        Let worker processes do the work: "local" starts them here, "tcp://host:8786" is the address
        that `dask scheduler` prints; its workers must see the files under the same path, and need
        OpenFOAM for flows.
    workers
        Number of local workers; by default one for every two cores, at least two.
    """

    scheduler: str | None = None
    workers: int | None = None

    @property
    def address(self) -> str | None:
        """Scheduler of the workers; None if the work is done in this process."""
        return LOCAL if self.scheduler is None and self.workers is not None else self.scheduler


NO_WORKERS = Workers()


_GRID = ("azimuth", "elevation")
_ORBIT = (*_GRID, "stand_off", "semi_axes", "angles", "fibonacci")
_FRAMES = ("hand_eye", "base_to_part")
_OF_A_FILE = ("convention", "length_unit", "robot", *_FRAMES)


@frozen
class SweepPoses:
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
        "200mm,225mm"; by default the distance of the scene's camera from the part; with a focus
        interval as far as all of the part is in focus from every direction, or the middle of the
        interval if that is farther.
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

    Raises
    ------
    InputError
        If options are given that would change nothing.
    """

    azimuth: str | None = None
    elevation: str | None = None
    target: Vector | None = field(default=None, converter=if_given(Vector))
    stand_off: Lengths | None = field(default=None, converter=if_given(Lengths))
    semi_axes: Vector | None = field(default=None, converter=if_given(Vector))
    angles: Literal["parameter", "geocentric"] | None = None
    fibonacci: int | None = None
    poses: Path | None = None
    turntable: str | None = None
    convention: Convention | None = None
    length_unit: str | None = None
    robot: RobotName | None = None
    hand_eye: Path | None = None
    base_to_part: Path | None = None

    def __attrs_post_init__(self) -> None:
        if self.poses is None:
            reason = "states the format of a list of poses, but none is given; leave it out."
            refuse_given(changed(self, _OF_A_FILE), reason, "poses.no_file")
        elif self.turntable is not None:
            raise InputError(
                "Poses come from a file or a turntable; leave one of them out.",
                code="poses.two_kinds",
                argument="turntable",
            )
        if self.fibonacci is not None:
            reason = "sets a grid of angles, but poses are spread evenly; leave out one of the two."
            refuse_given(changed(self, _GRID), reason, "poses.two_kinds")
        if not self.is_orbit:
            source = self.poses or "a turntable"
            reason = (
                f"describes an orbit, but the poses come from {source}; leave out one of the two."
            )
            refuse_given(changed(self, _ORBIT), reason, "poses.two_kinds")
        if self.semi_axes is not None:
            reason = "is given besides the ellipsoid's semi-axes; leave out one of the two."
            refuse_given(changed(self, ("stand_off",)), reason, "orbit.two_sizes")

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
        from iriftrace.camera.orbit import (
            Orbit,
            fibonacci_poses,
            orbit_poses,
            parse_range,
            turntable_poses,
        )

        centre = scene.part.centre
        if self.poses is not None:
            return {math.nan: self._read(self.poses)}
        if self.turntable is not None:
            return {math.nan: turntable_poses(scene.camera.matrix, self.turntable, centre)}
        target = self.look_at(scene)
        azimuth = parse_range("0:90:10" if self.azimuth is None else self.azimuth)
        elevation = parse_range("-90:90:19" if self.elevation is None else self.elevation)
        sets = {}
        for stand_off, axes in self._axes(scene).items():
            orbit = Orbit(centre, axes, self.angles or "parameter")
            if self.fibonacci is None:
                sets[stand_off] = orbit_poses(orbit, azimuth, elevation, target)
            else:
                sets[stand_off] = fibonacci_poses(orbit, self.fibonacci, target)
        return sets

    def _read(self, path: Path) -> PoseSet:
        from iriftrace.core.mesh.transform import read_motion
        from iriftrace.io.poses import read_poses

        given: dict[str, Any] = {name: getattr(self, name) for name in _OF_A_FILE}
        given |= {name: read_motion(given[name]) for name in _FRAMES if given[name] is not None}
        return read_poses(path, **{name: one for name, one in given.items() if one is not None})

    def _axes(self, scene: Scene) -> Mapping[float, ArrayLike]:
        """Semi-axes of each orbit by its stand-off, mm."""
        from iriftrace.camera.orbit import default_stand_off, semi_axes

        if self.semi_axes is not None:
            return {math.nan: self.semi_axes}
        lengths: tuple[float, ...] = self.stand_off or ()
        if not lengths:
            lengths = (default_stand_off(scene.part, scene.camera),)
        return {float(length): semi_axes(scene.part, length) for length in lengths}
