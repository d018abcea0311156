"""Volume cells of any grid as linear cells with matching faces.

Gradients and tetrahedra of a field are computed from tetrahedra, hexahedra, wedges and pyramids.
Other cells are converted to these, and the two sides of a seam with separate points are joined.
"""

from __future__ import annotations

import numpy as np
import pyvista as pv

from iriftrace.core.arrays import IntArray
from iriftrace.core.errors import InputError
from iriftrace.medium.cell_means import PLACES
from iriftrace.medium.gradient import (
    CORNERS,
    HEXAHEDRON,
    PYRAMID,
    TETRAHEDRON,
    WEDGE,
    cell_centroids,
    cell_corners,
)
from iriftrace.medium.marked import chosen_cells, unmarked
from iriftrace.medium.polyhedra import SPLIT, split_polyhedra

FLAT = 1e-4
"""Thickness of a cell over its length, below which its volume counts as zero."""

# Volume cells that are converted, by VTK's numbers.
_VOXEL = 11
_VOXEL_CORNERS = np.array((0, 1, 3, 2, 4, 5, 7, 6))  # in the order of a hexahedron
_CONVEX_SET = 41
_HIGHER_ORDER = {
    **dict.fromkeys((24, 71, 78), TETRAHEDRON),
    **dict.fromkeys((25, 29, 33, 72, 79), HEXAHEDRON),
    **dict.fromkeys((26, 31, 32, 73, 80), WEDGE),
    **dict.fromkeys((27, 37, 74, 81), PYRAMID),
}
# Point data that must agree for points to be joined.
_SCALARS = "iriftrace_scalars"
# Distance of points that coincide, as a fraction of the data's extent: files store single precision
# or, where a grid closes on itself, sin(2 pi) for 0.
_ROUNDING = 1e-7
# Fraction of the cells that may coincide: VTK splits polyhedra so, now and then.
_FEW_REPEATED = 1e-2


def linear_volume(grid: pv.UnstructuredGrid) -> pv.UnstructuredGrid:
    """Linear cells of any grid with its data, without points that no cell uses."""
    grid = volume_cells(grid)
    types = np.asarray(grid.celltypes)
    if (types == _CONVEX_SET).any():
        # All cells, not only these: else neighbours could split their common face differently.
        grid = grid.triangulate()
        types = np.asarray(grid.celltypes)
    used = np.zeros(grid.n_points, dtype=bool)
    used[np.asarray(grid.cell_connectivity)] = True
    if used.all() and np.isin(types, list(CORNERS)).all():
        return grid
    return _linear(grid, types.astype(np.int64))


def volume_cells(block: pv.DataObject) -> pv.UnstructuredGrid:
    """The volume cells of one data set; `iriftrace.medium.marked` describes those removed."""
    if isinstance(block, pv.PolyData) or not isinstance(block, pv.DataSet):
        return pv.UnstructuredGrid()
    grid = unmarked(block).cells
    types = np.asarray(grid.celltypes)
    known = (*CORNERS, _VOXEL, _CONVEX_SET, *SPLIT, *_HIGHER_ORDER)
    keep = np.isin(types, known)
    if not keep.all():
        grid = chosen_cells(grid, np.flatnonzero(keep))
    return grid


def has_higher_order(grid: pv.UnstructuredGrid) -> bool:
    """True where `linear_volume` keeps only the corners of some cells."""
    return bool(np.isin(np.asarray(grid.celltypes), list(_HIGHER_ORDER)).any())


def _linear(grid: pv.UnstructuredGrid, types: IntArray) -> pv.UnstructuredGrid:
    """The grid with its cells sorted by type and made linear, and with the points they use."""
    starts = np.asarray(grid.cell_offsets, dtype=np.int64)[:-1]
    flat = np.asarray(grid.cell_connectivity, dtype=np.int64)
    # Point values are interpolated to the means of corners; cell values belong to centroids.
    split = split_polyhedra(grid, at_corner_means=bool(grid.point_data.keys()))
    cells: dict[int, list[IntArray]] = {}
    corners: dict[int, list[IntArray]] = {}
    for kind in np.setdiff1d(types, SPLIT).tolist():
        target = _HIGHER_ORDER.get(kind, HEXAHEDRON if kind == _VOXEL else kind)
        columns = _VOXEL_CORNERS if kind == _VOXEL else np.arange(CORNERS[target])
        of_kind = np.flatnonzero(types == kind)
        cells.setdefault(target, []).append(of_kind)
        corners.setdefault(target, []).append(flat[starts[of_kind, None] + columns])
    for kind, pieces in split.pieces.items():
        cells.setdefault(kind, []).append(split.cells[split.owners[kind]])
        corners.setdefault(kind, []).append(pieces)
    points = np.concatenate(
        (grid.points, split.face_centres, split.centres),
        dtype=np.asarray(grid.points).dtype,
        casting="unsafe",
    )
    used = np.zeros(len(points), dtype=bool)
    for parts in corners.values():
        used[np.concatenate(parts)] = True
    number = np.cumsum(used) - 1
    result = pv.UnstructuredGrid(
        {kind: number[np.concatenate(parts)] for kind, parts in corners.items()}, points[used]
    )
    order = np.concatenate([part for parts in cells.values() for part in parts])
    for name in grid.point_data:
        result.point_data[name] = split.extended(grid, np.asarray(grid.point_data[name]))[used]
    for name in grid.cell_data:
        result.cell_data[name] = np.asarray(grid.cell_data[name])[order]
    if len(split.cells) and grid.cell_data.keys():
        # Centroids of the linear cells, or of the polyhedra of which they are pieces.
        places = cell_centroids(result)
        piece = np.isin(order, split.cells)
        places[piece] = split.centroids[np.searchsorted(split.cells, order[piece])]
        result.cell_data[PLACES] = places
    return result


def without_seams(grid: pv.UnstructuredGrid) -> pv.UnstructuredGrid:
    """The same cells, joined where points coincide and have the same values, up to rounding.

    ParaView's Reflect leaves the two halves unconnected, and so do some exports with several
    domains: each half ends at the seam, where a ray would leave the data and a gradient would use
    one side only. Vectors need not agree, because a mirror reverses them. Where another value
    differs, it jumps, as between both sides of a thin wall, and the points stay separate. A wall
    without thickness that is equally hot on both sides cannot be distinguished from a seam; model
    it with a thickness. Joined points have the data of the first one.
    """
    compared = pv.UnstructuredGrid()
    compared.shallow_copy(grid)
    points = np.asarray(grid.points, dtype=np.float64)
    step = _ROUNDING * max(float(np.ptp(points, axis=0).max()), np.finfo(float).tiny)
    compared.SetPoints(pv.vtk_points(np.round(points / step)))
    scalars = [
        values
        for values in map(np.asarray, grid.point_data.values())
        if values.ndim == 1 and np.issubdtype(values.dtype, np.floating)
    ]
    if scalars:
        compared.point_data[_SCALARS] = np.column_stack(scalars).astype(np.float32)
    joined: pv.UnstructuredGrid = compared.clean(
        tolerance=0.0,
        remove_unused_points=False,
        produce_merge_map=True,
        average_point_data=False,
        merging_array_name=_SCALARS if scalars else None,
    )
    if joined.n_points == grid.n_points:
        return grid
    joined.point_data.pop(_SCALARS, None)
    number = np.asarray(joined.field_data.pop("PointMergeMap"))
    joined.points = np.asarray(grid.points)[np.unique(number, return_index=True)[1]]
    return joined


def refuse_repeated_cells(grid: pv.UnstructuredGrid, path: str) -> None:
    """Refuse a grid in which cells coincide, but for a few pieces of polyhedra that VTK split."""
    points = np.asarray(grid.points, dtype=np.float64)
    repeated_cells = 0
    for _, corners in cell_corners(grid).values():
        ranked = np.sort(corners, axis=1)
        ranked = ranked[np.lexsort(ranked.T)]
        repeated = ranked[1:][(ranked[1:] == ranked[:-1]).all(axis=1)]
        # Flat cells enclose no air; pieces of a solver's polyhedra sometimes coincide.
        offsets = points[repeated] - points[repeated].mean(axis=1, keepdims=True)
        sizes = np.linalg.svd(offsets, compute_uv=False)
        repeated_cells += int((sizes[:, 2] > FLAT * sizes[:, 0]).sum())
    if repeated_cells > _FEW_REPEATED * grid.n_cells:
        raise InputError(
            f"{repeated_cells} cells of {path} lie where others do, so the air there is ambiguous; "
            "export each cell once, and mirror only the half that was solved.",
            code="field.repeated_cells",
        )
