"""Prisms and other parts whose shape is known exactly."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from iriftrace.part.part import Part, part_of_mesh
from iriftrace.part.regions import Regions

FloatArray = NDArray[np.float64]


def part_from(mesh: trimesh.Trimesh, regions: Regions | None = None) -> Part:
    """A part of a trimesh mesh, mm."""
    return part_of_mesh(mesh.vertices, mesh.faces, name="part.stl", sha256="0", regions=regions)


def papers_cylinder() -> Part:
    """The paper's cylinder, its axis along x, moved off the origin."""
    mesh = trimesh.creation.cylinder(13.5, 170.0, sections=48)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (0, 1, 0)))
    mesh.apply_translation((5.0, -3.0, 2.0))
    return part_from(mesh)


def bar_of_halves() -> Part:
    """A bar along x of two materials, steel and nickel, that meet at x = 0."""
    mesh = trimesh.creation.box(extents=(100.0, 10.0, 10.0))
    for _ in range(3):
        mesh = mesh.subdivide()
    right = mesh.triangles_center[:, 0] > 0.0
    return part_from(mesh, Regions(right.astype(np.int64), ("steel", "nickel")))


def prism(outline: FloatArray, width: float, name: str = "prism") -> Part:
    """A closed prism about the z axis.

    Parameters
    ----------
    outline : (n, 2) array, mm
        Corners anticlockwise, all to be seen from the origin.
    width : float, mm
    """
    count = len(outline)
    ring = np.column_stack((outline, np.zeros(count)))
    half = np.array((0.0, 0.0, width / 2.0))
    vertices = np.concatenate((ring - half, ring + half, [-half, half]))
    here = np.arange(count)
    following = (here + 1) % count
    below, above = np.full(count, 2 * count), np.full(count, 2 * count + 1)
    faces = np.concatenate(
        [
            np.column_stack(columns)
            for columns in (
                (here, following, following + count),
                (here, following + count, here + count),
                (following, here, below),
                (here + count, following + count, above),
            )
        ]
    )
    return part_of_mesh(vertices, faces, name=name)


def gear(teeth: int = 6, outer: float = 12.0, inner: float = 8.0, width: float = 8.0) -> Part:
    """A spur gear with straight flanks about the z axis, mm."""
    count = 4 * teeth
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    radius = np.where(np.arange(count) % 4 < 2, outer, inner)
    outline = np.column_stack((radius * np.cos(angle), radius * np.sin(angle)))
    return prism(outline, width, "gear")


def cylinder_fine_at(
    angles_deg: ArrayLike, radius: float, length: float, sections: int = 36_000
) -> Part:
    """A cylinder about the x axis with as many facets within a degree of some angles, few between.

    Parameters
    ----------
    angles_deg : array
        About the axis, from y towards z.
    radius, length : float, mm
    sections : int
        Facets of the whole circle, were they all fine: each hundredth vertex is kept elsewhere.
    """
    degrees = np.arange(sections) * 360.0 / sections
    beside = (degrees[:, None] - np.atleast_1d(angles_deg) + 180.0) % 360.0 - 180.0
    kept = (np.abs(beside) < 1.0).any(axis=1) | (np.arange(sections) % 100 == 0)
    angle = np.radians(degrees[kept])
    upright = prism(radius * np.column_stack((np.cos(angle), np.sin(angle))), length)
    # z becomes x, x becomes y, y becomes z.
    turned = np.roll(upright.vertices, 1, axis=1)
    return part_of_mesh(turned, upright.faces, name="cylinder")
