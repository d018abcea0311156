"""A solver's result as one unstructured grid of linear volume cells, whatever wrote it."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from warnings import warn

import numpy as np
import pyvista as pv
from attrs import evolve

from iriftrace.errors import InputError, IriftraceWarning
from iriftrace.field_cells import CORNERS, IntArray
from iriftrace.field_origin import WALL_HEAT, origin_of, state_origin, wall_heat_of
from iriftrace.field_seams import refuse_cells_twice, without_seams
from iriftrace.readers import comsol_text, openfoam_case, vtk_file
from iriftrace.readers.contents import Contents
from iriftrace.readers.kinds import kind_of

_READERS = {"vtk": vtk_file.read, "comsol": comsol_text.read}

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


def read_volume(path: str | Path, *, member: int | None = None) -> pv.UnstructuredGrid:
    """Read the volume cells of a file; see `open_volume`, which tells more of what it states.

    Raises
    ------
    InputError
        As `open_volume`; or the file holds scattered points, which become a volume only where the
        part is cut out (`iriftrace.field.read_field`).
    """
    contents = open_volume(path, member=member)
    if contents.scattered:
        raise InputError(
            f"{path} holds scattered points, whose hull includes the part; give the part, or "
            "export the elements too (sectionwise)."
        )
    volume: pv.UnstructuredGrid = contents.data
    return volume


def open_volume(path: str | Path, *, member: int | None = None, flow: bool = False) -> Contents:
    """Read the volume cells of a file, and what it states about units.

    Blocks (`.vtm`, `.pvd`) and pieces (`.pvtu`) are joined at points that coincide exactly, and the
    two sides of a seam inside a file (`iriftrace.field_seams`). Voxels become hexahedra; polyhedra
    and prisms with more than three sides are split into tetrahedra (OpenFOAM's around their
    centroids); cells of higher order keep only their corners. Cells that are not volumes are left
    out, and then points that no cell uses.

    Parameters
    ----------
    path : str or Path
        A file of `iriftrace.readers.kinds.SUFFIXES`, or the folder of an OpenFOAM case.
    member : int, optional
        Which state of a file with several, as `iriftrace.readers.members` counts them; the last
        one when left out, with a warning.
    flow : bool, optional
        Whether velocities are wanted at the points of an OpenFOAM case, which take memory; other
        files are read whole in any case.

    Returns
    -------
    Contents
        `data` are tetrahedra, hexahedra, wedges and pyramids with the file's point and cell data,
        in the file's own length unit; as field data only what the file says of its origin
        and of the heat from the part.

    Raises
    ------
    InputError
        The file is missing, of another type, damaged, or has no volume cells.
    """
    path = Path(path)
    kind = kind_of(path)
    if kind == "openfoam":
        contents = openfoam_case.read(path, member, flow=flow)
    else:
        contents = _READERS[kind](path, member)
    if member is None and len(contents.states) > 1:
        warn(
            f"{path} has {len(contents.states)} states; the last one, {contents.states[-1][0]}, "
            "is used; choose another with the time option (--time).",
            IriftraceWarning,
            stacklevel=4,
        )
    grid = _joined(contents.data, path)
    if np.isin(np.asarray(grid.celltypes), list(_HIGHER_ORDER)).any():
        warn(
            f"{path} has cells of higher order; only the values at their corners are used.",
            IriftraceWarning,
            stacklevel=4,
        )
    origin = "; ".join(filter(None, (contents.origin, origin_of(contents.data))))
    pieces = linear_volume(grid)
    volume = without_seams(pieces)
    if volume is not pieces or isinstance(contents.data, pv.MultiBlock):
        refuse_cells_twice(volume, str(path))
    heat = wall_heat_of(contents.data)
    volume.clear_field_data()
    state_origin(volume, origin)
    if heat is not None:
        volume.field_data[WALL_HEAT] = [heat]
    return evolve(contents, data=volume)


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


def _joined(data: Any, path: Path) -> Any:
    """The volume cells of all blocks as one grid."""
    blocks = [_volume_cells(block) for block in vtk_file.blocks_of(data)]
    blocks = [block for block in blocks if block.n_cells]
    if not blocks:
        raise InputError(
            f"{path} has no volume cells: it is empty, damaged or a surface, and light needs the "
            "air between; export the solver's volume mesh."
        )
    if len(blocks) > 1:
        return pv.MultiBlock(blocks).combine(merge_points=True, tolerance=0.0)
    return blocks[0].clean(tolerance=0.0) if path.suffix.lower() == ".pvtu" else blocks[0]


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
