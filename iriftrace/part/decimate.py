"""Fewer triangles for a part, and how far that moves its surface."""

from __future__ import annotations

import numpy as np

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.geometry.query import Surface
from iriftrace.geometry.topology import weld
from iriftrace.geometry.triangles import polydata
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.part.regions import Regions

SAMPLE = 20_000
"""Places of each surface at which its distance from the other is taken."""

FEWEST = 4
"""Triangles of the smallest closed surface."""


def decimate_part(part: Part, faces: int) -> tuple[Part, FloatArray]:
    """Thin out a part to about so many faces, and tell by how much that moves its surface.

    By VTK's quadric decimation (Garland and Heckbert, 1997). The part has the regions of the one
    before, each face that of the nearest face there. Besides, (n,), mm, the distances between the
    two surfaces at corners and face centres of both; at every so many where there are more than
    `SAMPLE`. An InputError if the part has no more triangles than that, or none would be left.
    """
    if not FEWEST <= faces < len(part.faces):
        raise InputError(
            f"{part.path} has {len(part.faces):,} triangles; give a number from {FEWEST} to one "
            "below that."
        )
    # Corners of an STL are the triangles' own; those at one place become one.
    welded = weld(part.vertices)
    mesh = polydata(part.vertices, welded[part.faces]).clean()
    thinned = mesh.decimate(1.0 - faces / len(part.faces)).triangulate()
    made = Surface(thinned.points, thinned.regular_faces)
    middles = made.vertices[made.faces].mean(axis=1)
    region = part.region_of_face[part.surface.nearest(middles)[1]]
    kept, number = np.unique(region, return_inverse=True)
    regions = Regions(number, tuple(part.region_names[index] for index in kept))
    small = part_of_mesh(
        made.vertices, made.faces, name=part.path, length_unit=part.length_unit, regions=regions
    )
    places = (
        (part.surface, np.concatenate((made.corners, middles))),
        (made, np.concatenate((part.surface.corners, part.face_centres))),
    )
    deviation = [one.distance(other[:: len(other) // SAMPLE + 1]) for one, other in places]
    return small, np.concatenate(deviation)
