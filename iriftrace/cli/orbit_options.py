"""Options about where the camera of a sweep goes, and the poses they stand for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from attrs import frozen
from cyclopts import Group, Parameter

from iriftrace.cli.options import numbers
from iriftrace.errors import InputError

if TYPE_CHECKING:
    from iriftrace.camera import Camera
    from iriftrace.pose_set import PoseSet
    from iriftrace.scene import LoadedScene

ORBIT = Group("Orbit", sort_key=1)

FOCUS_SHARE = 0.9
"""Default stand-off as a share of the far end of the focus interval."""


@Parameter(name="*", group=ORBIT)
@frozen
class OrbitOptions:
    """Where the camera goes.

    Parameters
    ----------
    azimuth
        start:stop:count in degrees, both ends included, or one angle.
    elevation
        The same; at +-90 degrees there is one pose only.
    target
        Point that is looked at in mm, "0,0,0"; by default the part's centre.
    stand_off
        Added to the part's half extents to give the ellipsoid's semi-axes; by default 0.9 times the
        far end of the focus interval.
    semi_axes
        Semi-axes of the ellipsoid in mm, "310,240,240".
    paper_axes
        Largest semi-axis in mm of an ellipsoid with the ratio of the part's dimensions.
    angles
        Whether angles are the ellipsoid's parameters or directions from its centre.
    fibonacci
        Instead of angles: this many poses spread evenly over the ellipsoid.
    poses
        Instead of an orbit: file with a list of poses.
    convention
        Camera axes in that file.
    """

    azimuth: str = "0:90:10"
    elevation: str = "-90:90:19"
    target: str | None = None
    stand_off: str | None = None
    semi_axes: str | None = None
    paper_axes: str | None = None
    angles: Literal["parameter", "geocentric"] = "parameter"
    fibonacci: int | None = None
    poses: Path | None = None
    convention: Literal["opencv", "mitsuba", "opengl", "ros", "paper"] = "opencv"

    def look_at(self, scene: LoadedScene) -> np.ndarray[Any, Any]:
        """The point that is looked at, (3,) array, mm."""
        if self.target is None:
            return scene.part.centre
        return np.array(numbers(self.target, 3, "--target"))

    def pose_set(self, scene: LoadedScene, camera: Camera) -> PoseSet:
        """The poses these options describe."""
        from iriftrace.orbit import Orbit, fibonacci_poses, orbit_poses, parse_range
        from iriftrace.pose_files import read_poses

        if self.poses is not None:
            return read_poses(self.poses, self.convention)
        target = self.look_at(scene)
        orbit = Orbit(
            centre=scene.part.centre, semi_axes_mm=self._axes(scene, camera), angles=self.angles
        )
        if self.fibonacci is not None:
            return fibonacci_poses(orbit, self.fibonacci, target)
        return orbit_poses(orbit, parse_range(self.azimuth), parse_range(self.elevation), target)

    def _axes(self, scene: LoadedScene, camera: Camera) -> Any:
        from iriftrace.orbit import paper_semi_axes, semi_axes
        from iriftrace.units import parse_quantity

        given = [self.stand_off, self.semi_axes, self.paper_axes]
        if sum(option is not None for option in given) > 1:
            raise InputError("Give only one of --stand-off, --semi-axes and --paper-axes.")
        if self.semi_axes is not None:
            return numbers(self.semi_axes, 3, "--semi-axes")
        if self.paper_axes is not None:
            return paper_semi_axes(scene.part, parse_quantity(self.paper_axes, "mm"))
        if self.stand_off is not None:
            return semi_axes(scene.part, parse_quantity(self.stand_off, "mm"))
        far = camera.focus_mm[1]
        if not np.isfinite(far):
            raise InputError(
                "The camera's focus has no far end from which a distance could follow; give "
                "--stand-off or --semi-axes."
            )
        return semi_axes(scene.part, FOCUS_SHARE * far)
