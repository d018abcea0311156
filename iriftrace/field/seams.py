"""Points of a volume mesh that lie at one place, as where a mirror image meets what was solved."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from iriftrace.core.errors import InputError
from iriftrace.field.gradient import cell_corners

FLAT = 1e-4
"""Thickness of a cell over its length, below which it encloses nothing."""


def without_seams(grid: pv.UnstructuredGrid) -> pv.UnstructuredGrid:
    """The same cells, joined where points coincide exactly and have the same values.

    ParaView's Reflect leaves the halves side by side, and so do some exports with several domains:
    each ends at the seam, where a ray would leave the data and a gradient look to one side only.
    Vectors need not agree, because a mirror turns them; where a value differs, it jumps there, as
    on both sides of a thin wall, and the points stay apart. A wall without thickness that is
    equally hot on both sides cannot be told from a seam; give it one.

    Parameters
    ----------
    grid : pyvista.UnstructuredGrid

    Returns
    -------
    pyvista.UnstructuredGrid
        The grid itself if nothing coincides; else one with the data of the first of such points.
    """
    if not _coincides(grid):
        return grid
    scalars = [
        values
        for values in (np.asarray(array) for array in grid.point_data.values())
        if values.ndim == 1 and np.issubdtype(values.dtype, np.floating)
    ]
    first = _first_alike(np.column_stack((grid.points, *scalars)))
    kept = first == np.arange(len(first))
    if kept.all():
        return grid
    number = (np.cumsum(kept) - 1)[first]
    joined = pv.UnstructuredGrid(
        _renumbered(grid, number), np.asarray(grid.celltypes), np.asarray(grid.points)[kept]
    )
    for name, array in grid.point_data.items():
        joined.point_data[name] = np.asarray(array)[kept]
    for name, array in grid.cell_data.items():
        joined.cell_data[name] = np.asarray(array)
    for name, array in grid.field_data.items():
        joined.field_data[name] = array
    return joined


def refuse_cells_twice(grid: pv.UnstructuredGrid, path: str) -> None:
    """Refuse a joined grid in which cells lie where others do.

    Raises
    ------
    InputError
    """
    points = np.asarray(grid.points, dtype=np.float64)
    twice = 0
    for _, corners in cell_corners(grid).values():
        ranked = np.sort(corners, axis=1)
        ranked = ranked[np.lexsort(ranked.T)]
        repeated = ranked[1:][(ranked[1:] == ranked[:-1]).all(axis=1)]
        # Flat ones enclose no air; pieces of a solver's polyhedra are sometimes such twins.
        offsets = points[repeated] - points[repeated].mean(axis=1, keepdims=True)
        sizes = np.linalg.svd(offsets, compute_uv=False)
        twice += int((sizes[:, 2] > FLAT * sizes[:, 0]).sum())
    if twice:
        raise InputError(
            f"{twice} cells of {path} lie where others do, so it is not clear which air is meant; "
            "export each cell once, and mirror only what was solved, not the whole."
        )


def _coincides(grid: pv.UnstructuredGrid) -> bool:
    """Whether any two points do."""
    bare = pv.UnstructuredGrid()
    bare.copy_structure(grid)
    return bool(bare.clean(tolerance=0.0, remove_unused_points=False).n_points < grid.n_points)


def _first_alike(rows: NDArray[np.floating]) -> NDArray[np.int64]:
    """For each row the number of the first equal one."""
    order = np.lexsort(rows.T)
    ranked = rows[order]
    new = np.concatenate(([True], (ranked[1:] != ranked[:-1]).any(axis=1)))
    start = np.flatnonzero(new)[np.cumsum(new) - 1]
    first = np.empty(len(rows), dtype=np.int64)
    # The sort is stable, so the first of equal rows comes first.
    first[order] = order[start]
    return first


def _renumbered(grid: pv.UnstructuredGrid, number: NDArray[np.int64]) -> NDArray[np.int64]:
    """Cells as VTK lists them, each with its count before its points, with other numbers."""
    cells = np.array(grid.cells, dtype=np.int64)
    counts = np.zeros(len(cells), dtype=bool)
    starts = np.asarray(grid.cell_offsets, dtype=np.int64)[:-1]
    counts[starts + np.arange(len(starts))] = True
    cells[~counts] = number[cells[~counts]]
    return cells
