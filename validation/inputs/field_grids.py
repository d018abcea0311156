"""Small fields with a temperature that is known everywhere, for several test files."""

from __future__ import annotations

from pathlib import Path

import pyvista as pv

AMBIENT = 293.15


def box(cells: int = 4, size: float = 10.0) -> pv.ImageData:
    """A cube of air from the origin on, with a temperature that rises from ambient along x."""
    grid = pv.ImageData(dimensions=(cells + 1,) * 3, spacing=(size / cells,) * 3)
    grid.point_data["T"] = AMBIENT + 50.0 * grid.points[:, 0]
    return grid


def solid(cells: int = 4) -> pv.UnstructuredGrid:
    return box(cells).cast_to_unstructured_grid()


def saved(grid: pv.DataSet, path: Path) -> Path:
    grid.save(path)
    return path
