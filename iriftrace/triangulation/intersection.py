"""Points where straight lines of two devices meet, as a sensor's software computes them."""

from __future__ import annotations

import numpy as np

from iriftrace.core.arrays import FloatArray


def nearest_point(
    first_origin: FloatArray, first: FloatArray, second_origin: FloatArray, second: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Midpoint (n, 3) of the shortest segment between skew lines (stereo), and its length (n,), mm.

    Hartley and Zisserman, Multiple View Geometry, 12.2, for lines in space. Origins are (3,) or
    (n, 3) arrays, mm, directions (n, 3) unit vectors, nowhere parallel.
    """
    base = second_origin - first_origin
    cosine = np.vecdot(first, second)
    normal = np.cross(first, second)
    sine_squared = np.einsum("ij,ij->i", normal, normal)
    along_first, along_second = np.vecdot(first, base), np.vecdot(second, base)
    s = (along_first - cosine * along_second) / sine_squared
    t = (cosine * along_first - along_second) / sine_squared
    one = first_origin + s[:, None] * first
    other = second_origin + t[:, None] * second
    return (one + other) / 2, np.linalg.norm(other - one, axis=1)


def on_plane(
    line_origin: FloatArray, line: FloatArray, plane_origin: FloatArray, normal: FloatArray
) -> FloatArray:
    """Points (n, 3), mm, where lines meet planes (fringe projection, sheets of light).

    Origins are (3,) or (n, 3) arrays, mm; directions and normals (n, 3) arrays.
    """
    reach = np.vecdot(normal, plane_origin - line_origin) / np.vecdot(normal, line)
    points: FloatArray = line_origin + reach[:, None] * line
    return points
