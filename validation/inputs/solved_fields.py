"""Simulated air around the bundled parts, of which the tree keeps the part that was solved."""

from __future__ import annotations

from pathlib import Path

import pyvista as pv
from attrs import frozen

from iriftrace.field.index_field import IndexField
from iriftrace.field.read import read_field
from iriftrace.part.part import Part, read_part
from iriftrace.scenes import folder_of

DATA = Path(__file__).parents[1] / "data"


@frozen
class Solved:
    """A field that mirror images complete.

    Attributes
    ----------
    file : str
        Of `DATA`.
    mirrored : str
        Axes along which it is mirrored, such as ``"xy"``.
    scene : str
        The bundled scene that has its part.
    """

    file: str
    mirrored: str
    scene: str

    @property
    def part(self) -> Part:
        """The part in the middle of the air."""
        return read_part(folder_of(self.scene) / "part.ply")

    def field(self, folder: Path) -> IndexField:
        """The whole air, from a file that is written to the folder."""
        pieces = [pv.read(DATA / self.file)]
        for axis in self.mirrored:
            pieces += [piece.reflect(NORMALS[axis]) for piece in pieces]
        whole = folder / self.file
        # Reading joins them at the planes of symmetry.
        pv.merge(pieces, merge_points=False).save(whole)
        return read_field(whole)


NORMALS = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0)}

SOLVED = {
    "hybrid_cylinder": Solved("hybrid_cylinder_half.vtu", "y", "hybrid_cylinder"),
    "bevel_gear": Solved("bevel_gear_quarter.vtu", "xy", "bevel_gear"),
    "wishbone": Solved("wishbone_half.vtu", "x", "wishbone"),
    "cylinder_B": Solved("cylinder_B_quarter.vtu", "xy", "cylinder"),
    "cylinder_C": Solved("cylinder_C_quarter.vtu", "xy", "cylinder"),
    "cylinder_D": Solved("cylinder_D_quarter.vtu", "xy", "cylinder"),
}
"""By name; the bundled components' are those of their scenes."""
