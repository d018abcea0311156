"""Fewer or more triangles for a part: decimation with its error, or shorter edges."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from attrs import evolve

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.core.mesh.topology import weld
from iriftrace.core.mesh.triangles import polydata
from iriftrace.part.part import MOST_FACES, Part, part_of_mesh
from iriftrace.part.regions import Regions
from iriftrace.part.subdivision import Mesh, subdivide

if TYPE_CHECKING:
    import pyvista as pv

SAMPLE = 20_000
"""Number of points of each surface at which its distance from the other is computed."""

FEWEST = 4
"""Number of triangles of the smallest closed surface."""


def decimate_part(part: Part, faces: int) -> tuple[Part, FloatArray]:
    """Decimate a part to about so many faces, and measure how far this moves its surface.

    Uses VTK's quadric decimation (Garland and Heckbert, 1997). Each face gets the region of the
    nearest original face. Also returns the distances, (n,), mm, between the two surfaces at corners
    and face centres of both, or at a sample if there are more than `SAMPLE`. Raises InputError if
    the part does not have more triangles than that, or none would be left.
    """
    if not FEWEST <= faces < len(part.faces):
        raise InputError(
            f"{part.path} has {len(part.faces):,} triangles; give a number from {FEWEST} to one "
            "below that.",
            code="part.triangle_count",
            argument="faces",
        )
    mesh = _welded(part).decimate(1.0 - faces / len(part.faces)).triangulate()
    middles = mesh.points[mesh.regular_faces].mean(axis=1)
    small = _of_mesh(
        part,
        np.asarray(mesh.points, dtype=np.float64),
        mesh.regular_faces,
        part.region_of_face[part.surface.nearest(middles)[1]],
    )
    places = (
        (part.surface, np.concatenate((small.surface.corners, small.face_centres))),
        (small.surface, np.concatenate((part.surface.corners, part.face_centres))),
    )
    deviation = [one.distance(other[:: len(other) // SAMPLE + 1]) for one, other in places]
    return small, np.concatenate(deviation)


def subdivide_part(part: Part, edge_mm: float) -> Part:
    """Split a part's triangles until no edge is longer, mm; its surface does not change.

    See `iriftrace.part.subdivision`. InputError if the length is not positive, or would need more
    triangles than a part may have.
    """
    if not edge_mm > 0:
        raise InputError(
            f"The longest edge is {edge_mm:g} mm; give a positive length.",
            code="part.length_not_positive",
            argument="edge",
        )
    # Three such edges make the largest triangle that may stay; halving takes some times as many.
    usual = 3 * part.area / (math.sqrt(3) / 4 * edge_mm**2)
    welded = _welded(part)
    mesh = Mesh(
        np.asarray(welded.points, dtype=np.float64),
        welded.regular_faces.astype(np.int64),
        np.asarray(welded.cell_data["region"]),
    )
    split = subdivide(mesh, edge_mm, MOST_FACES) if usual <= MOST_FACES else None
    if split is None:
        raise InputError(
            f"Edges of {edge_mm:g} mm need more triangles than the {MOST_FACES:,} that a part may "
            "have; give a longer edge.",
            code="part.too_many_triangles",
            argument="edge",
        )
    return _of_mesh(part, split.vertices, split.faces, split.region)


def _welded(part: Part) -> pv.PolyData:
    """The part's mesh with the region of each face, without those of which two corners are one.

    Corners of an STL are the triangles' own; those at one place become one.
    """
    corners = weld(part.vertices)[part.faces]
    kept = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    mesh = polydata(part.vertices, corners[kept])
    mesh.cell_data["region"] = part.region_of_face[kept]
    cleaned: pv.PolyData = mesh.clean()
    return cleaned


def _of_mesh(part: Part, vertices: FloatArray, faces: IntArray, region: IntArray) -> Part:
    """A mesh of triangles on a part's surface as a part, with the region of each face."""
    kept, number = np.unique(region, return_inverse=True)
    regions = Regions(number, tuple(part.region_names[index] for index in kept))
    if part.drawing is not None:
        raise InputError(
            f"{part.path} has grown unevenly, and new corners have no place in its drawing; change "
            "the triangles of the cold part, and expand it then.",
            code="part.grown_unevenly",
        )
    made = part_of_mesh(
        vertices, faces, name=part.path, length_unit=part.length_unit, regions=regions
    )
    return evolve(made, growth=part.growth)
