"""Cells without values: marked in the file as hidden, duplicate or not valid, or NaN."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from attrs import frozen

from iriftrace.core.arrays import AnyArray, BoolArray, as_float64
from iriftrace.core.errors import InputError, warn
from iriftrace.medium.gradient import corners_in

# Written by VTK's probe and resampling filters: 0 where the source has no value, and less than 1
# where a later filter has averaged such points.
_VALID = ("vtkvalidpointmask", "vtkvalidcellmask")
_GHOSTS = ("vtkGhostType", "vtkGhostLevels")
_HIDDEN_POINT = 2
"""Bit of a point's vtkGhostType for hidden points; the other bit marks copies with values."""
_ANY = -1


@frozen(eq=False)
class Unmarked:
    """The cells of a data set that are not marked."""

    cells: pv.UnstructuredGrid
    left_out: int  # number of marked cells
    names: frozenset[str]  # arrays that mark them


def unmarked(block: pv.DataSet) -> Unmarked:
    """Remove cells that are ghosts of any kind, not valid, or have a hidden corner."""
    grid = block.copy(deep=False)
    # VTK removes some kinds of marked cells of images by itself, without counting them.
    point_marks, cell_marks = (
        {name: np.array(data.pop(name)).astype(np.int64) for name in _GHOSTS if name in data}
        for data in (grid.point_data, grid.cell_data)
    )
    if not isinstance(grid, pv.UnstructuredGrid):
        grid = grid.cast_to_unstructured_grid()
    points = np.zeros(grid.n_points, dtype=bool)
    cells = np.zeros(grid.n_cells, dtype=bool)
    names: set[str] = set()
    for data, marks, bits, mask in (
        (grid.point_data, point_marks, _HIDDEN_POINT, points),
        (grid.cell_data, cell_marks, _ANY, cells),
    ):
        found = {n: ~(as_float64(data[n]) >= 1.0) for n in data if n.lower() in _VALID}
        found |= {name: (values & bits) != 0 for name, values in marks.items()}
        for name, marked in found.items():
            mask |= marked
            names.update([name] if marked.any() else [])
    if points.any():
        cells |= _at_corners(grid, points)
    if cells.any():
        grid = chosen_cells(grid, np.flatnonzero(~cells))
    return Unmarked(grid, int(np.count_nonzero(cells)), frozenset(names))


def without_gaps(grid: pv.UnstructuredGrid, name: str, path: str) -> pv.UnstructuredGrid:
    """The grid without cells where an array is NaN, with a warning; InputError if none is left."""
    at_points = name in grid.point_data
    missing = np.isnan(as_float64(grid.point_data[name] if at_points else grid.cell_data[name]))
    if not missing.any():
        return grid
    cells = _at_corners(grid, missing) if at_points else missing
    what = f"{path} has no number (NaN) for {name!r} at "
    places = "points" if at_points else "cells"
    if cells.all():
        raise InputError(
            f"{what}{np.count_nonzero(missing)} of {len(missing)} {places}, which leaves no cell; "
            "export a dataset with a solution.",
            code="field.no_cells",
        )
    there = f"the {np.count_nonzero(cells)} cells there" if at_points else "they"
    warn(
        f"{what}{np.count_nonzero(missing)} of {len(missing)} {places}; {there} are left out, and "
        "rays stay straight there."
    )
    return chosen_cells(grid, np.flatnonzero(~cells))


def chosen_cells(grid: pv.UnstructuredGrid, numbers: AnyArray) -> pv.UnstructuredGrid:
    """The cells with the given numbers, with the points that they use and all data."""
    chosen: pv.UnstructuredGrid = grid.extract_cells(numbers)
    return chosen


def _at_corners(grid: pv.UnstructuredGrid, points: BoolArray) -> BoolArray:
    """Mask (c,) of the cells that have a corner among the masked (n,) points."""
    cell, corner = corners_in(grid.GetCells())
    mask = np.zeros(grid.n_cells, dtype=bool)
    mask[cell[points[corner]]] = True
    return mask
