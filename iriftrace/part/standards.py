"""Standard parts: sphere, ball bar and plate of VDI/VDE 2634, and a cylinder.

Their surfaces are made of rings of points.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.part import sizes
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.part.regions import Regions

_HEAD_RINGS = 3
"""Rings of triangles on a cylinder's head."""


def cylinder(
    diameter_mm: float = sizes.CYLINDER_DIAMETER,
    length_mm: float = sizes.CYLINDER_LENGTH,
    *,
    segments: int = sizes.CYLINDER_SEGMENTS,
    stations: int = sizes.CYLINDER_STATIONS,
) -> Part:
    """Cylinder along x.

    Parameters
    ----------
    diameter_mm
        Of the circle through the polygon's corners.
    length_mm
    segments
        Sides of the polygon.
    stations
        Rows of triangles along the axis.

    Returns
    -------
    Part
        Regions ``lateral``, ``head -x`` and ``head +x``.

    Raises
    ------
    InputError
        A length is not positive or there are too few segments.
    """
    check_positive("cylinder", diameter=diameter_mm, length=length_mm)
    check_count("cylinder", "stations", stations, 1, 1000)
    ends = 0.5 * length_mm * np.linspace(-1.0, 1.0, stations + 1)
    vertices, faces, place = turned(diameter_mm, ends, segments)
    number = np.where(place < 0, 1, np.where(place >= stations, 2, 0))
    regions = Regions(number, ("lateral", "head -x", "head +x"))
    return part_of_mesh(vertices, faces, name="cylinder", regions=regions)


def sphere(
    diameter_mm: float = sizes.SPHERE_DIAMETER, *, segments: int = sizes.SPHERE_SEGMENTS
) -> Part:
    """Sphere about the origin, its corners on the diameter; its equator has `segments` sides.

    Region ``sphere``. An InputError if the diameter is not positive or there are too few segments.
    """
    vertices, faces = _ball("sphere", diameter_mm, segments)
    regions = Regions(np.zeros(len(faces), dtype=np.int64), ("sphere",))
    return part_of_mesh(vertices, faces, name="sphere", regions=regions)


def ball_bar(
    diameter_mm: float = sizes.SPHERE_DIAMETER,
    spacing_mm: float = sizes.SPACING,
    *,
    segments: int = sizes.SPHERE_SEGMENTS,
) -> Part:
    """Two spheres along x, about the origin; what holds them is left out.

    Their centres are a spacing apart. Regions ``sphere -x`` and ``sphere +x``. An InputError as for
    `sphere`, or if they touch.
    """
    check_positive("ball bar", spacing=spacing_mm)
    vertices, faces = _ball("ball bar", diameter_mm, segments)
    check_less("ball bar", ("diameter", diameter_mm), ("spacing", spacing_mm), "the spheres touch")
    half = np.array((0.5 * spacing_mm, 0.0, 0.0))
    number = np.repeat((0, 1), len(faces))
    return part_of_mesh(
        np.vstack((vertices - half, vertices + half)),
        np.vstack((faces, faces + len(vertices))),
        name="ball bar",
        regions=Regions(number, ("sphere -x", "sphere +x")),
    )


def plate(
    length_mm: float = sizes.PLATE_LENGTH,
    width_mm: float = sizes.PLATE_WIDTH,
    thickness_mm: float = sizes.PLATE_THICKNESS,
    *,
    cells: int = sizes.PLATE_CELLS,
) -> Part:
    """Flat plate, its length along x, its width along y and its upper face at z = 0.

    There are `cells` rows of triangles along x and along y. Regions ``plane +z`` and ``rest``. An
    InputError if a length is not positive or there are too few cells.
    """
    check_positive("plate", length=length_mm, width=width_mm, thickness=thickness_mm)
    check_count("plate", "cells", cells, 1, 1000)
    x, y = np.meshgrid(
        0.5 * length_mm * np.linspace(-1, 1, cells + 1),
        0.5 * width_mm * np.linspace(-1, 1, cells + 1),
        indexing="ij",
    )
    upper = np.column_stack((x.ravel(), y.ravel(), np.zeros(x.size)))
    number = np.arange(x.size).reshape(x.shape)
    a, b = number[:-1, :-1].ravel(), number[1:, :-1].ravel()
    c, d = number[1:, 1:].ravel(), number[:-1, 1:].ravel()
    top = np.vstack((np.column_stack((a, b, c)), np.column_stack((a, c, d))))
    bottom = top[:, ::-1] + x.size
    # Along the edge, counter-clockwise as seen from above.
    edge = np.concatenate((number[:-1, 0], number[-1, :-1], number[:0:-1, -1], number[0, :0:-1]))
    after = np.roll(edge, -1)
    sides = np.vstack(
        (
            np.column_stack((edge, edge + x.size, after)),
            np.column_stack((after, edge + x.size, after + x.size)),
        )
    )
    faces = np.vstack((top, bottom, sides))
    regions = Regions(np.where(np.arange(len(faces)) < len(top), 0, 1), ("plane +z", "rest"))
    vertices = np.vstack((upper, upper - (0.0, 0.0, thickness_mm)))
    return part_of_mesh(vertices, faces, name="plate", regions=regions)


def _ball(part: str, diameter: float, segments: int) -> tuple[FloatArray, IntArray]:
    """Vertices and outward faces between circles of latitude about z."""
    check_positive(part, diameter=diameter)
    check_count(part, "segments", segments, 8, 2000)
    radius = 0.5 * diameter
    angle = 2.0 * np.pi * np.arange(segments) / segments
    rows = segments // 2
    latitude = np.pi * (np.arange(1, rows) / rows - 0.5)
    rings = [circle(radius * np.cos(b), radius * np.sin(b), angle) for b in latitude]
    return between_poles(rings, -radius, radius)


def turned(
    diameter: float, ends: FloatArray, segments: int
) -> tuple[FloatArray, IntArray, IntArray]:
    """Vertices, outward faces and the row of each face along x; -1 and the last are heads."""
    check_count("cylinder", "segments", segments, 8, 2000)
    radius = 0.5 * diameter
    angle = 2.0 * np.pi * np.arange(segments) / segments
    inner = radius * np.arange(1, _HEAD_RINGS) / _HEAD_RINGS
    rings = [
        *(circle(r, ends[0], angle) for r in inner),
        *(circle(radius, x, angle) for x in ends),
        *(circle(r, ends[-1], angle) for r in inner[::-1]),
    ]
    vertices, faces = between_poles(rings, ends[0], ends[-1])
    strip = np.repeat(np.arange(len(rings) - 1), 2 * segments) - len(inner)
    row = np.concatenate((strip, np.full(segments, -1), np.full(segments, len(ends))))
    # Circles were drawn around z; cyclic exchange of the axes keeps the orientation.
    return vertices[:, [2, 0, 1]], faces, np.clip(row, -1, len(ends) - 1)


def circle(radius: float, height: float, angle: FloatArray) -> FloatArray:
    """(n, 3) array: points at n angles (rad) on a circle around z, at a height; mm."""
    return np.column_stack(
        (radius * np.cos(angle), radius * np.sin(angle), np.full(len(angle), height))
    )


def between_rings(rings: Sequence[FloatArray]) -> tuple[FloatArray, IntArray]:
    """Triangles between each ring and the next, across the shorter diagonal.

    Rings are (n, 3) arrays, mm, equally long; point j of a ring faces point j of the next. Where
    they run counter-clockwise about the direction from one to the next, the triangles' normals
    point away from the axis.

    The vertices (r n, 3), mm, of r rings, and the faces (2 (r - 1) n, 3): strip by strip, two
    triangles for each of a strip's n places.
    """
    points = np.asarray(rings, dtype=np.float64)
    count, length, _ = points.shape
    strip = np.arange(count - 1)[:, None]
    place = np.arange(length)[None, :]
    above, following = strip + 1, (place + 1) % length
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
    vertices, faces = between_rings(rings)
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
                "positive length.",
                code="part.length_not_positive",
                argument=name,
            )


def check_less(part: str, smaller: tuple[str, float], larger: tuple[str, float], why: str) -> None:
    """Refuse two lengths (name, mm) of which the first is not the smaller one."""
    if not smaller[1] < larger[1]:
        raise InputError(
            f"The {part}'s {smaller[0]} of {smaller[1]:.4g} mm must be less than its {larger[0]} "
            f"of {larger[1]:.4g} mm, because {why}.",
            code="part.conflicting_lengths",
        )


def check_count(part: str, name: str, count: int, least: int, most: int) -> None:
    """Refuse a number of pieces that makes no such part, or more triangles than are of use."""
    if not least <= count <= most:
        raise InputError(
            f"A {part} with {count} {name} cannot be made; give {least} to {most} {name}.",
            code="part.piece_count",
            argument=name,
        )
