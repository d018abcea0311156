"""Surfaces between rings of points, and checks of sizes, for the parametric parts."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError


def circle(radius: float, height: float, angle: FloatArray) -> FloatArray:
    """(n, 3) array: points at n angles (rad) on a circle around z, at a height; mm."""
    return np.column_stack(
        (radius * np.cos(angle), radius * np.sin(angle), np.full(len(angle), height))
    )


def between_rings(rings: Sequence[FloatArray], *, closed: bool) -> tuple[FloatArray, IntArray]:
    """Triangles between each ring and the next, across the shorter diagonal.

    Rings are (n, 3) arrays, mm, equally long; point j of a ring faces point j of the next. Where
    they run counter-clockwise about the direction from one to the next, the triangles' normals
    point away from the axis. `closed` joins the last ring to the first.

    The vertices (r n, 3), mm, and the faces (2 s n, 3): strip by strip, s of them, two triangles
    for each of a strip's n places.
    """
    points = np.asarray(rings, dtype=np.float64)
    count, length, _ = points.shape
    strip = np.arange(count if closed else count - 1)[:, None]
    place = np.arange(length)[None, :]
    above, following = (strip + 1) % count, (place + 1) % length
    a, b = strip * length + place, strip * length + following
    c, d = above * length + place, above * length + following
    vertices = points.reshape(-1, 3)
    first = np.linalg.norm(vertices[a] - vertices[d], axis=-1)
    second = np.linalg.norm(vertices[b] - vertices[c], axis=-1)
    # Equal diagonals of a symmetric part must not differ by their rounding.
    shorter = first <= second * (1.0 + 1e-9)
    along = np.stack((np.stack((a, b, d), -1), np.stack((a, d, c), -1)), axis=2)
    across = np.stack((np.stack((a, b, c), -1), np.stack((b, d, c), -1)), axis=2)
    faces = np.where(shorter[:, :, None, None], along, across)
    return vertices, faces.reshape(-1, 3)


def between_poles(
    rings: Sequence[FloatArray], first_z: float, last_z: float
) -> tuple[FloatArray, IntArray]:
    """Closed surface of rings about z that rise from one pole to another, at heights in mm.

    As `between_rings`, with the two poles as the last vertices, and as the last faces those around
    the first pole and those around the last.
    """
    vertices, faces = between_rings(rings, closed=False)
    count, ring = len(vertices), np.arange(len(rings[0]))
    fans = (
        np.column_stack((np.full(len(ring), pole), around, np.roll(around, -1)))
        for pole, around in ((count, ring[::-1]), (count + 1, count - len(ring) + ring))
    )
    return np.vstack((vertices, (0.0, 0.0, first_z), (0.0, 0.0, last_z))), np.vstack((faces, *fans))


def check_positive(part: str, **lengths: float) -> None:
    """Refuse lengths (mm) that are not positive."""
    for name, value in lengths.items():
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(
                f"The {part}'s {name.replace('_', ' ')} of {value:g} mm makes no solid; give a "
                "positive length."
            )


def check_less(part: str, smaller: tuple[str, float], larger: tuple[str, float], why: str) -> None:
    """Refuse two lengths (name, mm) of which the first is not the smaller one."""
    if not smaller[1] < larger[1]:
        raise InputError(
            f"The {part}'s {smaller[0]} of {smaller[1]:.4g} mm must be less than its {larger[0]} "
            f"of {larger[1]:.4g} mm, because {why}."
        )


def check_count(part: str, name: str, count: int, least: int, most: int) -> None:
    """Refuse a number of pieces that makes no such part, or more triangles than are of use."""
    if not least <= count <= most:
        raise InputError(
            f"A {part} with {count} {name} cannot be made; give {least} to {most} {name}."
        )
