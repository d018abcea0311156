"""Seams, where a mirror image meets what was solved, and cells that are there twice."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from iriftrace.core.errors import InputError
from iriftrace.field.gradient import cell_corners

FLAT = 1e-4
"""Thickness of a cell over its length, below which it encloses nothing."""

_SCALARS = "iriftrace_scalars"


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
    compared = pv.UnstructuredGrid()
    compared.shallow_copy(grid)
    scalars = [
        values
        for values in map(np.asarray, grid.point_data.values())
        if values.ndim == 1 and np.issubdtype(values.dtype, np.floating)
    ]
    if scalars:
        compared.point_data[_SCALARS] = np.column_stack(scalars)
    joined = compared.clean(
        tolerance=0.0,
        remove_unused_points=False,
        produce_merge_map=False,
        average_point_data=False,
        merging_array_name=_SCALARS if scalars else None,
    )
    if joined.n_points == grid.n_points:
        return grid
    joined.point_data.pop(_SCALARS, None)
    return joined


def refuse_repeated_cells(grid: pv.UnstructuredGrid, path: str) -> None:
    """Refuse a joined grid in which cells lie where others do.

    Raises
    ------
    InputError
    """
    points = np.asarray(grid.points, dtype=np.float64)
    repeated_cells = 0
    for _, corners in cell_corners(grid).values():
        ranked = np.sort(corners, axis=1)
        ranked = ranked[np.lexsort(ranked.T)]
        repeated = ranked[1:][(ranked[1:] == ranked[:-1]).all(axis=1)]
        # Flat ones enclose no air; pieces of a solver's polyhedra are sometimes such twins.
        offsets = points[repeated] - points[repeated].mean(axis=1, keepdims=True)
        sizes = np.linalg.svd(offsets, compute_uv=False)
        repeated_cells += int((sizes[:, 2] > FLAT * sizes[:, 0]).sum())
    if repeated_cells:
        raise InputError(
            f"{repeated_cells} cells of {path} lie where others do, so it is not clear which air "
            "is meant; export each cell once, and mirror only what was solved, not the whole."
        )
