"""Poses around a part: on an ellipsoid, looking at a target, or of a part on a turntable."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from attrs import field, frozen
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from iriftrace.camera.pose_set import PoseSet, aimed, fixed
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError

if TYPE_CHECKING:
    from iriftrace.camera.camera import Camera
    from iriftrace.part.part import Part


ANGLES = ("parameter", "geocentric")

GOLDEN_ANGLE_DEG = 180.0 * (3.0 - 5.0**0.5)

_MOST_VALUES = 100_000

_WORLD_AXES = ("x", "y", "z")


def parse_range(text: str) -> FloatArray:
    """Values (count,) of an angle, a distance or another option of a sweep.

    From ``"start:stop:count"``, both ends included and evenly spaced, or one number; a range from
    -x to x is symmetric to the last bit. An InputError for neither form, what is not finite, or a
    count that does not fit the ends.
    """
    pieces = text.split(":")
    try:
        ends = [float(piece) for piece in pieces[:2]]
        count = int(pieces[2]) if len(pieces) == 3 else 1
    except ValueError:
        ends, count = [], 0
    if len(pieces) not in (1, 3) or not ends or not np.isfinite(ends).all():
        raise InputError(
            f"{text!r} is not a range; write one number or start:stop:count with both ends "
            "included, such as -90:90:19.",
            code="poses.range",
        )
    start, stop = ends[0], ends[-1]
    if not 1 <= count <= _MOST_VALUES or (count == 1) != (start == stop):
        raise InputError(
            f"The range {text!r} has a count that does not fit its ends; give 2 to {_MOST_VALUES} "
            "values between two different ends, or one number.",
            code="poses.range_count",
        )
    steps = np.arange(count)
    values: FloatArray = (start * (count - 1 - steps) + stop * steps) / max(count - 1, 1)
    values[0], values[-1] = start, stop
    return values


@frozen(eq=False)
class Orbit:
    """Ellipsoid on which cameras stand; its axes are those of the world.

    Parameters
    ----------
    centre : (3,) array, mm, world
    semi_axes_mm : (3,) array, mm
    angles : str
        What azimuth and elevation mean. ``"parameter"``: the point is
        (a cos e cos A, b cos e sin A, c sin e) from the centre. ``"geocentric"``: they are the
        direction of the point seen from the centre.

    Raises
    ------
    InputError
        If a semi-axis is not positive, a value is not finite or the angles are of unknown kind.
    """

    centre: FloatArray = field(converter=fixed)
    semi_axes_mm: FloatArray = field(converter=fixed)
    angles: str = "parameter"

    def __attrs_post_init__(self) -> None:
        if self.angles not in ANGLES:
            raise InputError(
                f"Unknown angles {self.angles!r}; use one of {', '.join(ANGLES)}.",
                code="orbit.unknown_angles",
                argument="angles",
            )
        if self.centre.shape != (3,) or not np.isfinite(self.centre).all():
            raise InputError(
                f"The orbit's centre {self.centre.tolist()} is not a point; give three finite "
                "numbers.",
                code="orbit.centre",
            )
        axes = self.semi_axes_mm
        if axes.shape != (3,) or not (np.isfinite(axes) & (axes > 0)).all():
            raise InputError(
                f"The orbit's semi-axes {axes.tolist()} mm span no ellipsoid; give three positive "
                "lengths.",
                code="orbit.semi_axes",
                argument="semi_axes",
            )

    def points(self, azimuth_deg: ArrayLike, elevation_deg: ArrayLike) -> FloatArray:
        """(n, 3) array, mm, world: the points of n azimuths and n elevations, degree."""
        (cos_a, sin_a), (cos_e, sin_e) = _cos_sin(azimuth_deg), _cos_sin(elevation_deg)
        unit = np.stack((cos_e * cos_a, cos_e * sin_a, sin_e + 0.0 * cos_a), axis=-1)
        if self.angles == "parameter":
            return np.asarray(self.centre + self.semi_axes_mm * unit)
        reach = 1.0 / np.linalg.norm(unit / self.semi_axes_mm, axis=-1, keepdims=True)
        return np.asarray(self.centre + reach * unit)


def _cos_sin(degrees: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Cosine and sine, such that mirrored angles give mirrored values to the last bit."""
    # fmod and the quarter turns are exact, so only the rest below 45 degrees is rounded.
    angle = np.fmod(np.asarray(degrees, dtype=np.float64), 360.0)
    quarter = np.rint(angle / 90.0)
    rest = np.radians(angle - 90.0 * quarter)
    turns = quarter.astype(np.int64) % 4
    cosine, sine = np.cos(rest), np.sin(rest)
    return (
        np.choose(turns, (cosine, -sine, -cosine, sine)),
        np.choose(turns, (sine, cosine, -sine, -cosine)),
    )


def orbit_poses(
    orbit: Orbit,
    azimuth_deg: ArrayLike,
    elevation_deg: ArrayLike,
    target: ArrayLike | None = None,
) -> PoseSet:
    """Cameras at every combination of azimuth and elevation.

    Parameters
    ----------
    orbit : Orbit
    azimuth_deg : (n,) array, degree
        One that equals another but for full turns, as 360 and 0, counts once.
    elevation_deg : (m,) array, degree
        Between -90 and 90. At either end there is one pose only, with azimuth 0.
    target : (3,) array, mm, world, optional
        Where the optical axes meet; the orbit's centre by default.

    Returns
    -------
    PoseSet
        Elevation by elevation, at each all azimuths. See `aimed` for the roll.

    Raises
    ------
    InputError
        If an angle is not finite or beyond a pole, there are too many poses, or a camera stands on
        the target.
    """
    azimuths = np.atleast_1d(np.asarray(azimuth_deg, dtype=np.float64)).ravel()
    elevations = np.atleast_1d(np.asarray(elevation_deg, dtype=np.float64)).ravel()
    _check_angles(azimuths, elevations)
    _, first = np.unique(np.remainder(azimuths, 360.0), return_index=True)
    azimuths = azimuths[np.sort(first)]
    pairs = [
        (azimuth, elevation)
        for elevation in elevations.tolist()
        for azimuth in ([0.0] if abs(elevation) == 90.0 else azimuths.tolist())
    ]
    azimuth, elevation = np.array(pairs, dtype=np.float64).reshape(-1, 2).T
    return _posed(orbit, azimuth, elevation, target)


def _check_angles(azimuths: FloatArray, elevations: FloatArray) -> None:
    """Refuse angles without a pose."""
    if not (np.isfinite(azimuths).all() and np.isfinite(elevations).all()):
        raise InputError(
            "An azimuth or elevation is not finite; give degrees.", code="poses.not_finite"
        )
    if len(elevations) and np.abs(elevations).max() > 90.0:
        steepest = elevations[int(np.argmax(np.abs(elevations)))]
        raise InputError(
            f"Elevation {steepest:g} degrees lies beyond the pole, where the azimuth turns round; "
            "give -90 to 90 and the opposite azimuth.",
            code="poses.beyond_pole",
            argument="elevation",
        )
    if len(azimuths) * len(elevations) > _MOST_VALUES:
        raise InputError(
            f"{len(azimuths)} azimuths at {len(elevations)} elevations are more than "
            f"{_MOST_VALUES} poses, which no sweep gets through; give fewer.",
            code="poses.too_many",
        )


def fibonacci_poses(orbit: Orbit, count: int, target: ArrayLike | None = None) -> PoseSet:
    """Cameras spread evenly in all directions: a spherical Fibonacci lattice.

    The lattice is that of Swinbank and Purser (2006) with midpoints: sin e = 1 - (2 i + 1) / count,
    A = i times the golden angle. It is even in the orbit's angles; on a longish ellipsoid
    geocentric angles spread the directions evenly, parameters do so after stretching to a sphere.

    Parameters
    ----------
    orbit : Orbit
    count : int
    target : (3,) array, mm, world, optional
        The orbit's centre by default.

    Returns
    -------
    PoseSet
        From the upper pole to the lower, azimuths from 0 to 360.

    Raises
    ------
    InputError
        If there are no or too many poses, or a camera stands on the target.
    """
    if not 1 <= count <= _MOST_VALUES:
        raise InputError(
            f"{count} poses make no sweep; give 1 to {_MOST_VALUES}.",
            code="poses.count",
            argument="fibonacci",
        )
    number = np.arange(count)
    elevation = np.degrees(np.arcsin(1.0 - (2.0 * number + 1.0) / count))
    azimuth = np.remainder(number * GOLDEN_ANGLE_DEG, 360.0)
    return _posed(orbit, azimuth, elevation, target)


def _posed(
    orbit: Orbit, azimuth: FloatArray, elevation: FloatArray, target: ArrayLike | None
) -> PoseSet:
    aim = orbit.centre if target is None else np.asarray(target, dtype=np.float64).reshape(3)
    return PoseSet(aimed(orbit.points(azimuth, elevation), aim), azimuth, elevation)


def semi_axes(part: Part, stand_off_mm: float) -> FloatArray:
    """Half extents of the part plus a stand-off (> 0) on each axis, (3,) array, mm."""
    if not (np.isfinite(stand_off_mm) and stand_off_mm > 0):
        raise InputError(
            f"A stand-off of {stand_off_mm:g} mm puts cameras into the part; give a positive "
            "length.",
            code="orbit.stand_off_not_positive",
            argument="stand_off",
        )
    return np.asarray(0.5 * np.ptp(part.bounds, axis=0) + stand_off_mm)


def default_stand_off(part: Part, camera: Camera) -> float:
    """Stand-off, whole mm, at which cameras like this one have all of a part in focus.

    From every direction the part ends before the far end of the focus. If that needs cameras
    nearer than the middle of the focus, as for a part about as long as the focus, it is the middle.
    Without a far end it is the distance of the `camera` from the part.
    """
    near, far = camera.focus_mm
    if not np.isfinite(far):
        return float(np.ceil(part.surface.distance(camera.origin[None])[0]))
    half = 0.5 * np.ptp(part.bounds, axis=0)
    whole = far - float(half.max() + np.linalg.norm(half))
    return float(round(max(whole, 0.5 * (near + far))))


def turntable_poses(matrix: ArrayLike, table: str, centre: ArrayLike) -> PoseSet:
    """Poses of a camera as a part sees them that turns before it.

    The air turns with the part, which it does where the axis is vertical and there is no draught.
    `matrix` (4, 4), mm, is the camera's pose with the part unturned. The table ``"z:0:360:30"`` has
    the axis, and start, stop and step of the part's angle in degrees, counter-clockwise seen from
    the tip of the axis; a full turn's end is its start and counts once. The centre (3,), mm, world,
    is a point on the axis. Raises InputError for other texts.
    """
    axis, *numbers = table.split(":")
    try:
        start, stop, step = map(float, numbers)
        count = int(np.floor((stop - start) / step + 1e-9)) + 1
        if axis not in _WORLD_AXES or count < 1 or not np.isfinite((start, stop, step)).all():
            raise ValueError
    except (ValueError, ZeroDivisionError, OverflowError):
        raise InputError(
            f"{table!r} is not a turntable; give its axis and start, stop and step of its angle in "
            'degrees, such as "z:0:360:30".',
            code="poses.turntable",
            argument="turntable",
        ) from None
    angles = start + step * np.arange(count)
    if count > 1 and np.isclose(angles[-1] - angles[0], 360.0):
        angles = angles[:-1]
    # If the part turns in one direction, the camera moves in the other one relative to it.
    around = np.eye(3)[_WORLD_AXES.index(axis)]
    turns = Rotation.from_rotvec(np.outer(-angles, around), degrees=True).as_matrix()
    pose, point = np.asarray(matrix, dtype=np.float64), np.asarray(centre, dtype=np.float64)
    poses = np.tile(np.eye(4), (len(turns), 1, 1))
    poses[:, :3, :3] = turns @ pose[:3, :3]
    poses[:, :3, 3] = point + turns @ (pose[:3, 3] - point)
    return PoseSet(poses, table_deg=angles)
