"""Simulated air around the bundled parts, of which the tree keeps the part that was solved."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv
from attrs import evolve, frozen

from iriftrace.camera.camera import Camera
from iriftrace.camera.pose import look_at
from iriftrace.io.field import read_field
from iriftrace.io.part_files import read_part
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.tetrahedra import tetrahedra_of
from iriftrace.part.part import Part
from iriftrace.scenes import folder_of

DATA = Path(__file__).parents[1] / "data"

Position = tuple[float, float, float]

VIEWS: dict[str, Position] = {
    "corner": (150.0, -100.0, 120.0),
    "45 degrees above": (0.0, -160.0, 160.0),
    "along the axis": (235.0, 0.0, 0.0),
    "oblique": (60.0, -190.0, 110.0),
}
"""Camera position for the cylinder, mm."""


@frozen
class Solved:
    """A field that mirror images complete.

    Attributes
    ----------
    path : Path
    mirrored : str
        Axes along which it is mirrored, such as ``"xy"``.
    scene : str
        The bundled scene that has its part.
    """

    path: Path
    mirrored: str
    scene: str

    @property
    def part(self) -> Part:
        """The part in the middle of the air."""
        return read_part(folder_of(self.scene) / "part.ply")

    def field(self, folder: Path) -> IndexField:
        """The whole air; if it has to be completed, from a file written to the folder."""
        if not self.mirrored:
            return read_field(self.path)
        pieces = [pv.read(self.path)]
        for axis in self.mirrored:
            pieces += [piece.reflect(NORMALS[axis]) for piece in pieces]
        whole = folder / self.path.name
        # Reading joins them at the planes of symmetry.
        pv.merge(pieces, merge_points=False).save(whole)
        return read_field(whole)


NORMALS = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0)}

SOLVED = {
    "cylinder": Solved(folder_of("cylinder") / "field.vtu", "", "cylinder"),
    "cylinder_A": Solved(DATA / "cylinder_A.vtu", "", "cylinder"),
    "cylinder_B": Solved(DATA / "cylinder_B_quarter.vtu", "xy", "cylinder"),
    "cylinder_C": Solved(DATA / "cylinder_C_quarter.vtu", "xy", "cylinder"),
    "cylinder_D": Solved(DATA / "cylinder_D_quarter.vtu", "xy", "cylinder"),
    "hybrid_cylinder": Solved(DATA / "hybrid_cylinder_half.vtu", "y", "hybrid_cylinder"),
    "bevel_gear": Solved(DATA / "bevel_gear_quarter.vtu", "xy", "bevel_gear"),
    "wishbone": Solved(DATA / "wishbone_half.vtu", "x", "wishbone"),
}
"""By name; the cylinder's from the bundled coarse one to the finest."""


def camera_at(origin: Position) -> Camera:
    """The paper's camera, at a quarter of its resolution, sharp everywhere."""
    return Camera(
        focal_length_mm=10.0,
        sensor_mm=(6.7, 5.6),
        resolution=(612, 512),
        matrix=look_at(origin, (0.0, 0.0, 0.0)),
    )


def in_tetrahedra(field: IndexField) -> IndexField:
    """The same values in the tetrahedra of the cells engine."""
    corners = tetrahedra_of(field.grid).corners.astype(np.int64)
    points = np.asarray(field.grid.points)
    return evolve(field, grid=pv.UnstructuredGrid({pv.CellType.TETRA: corners}, points))
