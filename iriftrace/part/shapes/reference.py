"""Reference artefacts of acceptance tests by VDI/VDE 2634: sphere, ball bar and plate."""

from __future__ import annotations

import numpy as np

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.part.regions import Regions
from iriftrace.part.shapes.rings import (
    between_poles,
    check_count,
    check_less,
    check_positive,
    circle,
)


def sphere(diameter_mm: float = 25.0, *, segments: int = 240) -> Part:
    """Sphere about the origin, its corners on the diameter; its equator has `segments` sides.

    Region ``sphere``. An InputError if the diameter is not positive or there are too few segments.
    """
    vertices, faces = _ball("sphere", diameter_mm, segments)
    regions = Regions(np.zeros(len(faces), dtype=np.int64), ("sphere",))
    return part_of_mesh(vertices, faces, name="sphere", regions=regions)


def ball_bar(diameter_mm: float = 25.0, spacing_mm: float = 100.0, *, segments: int = 240) -> Part:
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
    length_mm: float = 100.0, width_mm: float = 60.0, thickness_mm: float = 10.0, *, cells: int = 40
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
