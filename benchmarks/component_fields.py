"""The simulated air of the bundled components, of which the tree keeps the part that was solved."""

from __future__ import annotations

from pathlib import Path

import pyvista as pv

from iriftrace.field import read_field
from iriftrace.index_field import IndexField

DATA = Path(__file__).parents[1] / "tests" / "data"
SOLVED = {
    "hybrid_cylinder": ("hybrid_cylinder_half.vtu", "y"),
    "bevel_gear": ("bevel_gear_quarter.vtu", "xy"),
    "wishbone": ("wishbone_half.vtu", "x"),
}
"""For each bundled scene the file, and the axes along which it is mirrored."""

NORMALS = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0)}


def component_field(name: str, folder: Path) -> IndexField:
    """The air of one of `SOLVED`, completed by mirror images in a file of the folder."""
    file, axes = SOLVED[name]
    pieces = [pv.read(DATA / file)]
    for axis in axes:
        pieces += [piece.reflect(NORMALS[axis]) for piece in pieces]
    whole = folder / f"{name}.vtu"
    # Reading joins them at the planes of symmetry.
    pv.merge(pieces, merge_points=False).save(whole)
    return read_field(whole)
