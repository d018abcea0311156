"""Points where straight lines of two devices meet, as a sensor's software computes them."""

from __future__ import annotations

import numpy as np

from iriftrace.core.arrays import FloatArray


def nearest_point(
    first_origin: FloatArray,
    first: FloatArray,
    second_origin: FloatArray,
    second: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Midpoint of the shortest way between skew lines (stereo).

    Hartley and Zisserman, Multiple View Geometry, 12.2, for lines in space.

    Parameters
    ----------
    first_origin, second_origin : (3,) or (n, 3) arrays, mm
    first, second : (n, 3) arrays
        Unit directions; nowhere parallel.

    Returns
    -------
    points : (n, 3) array, mm
    gap : (n,) array, mm
        Length of that way.
    """
    base = second_origin - first_origin
    cosine = _dot(first, second)
    sine_squared = np.einsum("ij,ij->i", *2 * (np.cross(first, second),))
    along_first, along_second = _dot(first, base), _dot(second, base)
    s = (along_first - cosine * along_second) / sine_squared
    t = (cosine * along_first - along_second) / sine_squared
    one = first_origin + s[:, None] * first
    other = second_origin + t[:, None] * second
    return (one + other) / 2, np.linalg.norm(other - one, axis=1)


def on_plane(
    line_origin: FloatArray, line: FloatArray, plane_origin: FloatArray, normal: FloatArray
) -> FloatArray:
    """Points (n, 3), mm, where lines meet planes (fringe projection, sheets of light).

    Parameters
    ----------
    line_origin, plane_origin : (3,) or (n, 3) arrays, mm
    line : (n, 3) array
        Directions.
    normal : (n, 3) array
        Of the planes.
    """
    reach = _dot(normal, plane_origin - line_origin) / _dot(normal, line)
    points: FloatArray = line_origin + reach[:, None] * line
    return points


def _dot(one: FloatArray, other: FloatArray) -> FloatArray:
    product: FloatArray = (one * other).sum(axis=1)
    return product
