"""Parts for the tests of the OpenFOAM case."""

from __future__ import annotations

import trimesh

from iriftrace.part.part import Part, part_of_mesh
from iriftrace.part.regions import Regions


def part_from(mesh: trimesh.Trimesh, regions: Regions | None = None) -> Part:
    """A part of a trimesh mesh, mm."""
    return part_of_mesh(mesh.vertices, mesh.faces, name="part.stl", sha256="0", regions=regions)
