"""A small hot block in still air as a user's files: a field with a cavity, and the part in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv
import trimesh
from attrs import frozen

from validation.field_files.openfoam_mesh import Patch

AMBIENT = 293.15
WALL = 1293.15
HALF = 6.0
"""Half the edge of the block, mm; the air reaches to three times as far."""
OUTER = 3 * HALF


@frozen
class HotBlock:
    """Absolute names of a user's files; tests read them and copy what they change."""

    folder: Path
    field: Path
    part: Path
    scene: Path
    image: Path


def air(cells: int = 18) -> pv.UnstructuredGrid:
    """Hexahedra around the block; T falls linearly with the distance to it, to ambient at 9 mm."""
    axis = np.linspace(-OUTER, OUTER, cells + 1)
    grid = pv.StructuredGrid(*np.meshgrid(axis, axis, axis, indexing="ij"))
    grid = grid.cast_to_unstructured_grid()
    centres = np.abs(np.asarray(grid.cell_centers().points))
    around = grid.extract_cells(np.flatnonzero((centres > HALF).any(axis=1)))
    outside = np.maximum(np.abs(np.asarray(around.points)) - HALF, 0.0)
    distance = np.linalg.norm(outside, axis=1)
    bare = pv.UnstructuredGrid()
    bare.copy_structure(around)
    bare.point_data["T"] = AMBIENT + (WALL - AMBIENT) * np.maximum(1.0 - distance / 9.0, 0.0)
    return bare


def half(grid: pv.UnstructuredGrid) -> pv.UnstructuredGrid:
    """The air on one side of x = 0, as if the other were not mirrored yet."""
    return grid.extract_cells(np.flatnonzero(np.asarray(grid.cell_centers().points)[:, 0] > 0.0))


def air_in_metres(cells: int = 6) -> pv.UnstructuredGrid:
    """The same air as OpenFOAM has it."""
    grid = air(cells)
    grid.points = np.asarray(grid.points, dtype=np.float64) / 1e3
    return grid


def patches(block: float | None = WALL, outside: float | None = None) -> list[Patch]:
    """Boundary of this air in an OpenFOAM case: wall and outside with their temperatures."""
    return [
        Patch("block", "wall", lambda c: (np.abs(c) < 1.001e-3 * HALF).all(axis=1), block),
        Patch("outside", "patch", lambda c: np.ones(len(c), dtype=bool), outside),
    ]


def block() -> trimesh.Trimesh:
    """The part: a cube that fills the cavity."""
    return trimesh.creation.box(extents=(2 * HALF,) * 3)


def save(folder: Path) -> tuple[Path, Path]:
    """Write the field and the part; returns both names."""
    field, part = folder / "air.vtu", folder / "block.stl"
    air().save(field)
    block().export(part)
    return field, part


CAMERA = (
    "--resolution=120,100 --scale=1 --sensor=6,5 --focal-length=20 --focus=50:250 "
    "--origin=60,-45,70"
).split()
"""A camera that has the whole block in view and in focus."""
