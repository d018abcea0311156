"""Options about where the camera of a sweep goes, and the poses they stand for."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from attrs import frozen
from cyclopts import Group, Parameter

from iriftrace.cli.options import Whole, finite_numbers, numbers, quantity
from iriftrace.errors import InputError

if TYPE_CHECKING:
    from iriftrace.camera import Camera
    from iriftrace.pose_set import PoseSet
    from iriftrace.scene import LoadedScene

ORBIT = Group("Orbit", sort_key=1)

AZIMUTH, ELEVATION = "0:90:10", "-90:90:19"
"""Angles of an orbit without others, degree."""

FOCUS_SHARE = 0.9
"""Default stand-off as a share of the far end of the focus interval."""


@Parameter(name="*", group=ORBIT)
@frozen
class OrbitOptions:
    """Where the camera goes.

    Parameters
    ----------
    azimuth
        start:stop:count in degrees, both ends included, or one angle; 0:90:10 by default.
    elevation
        The same; at +-90 degrees there is one pose only; -90:90:19 by default.
    target
        Point that is looked at in mm, "0,0,0"; by default the part's centre.
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
        Instead of angles: this many poses spread evenly over the ellipsoid.
    poses
        Instead of an orbit: file with a list of poses.
    convention
        Camera axes in that file, opencv by default.
    length_unit
        Unit of the positions in that file, mm by default; robots often write m.
    """

    azimuth: str | None = None
    elevation: str | None = None
    target: str | None = None
    stand_off: str | None = None
    semi_axes: str | None = None
    paper_axes: str | None = None
    angles: Literal["parameter", "geocentric"] | None = None
    fibonacci: Whole | None = None
    poses: Path | None = None
    convention: Literal["opencv", "mitsuba", "opengl", "ros", "paper"] | None = None
    length_unit: str | None = None

    def look_at(self, scene: LoadedScene) -> np.ndarray[Any, Any]:
        """The point that is looked at, (3,) array, mm."""
        if self.target is None:
            return scene.part.centre
        return np.array(finite_numbers(self.target, 3, "--target"))

    def pose_sets(self, scene: LoadedScene, camera: Camera) -> list[tuple[float, PoseSet]]:
        """The poses these options describe, with the stand-off (mm) of each orbit.

        The stand-off is NaN for poses that come from something else.
        """
        from iriftrace.orbit import Orbit, fibonacci_poses, orbit_poses, parse_range
        from iriftrace.pose_files import read_poses

        self._refuse_contradictions()
        if self.poses is not None:
            convention, unit = self.convention or "opencv", self.length_unit or "mm"
            return [(math.nan, read_poses(self.poses, convention, length_unit=unit))]
        target = self.look_at(scene)
        sets = []
        for stand_off, axes in self._axes(scene, camera):
            kind = self.angles or "parameter"
            orbit = Orbit(centre=scene.part.centre, semi_axes_mm=axes, angles=kind)
            if self.fibonacci is not None:
                poses = fibonacci_poses(orbit, self.fibonacci, target)
            else:
                azimuth = parse_range(AZIMUTH if self.azimuth is None else self.azimuth)
                elevation = parse_range(ELEVATION if self.elevation is None else self.elevation)
                poses = orbit_poses(orbit, azimuth, elevation, target)
            sets.append((stand_off, poses))
        return sets

    def _refuse_contradictions(self) -> None:
        """Refuse options that would change nothing."""
        grid = {"--azimuth": self.azimuth, "--elevation": self.elevation}
        of_a_file = {"--convention": self.convention, "--length-unit": self.length_unit}
        if self.poses is None:
            for name in _given(of_a_file):
                raise InputError(
                    f"{name} says how a list of poses is written, but none is given; leave it out, "
                    "or give --poses."
                )
            for name in _given(grid) if self.fibonacci is not None else ():
                raise InputError(
                    f"{name} lays out a grid of angles, but --fibonacci spreads the poses itself; "
                    "leave out one of the two."
                )
            return
        orbit = {
            **grid,
            "--stand-off": self.stand_off,
            "--semi-axes": self.semi_axes,
            "--paper-axes": self.paper_axes,
            "--angles": self.angles,
            "--fibonacci": self.fibonacci,
        }
        for name in _given(orbit):
            raise InputError(
                f"{name} describes an orbit, but the poses come from {self.poses}; leave out one "
                "of the two."
            )

    def _axes(self, scene: LoadedScene, camera: Camera) -> list[tuple[float, Any]]:
        """Stand-off and semi-axes, mm, of each orbit."""
        from iriftrace.orbit import paper_semi_axes, semi_axes

        given = [self.stand_off, self.semi_axes, self.paper_axes]
        if sum(option is not None for option in given) > 1:
            raise InputError("Give only one of --stand-off, --semi-axes and --paper-axes.")
        if self.semi_axes is not None:
            return [(math.nan, numbers(self.semi_axes, 3, "--semi-axes"))]
        if self.paper_axes is not None:
            largest = quantity(self.paper_axes, "mm", "--paper-axes")
            return [(math.nan, paper_semi_axes(scene.part, largest))]
        if self.stand_off is not None:
            lengths = different_lengths(self.stand_off, "--stand-off")
            return [(length, semi_axes(scene.part, length)) for length in lengths]
        far = camera.focus_mm[1]
        if not np.isfinite(far):
            raise InputError(
                "The camera's focus has no far end from which a distance could follow; give "
                "--stand-off or --semi-axes."
            )
        length = FOCUS_SHARE * far
        return [(length, semi_axes(scene.part, length))]


def _given(options: Mapping[str, object]) -> list[str]:
    return [name for name, value in options.items() if value is not None]


def different_lengths(text: str, option: str) -> list[float]:
    """Lengths in mm, separated by commas, none of them twice.

    Raises
    ------
    InputError
        If one is no length, or is there twice: its poses would be ranked twice.
    """
    lengths = [quantity(piece, "mm", option) for piece in text.split(",")]
    if len(set(lengths)) < len(lengths):
        raise InputError(
            f'{option} is "{text}", with a length twice, so that its poses would count twice; give '
            "each once."
        )
    return lengths
