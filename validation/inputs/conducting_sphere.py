"""Air at rest around a hot sphere, whose heat is that of conduction alone."""

from __future__ import annotations

import numpy as np
import trimesh
from attrs import asdict

from iriftrace.flow.check.finding import FieldCheck
from iriftrace.flow.synthetic.mesh import AirMesh, air_mesh
from iriftrace.flow.synthetic.model import SyntheticAir
from iriftrace.medium.air import thermophysics as gas
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.source import FieldSource
from iriftrace.part.part import Part, part_of_mesh

WALL, ROOM = 1373.15, 293.15
RADIUS, OUTER = 6.0, 12.0


def conducting_sphere(cell: float) -> tuple[IndexField, Part]:
    """Air at rest around a hot sphere: the integral of the conductivity falls with 1/r."""
    mesh = trimesh.creation.icosphere(4, RADIUS)
    part = part_of_mesh(mesh.vertices, mesh.faces, name="sphere")
    grid, on_wall = air_mesh(SyntheticAir(part), AirMesh(cell_mm=cell, sides_mm=8.0, height_mm=8.0))
    radius = np.clip(np.linalg.norm(grid.points, axis=1), RADIUS, OUTER)
    share = (1 / radius - 1 / OUTER) / (1 / RADIUS - 1 / OUTER)
    share[on_wall] = 1.0
    knots = np.linspace(ROOM, WALL, 4000)
    conductivity = gas.conductivity(knots)
    pieces = 0.5 * np.diff(knots) * (conductivity[1:] + conductivity[:-1])
    potential = np.concatenate(([0.0], np.cumsum(pieces)))
    temperature = np.interp(share * potential[-1], potential, knots)
    source = FieldSource("sphere", "0" * 64, "T", "temperature", "mm")
    return IndexField(grid, Air().refractivity(temperature), Air(), source), part


def finding(check: FieldCheck, name: str) -> dict[str, object]:
    """Value, verdict, remark and numbers of one of a check's findings."""
    (found,) = (asdict(f) for f in check.findings if f.name == name)
    return found | found["numbers"]
