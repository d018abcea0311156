"""Cells without values: marked in the file as hidden, duplicate or not valid, or NaN."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from attrs import frozen

from iriftrace.core.arrays import AnyArray, BoolArray, as_float64
from iriftrace.core.errors import InputError, warn

# Written by VTK's probe and resampling filters: 0 where the source has no value, and less than 1
# where a later filter has averaged such points.
_VALID = ("vtkvalidpointmask", "vtkvalidcellmask")
_GHOSTS = ("vtkGhostType", "vtkGhostLevels")
_HIDDEN_POINT = 2
"""Bit of a point's vtkGhostType for hidden points; the other bit marks copies with values."""


@frozen(eq=False)
class Unmarked:
    """The cells of a data set that are not marked."""

    cells: pv.UnstructuredGrid
    left_out: int  # number of marked cells
    names: frozenset[str]  # arrays that mark them


def unmarked(block: pv.DataSet) -> Unmarked:
    """Remove cells that are ghosts of any kind, not valid, or have a hidden corner."""
    grid, ghosts = _unblanked(block)
    points = np.zeros(grid.n_points, dtype=bool)
    cells = np.zeros(grid.n_cells, dtype=bool)
    names: set[str] = set()
    for data, kind, mask in ((grid.point_data, "point", points), (grid.cell_data, "cell", cells)):
        found = {n: ~(as_float64(data[n]) >= 1.0) for n in data if n.lower() in _VALID}
        found |= {name: _ghosts(values, kind) for name, values in ghosts[kind].items()}
        for name, marked in found.items():
            mask |= marked
            names.update([name] if marked.any() else [])
    if points.any():
        cells |= _at_corners(grid, points)
    if cells.any():
        grid = chosen_cells(grid, np.flatnonzero(~cells))
    return Unmarked(grid, int(np.count_nonzero(cells)), frozenset(names))


def without_gaps(grid: pv.UnstructuredGrid, name: str, path: str) -> pv.UnstructuredGrid:
    """The grid without cells at which an array is NaN, with a warning that states their number.

    Returns the grid itself if there are none. Raises InputError if no cell is left.
    """
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
            "export a dataset with a solution."
        )
    there = f"the {np.count_nonzero(cells)} cells there" if at_points else "they"
    warn(
        f"{what}{np.count_nonzero(missing)} of {len(missing)} {places}; {there} are left out, and "
        "rays stay straight there.",
        stacklevel=3,
    )
    return chosen_cells(grid, np.flatnonzero(~cells))


def chosen_cells(grid: pv.UnstructuredGrid, numbers: AnyArray) -> pv.UnstructuredGrid:
    """The cells with the given numbers, with the points that they use and all data."""
    chosen: pv.UnstructuredGrid = grid.extract_cells(numbers)
    return chosen


def _at_corners(grid: pv.UnstructuredGrid, points: BoolArray) -> BoolArray:
    """Mask (c,) of the cells that have a corner among the masked (n,) points."""
    starts = np.asarray(grid.cell_offsets, dtype=np.int64)
    cell = np.repeat(np.arange(grid.n_cells), np.diff(starts))
    mask = np.zeros(grid.n_cells, dtype=bool)
    mask[cell[points[np.asarray(grid.cell_connectivity)]]] = True
    return mask


def _unblanked(block: pv.DataSet) -> tuple[pv.UnstructuredGrid, dict[str, dict[str, AnyArray]]]:
    """All cells as an unstructured grid, and the ghost marks of its points and cells.

    VTK removes some kinds of marked cells of images by itself, without counting them.
    """
    shown = block.copy(deep=False)
    ghosts: dict[str, dict[str, AnyArray]] = {}
    for kind, data in (("point", shown.point_data), ("cell", shown.cell_data)):
        ghosts[kind] = {name: np.array(data.pop(name)) for name in _GHOSTS if name in data}
    if not isinstance(shown, pv.UnstructuredGrid):
        shown = shown.cast_to_unstructured_grid()
    return shown, ghosts


def _ghosts(values: AnyArray, kind: str) -> BoolArray:
    marks = values.astype(np.int64)
    mask: BoolArray = (marks & _HIDDEN_POINT) != 0 if kind == "point" else marks != 0
    return mask
