"""A solver's result file as one unstructured grid of linear volume cells."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from warnings import warn

import numpy as np
import pyvista as pv
from vtkmodules.vtkCommonCore import vtkObject

from iriftrace.errors import InputError, IriftraceWarning
from iriftrace.field_cells import CORNERS, IntArray

SUFFIXES = (".vtu", ".pvtu", ".vtk", ".vti", ".vtr", ".vts", ".pvd", ".vtm")

# What pyvista and the XML parser behind its .pvd reader raise for damaged files.
_READ_ERRORS = (OSError, ValueError, RuntimeError, TypeError, LookupError, SyntaxError)

# Volume cells that are not used as they are, by VTK's numbers.
_VOXEL = 11
_VOXEL_CORNERS = np.array((0, 1, 3, 2, 4, 5, 7, 6))  # in the order of a hexahedron
_TO_SPLIT = (15, 16, 41, 42)  # prisms on five and six corners, convex sets, polyhedra
_HIGHER_ORDER = {
    **dict.fromkeys((24, 71), 10),
    **dict.fromkeys((25, 29, 33, 72), 12),
    **dict.fromkeys((26, 31, 32, 73), 13),
    **dict.fromkeys((27, 37), 14),
}


def read_volume(path: str | Path) -> pv.UnstructuredGrid:
    """Read the volume cells of a file.

    Blocks (`.vtm`, `.pvd`) and pieces (`.pvtu`) are joined at points that coincide exactly. Of a
    time series the last step is read. Voxels become hexahedra; polyhedra and prisms with more
    than three sides are split into tetrahedra; cells of higher order keep only their corners.
    Cells that are not volumes are left out, and then points that no cell uses.

    Returns
    -------
    pyvista.UnstructuredGrid
        Tetrahedra, hexahedra, wedges and pyramids with the file's point and cell data, in the
        file's own length unit.

    Raises
    ------
    InputError
        The file is missing, of another type, damaged, or has no volume cells.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"The field file {path} does not exist; check the path.")
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(
            f"{path} is not a field file that can be read here; export it as one of "
            f"{', '.join(SUFFIXES)}."
        )
    blocks = [_volume_cells(block) for block in _blocks(_read(path))]
    blocks = [block for block in blocks if block.n_cells]
    if not blocks:
        raise InputError(
            f"{path} has no volume cells: it is empty, damaged or a surface, and light needs the "
            "air between; export the solver's volume mesh."
        )
    if len(blocks) > 1:
        grid = pv.MultiBlock(blocks).combine(merge_points=True, tolerance=0.0)
    elif path.suffix.lower() == ".pvtu":
        grid = blocks[0].clean(tolerance=0.0)
    else:
        grid = blocks[0]
    if np.isin(np.asarray(grid.celltypes), list(_HIGHER_ORDER)).any():
        warn(
            f"{path} has cells of higher order; only the values at their corners are used.",
            IriftraceWarning,
            stacklevel=3,
        )
    return linear_volume(grid)


def linear_volume(grid: Any) -> pv.UnstructuredGrid:
    """Tetrahedra, hexahedra, wedges and pyramids of a pyvista grid, as `read_volume` makes them.

    Parameters
    ----------
    grid : pyvista.DataSet
        Any grid with volume cells.

    Returns
    -------
    pyvista.UnstructuredGrid
        With the grid's point and cell data, without points that no cell uses.
    """
    grid = _volume_cells(grid)
    types = np.asarray(grid.celltypes)
    if np.isin(types, _TO_SPLIT).any():
        # All cells, not only these: else neighbours could split their common face differently.
        grid = grid.triangulate()
        types = np.asarray(grid.celltypes)
    used = np.zeros(grid.n_points, dtype=bool)
    used[np.asarray(grid.cell_connectivity)] = True
    if used.all() and np.isin(types, list(CORNERS)).all():
        volume: pv.UnstructuredGrid = grid
        return volume
    return _rebuilt(grid, types)


def _read(path: Path) -> Any:
    warnings_before = vtkObject.GetGlobalWarningDisplay()
    # VTK writes its complaints about damaged files to stderr; ours follows from the result.
    vtkObject.SetGlobalWarningDisplay(0)
    try:
        if path.suffix.lower() != ".pvd":
            return pv.read(path)
        reader = pv.PVDReader(str(path))
        times = reader.time_values
        reader.set_active_time_value(times[-1])
        if len(times) > 1:
            warn(
                f"{path} has {len(times)} time steps; the last one, {times[-1]:g}, is used.",
                IriftraceWarning,
                stacklevel=4,
            )
        return reader.read()
    except _READ_ERRORS as error:
        raise InputError(
            f"{path} cannot be read ({error}); is it a complete file of its type?"
        ) from error
    finally:
        vtkObject.SetGlobalWarningDisplay(warnings_before)


def _blocks(data: Any) -> Iterator[Any]:
    if isinstance(data, pv.MultiBlock):
        for block in data:
            yield from _blocks(block)
    elif data is not None:
        yield data


def _volume_cells(block: Any) -> pv.UnstructuredGrid:
    """The volume cells of one data set that are not marked as hidden or as ghosts."""
    if isinstance(block, pv.PolyData) or not isinstance(block, pv.DataSet):
        return pv.UnstructuredGrid()
    grid: Any = block
    if not isinstance(block, pv.UnstructuredGrid):
        grid = block.cast_to_unstructured_grid()
    types = np.asarray(grid.celltypes)
    known = (*CORNERS, _VOXEL, *_TO_SPLIT, *_HIGHER_ORDER)
    keep = np.isin(types, known)
    if "vtkGhostType" in grid.cell_data:
        keep &= np.asarray(grid.cell_data["vtkGhostType"]) == 0
    if not keep.all():
        grid = grid.extract_cells(np.flatnonzero(keep))
    volume: pv.UnstructuredGrid = grid
    return volume


def _rebuilt(grid: Any, types: IntArray) -> pv.UnstructuredGrid:
    """The grid with its cells sorted by type and made linear, and with the points they use."""
    starts = np.asarray(grid.cell_offsets, dtype=np.int64)[:-1]
    flat = np.asarray(grid.cell_connectivity, dtype=np.int64)
    order, corners, kinds = [], [], []
    for kind in np.unique(types):
        cells = np.flatnonzero(types == kind)
        target = _HIGHER_ORDER.get(int(kind), 12 if kind == _VOXEL else int(kind))
        columns = _VOXEL_CORNERS if kind == _VOXEL else np.arange(CORNERS[target])
        order.append(cells)
        corners.append(flat[starts[cells, None] + columns])
        kinds.append(np.full(len(cells), target, dtype=np.uint8))
    used, numbers = np.unique(np.concatenate([c.ravel() for c in corners]), return_inverse=True)
    pieces = np.split(numbers, np.cumsum([c.size for c in corners])[:-1])
    lists = [
        np.insert(piece.reshape(c.shape), 0, c.shape[1], axis=1).ravel()
        for piece, c in zip(pieces, corners, strict=True)
    ]
    result = pv.UnstructuredGrid(
        np.concatenate(lists), np.concatenate(kinds), np.asarray(grid.points)[used]
    )
    for name in grid.point_data:
        result.point_data[name] = np.asarray(grid.point_data[name])[used]
    for name in grid.cell_data:
        result.cell_data[name] = np.asarray(grid.cell_data[name])[np.concatenate(order)]
    return result
