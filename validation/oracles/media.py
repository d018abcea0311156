"""Media whose rays have closed forms, and rays led through them by the engine's own step.

With v = n times the direction, the ray equation is dx/dt = v, dv/dt = grad(n^2) / 2, where dt is
the path's length over n.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.plugins.kernels.nystrom import nystrom_step

FloatArray = NDArray[np.float64]
Medium = Callable[[Any, Any, Any], tuple[Any, tuple[Any, Any, Any]]]
"""From coordinates to n^2 and its gradient."""


def parabola_um(length_mm: float, index: float, slope: float) -> float:
    """Height of a ray after a length in air with n^2 = index^2 + slope y, launched along x.

    With dx/ds = n times the direction, x = index s and y = slope s^2 / 4.
    """
    return 1e3 * slope / 4 * (length_mm / index) ** 2


AIR_INDEX = 1.0002718
AIR_SLOPE = 2 * AIR_INDEX * 1e-5
AIR_PARABOLA_UM = {length: parabola_um(length, AIR_INDEX, AIR_SLOPE) for length in (100, 200, 500)}
"""Heights after lengths in mm."""

ROD_INDEX, ROD_G = 1.5, 0.1
LUNEBURG_HEIGHT = 0.5


def luneburg(x: Any, y: Any, z: Any) -> tuple[Any, tuple[Any, Any, Any]]:
    """n^2 = 2 - r^2: parallel rays meet in one point of the unit sphere."""
    return 2 - (x * x + y * y + z * z), (-2 * x, -2 * y, -2 * z)


def fish_eye(x: Any, y: Any, z: Any) -> tuple[Any, tuple[Any, Any, Any]]:
    """n = 2 / (1 + r^2), Maxwell's: every point p has its image at -p / |p|^2."""
    shape = 1 / (1 + x * x + y * y + z * z)
    slope = -16 * shape * shape * shape
    return 4 * shape * shape, (slope * x, slope * y, slope * z)


def linear_air(x: Any, y: Any, z: Any) -> tuple[Any, tuple[Any, Any, Any]]:
    """n^2 = n0^2 + a y, in the scale of air: rays are parabolas."""
    return AIR_INDEX**2 + AIR_SLOPE * y, (0 * x, 0 * y + AIR_SLOPE, 0 * z)


def rod(x: Any, y: Any, z: Any) -> tuple[Any, tuple[Any, Any, Any]]:
    """n^2 = n0^2 (1 - g^2 y^2), a SELFOC rod: rays swing about its axis."""
    square = ROD_INDEX**2
    return square * (1 - ROD_G**2 * y * y), (0 * x, -2 * square * ROD_G**2 * y, 0 * z)


@frozen(eq=False)
class Launch:
    """A ray whose end is known.

    Attributes
    ----------
    medium : callable
    start, velocity : (3,) arrays
        Velocity: index times direction.
    time : float
        Length of the parameter t.
    end : (3,) array
    division : int
        Steps per requested step; more where the ray turns several times.
    """

    medium: Medium
    start: FloatArray
    velocity: FloatArray
    time: float
    end: FloatArray
    division: int = 1


class Walk(NamedTuple):
    """Where a ray came to."""

    end: FloatArray
    velocity: FloatArray
    velocity_error: float  # sum of the steps' estimated errors of the velocity
    drift: float  # largest | |v| / n - 1 | after any step


def index_at(medium: Medium, point: FloatArray) -> float:
    """Refractive index at a point."""
    return float(np.sqrt(medium(*point)[0]))


def launches() -> dict[str, Launch]:
    """Rays by the name of their medium."""
    height = LUNEBURG_HEIGHT
    lens_start = np.array((-np.sqrt(1 - height**2), height, 0.0))
    eye_start, eye_heading = np.array((-0.6, 0.2, 0.0)), np.array((0.6, 0.8, 0.0))
    # The velocity along the rod stays what it was at the height where the ray runs along it.
    along = ROD_INDEX * np.sqrt(1 - (2 * ROD_G) ** 2)
    return {
        "Luneburg lens": Launch(
            luneburg, lens_start, np.array((1.0, 0, 0)), np.pi / 2, np.array((1.0, 0, 0))
        ),
        "Maxwell fish-eye": Launch(
            fish_eye,
            eye_start,
            eye_heading * index_at(fish_eye, eye_start),
            fish_eye_time(eye_start, eye_heading),
            -eye_start / (eye_start @ eye_start),
        ),
        "parabolic rod": Launch(
            rod,
            np.array((0.0, 2.0, 0.0)),
            np.array((along, 0, 0)),
            100.0,
            np.array((100 * along, 2 * np.cos(100 * ROD_INDEX * ROD_G), 0)),
            division=10,
        ),
    }


def parabola(length_mm: float) -> Launch:
    """The ray in air with a constant gradient, launched across it, after a length."""
    return Launch(
        linear_air,
        np.zeros(3),
        np.array((AIR_INDEX, 0, 0)),
        length_mm / AIR_INDEX,
        np.array((length_mm, AIR_PARABOLA_UM[int(length_mm)] / 1e3, 0)),
    )


def fish_eye_time(start: FloatArray, direction: FloatArray) -> float:
    """Parameter from a point to its image.

    The fish-eye is the stereographic picture p = (2 r, r^2 - 1) / (1 + r^2) of a sphere on which
    n ds is the arc and n = 1 - p_z (p's last component). Rays are great circles, and dt = ds / n is
    integrated as d(arc) / n^2 over half of one.
    """
    squared = start @ start
    place = np.append(2 * start, squared - 1) / (1 + squared)
    # The projection's differential, applied to the direction; it keeps angles.
    slant = start @ direction
    along = np.append(2 * direction * (1 + squared) - 4 * start * slant, 4 * slant)
    along /= np.linalg.norm(along)
    arc, weight = np.polynomial.legendre.leggauss(200)
    arc, weight = (arc + 1) * np.pi / 2, weight * np.pi / 2
    height = np.cos(arc) * place[3] + np.sin(arc) * along[3]
    return float(weight @ (1 / (1 - height) ** 2))


def walk(medium: Medium, start: FloatArray, velocity: FloatArray, time: float, steps: int) -> Walk:
    """Lead a ray through a medium by equal steps of the engine's own rule."""
    import drjit as dr
    import mitsuba as mi

    def acceleration(point: Any) -> Any:
        return mi.Vector3d(*medium(point.x, point.y, point.z)[1]) / 2

    point, heading = mi.Point3d(*map(float, start)), mi.Vector3d(*map(float, velocity))
    velocity_error, drift = mi.Float64(0), mi.Float64(0)
    for _ in range(steps):
        step = nystrom_step(point, heading, acceleration, mi.Float64(float(time / steps)))
        point, heading = mi.Point3d(step.point), step.velocity
        square = medium(point.x, point.y, point.z)[0]
        drift = dr.maximum(drift, dr.abs(dr.norm(heading) / dr.sqrt(square) - 1))
        velocity_error += dr.norm(step.velocity_error)
        dr.eval(point, heading, velocity_error, drift)
    return Walk(
        np.array(point)[:, 0], np.array(heading)[:, 0], float(velocity_error[0]), float(drift[0])
    )


def end_error(launch: Launch, steps: int) -> float:
    """Distance from the exact end, relative to that end's distance from the origin."""
    found = walk(launch.medium, launch.start, launch.velocity, launch.time, steps * launch.division)
    return float(np.linalg.norm(found.end - launch.end) / np.linalg.norm(launch.end))
