"""Tetrahedra cut off where a solid begins; what is left outside ends on the solid's surface."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pyvista as pv
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.field_cells import MIRRORED_CORNERS, PYRAMID, TETRAHEDRON, TETRAHEDRON_EDGES, WEDGE
from iriftrace.synthetic.bisection import Tetrahedra

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

Inside = Callable[[FloatArray], BoolArray]
Nearest = Callable[[FloatArray], FloatArray]

# A corner nearer to the wall than this share of its shortest edge is moved onto it, which keeps
# slivers out (Labelle and Shewchuk, "Isosurface stuffing", 2007).
_SNAP = 0.25

# Halvings of an edge until its end on the wall is known to 1e-9 of its length.
_HALVINGS = 30


@frozen(eq=False)
class CutMesh:
    """Cells outside a solid.

    Attributes
    ----------
    grid : pyvista.UnstructuredGrid
        Tetrahedra, wedges and pyramids, mm.
    on_wall : (n,) array of bool
        Points on the solid's surface.
    """

    grid: pv.UnstructuredGrid
    on_wall: BoolArray


def cut_at_wall(mesh: Tetrahedra, inside: Inside, nearest: Nearest) -> CutMesh:
    """Keep of a mesh what lies outside a solid.

    Parameters
    ----------
    mesh : Tetrahedra
    inside : callable
        From points (n, 3), mm, to whether they lie in the solid.
    nearest : callable
        From points (n, 3), mm, to the nearest points of the solid's surface (n, 3), mm.
    """
    points, corners = mesh.points.copy(), mesh.corners
    side = np.where(inside(points), -1, 1)
    _snap(points, corners, side, nearest)
    kept = (side[corners] > 0).any(axis=1)
    corners = corners[kept]
    sign = side[corners]
    crossing = (sign < 0).any(axis=1)
    ends, cut_at = _cuts(points, corners[crossing], sign[crossing], inside)
    everywhere = np.concatenate((points, cut_at))
    on_wall = np.concatenate((side == 0, np.ones(len(cut_at), dtype=bool)))
    cells = _pieces(corners[crossing], sign[crossing], ends, len(points))
    cells[TETRAHEDRON] = np.concatenate((corners[~crossing], cells[TETRAHEDRON]))
    return _assembled(everywhere, cells, on_wall)


def _snap(points: FloatArray, corners: IntArray, side: IntArray, nearest: Nearest) -> None:
    """Move the corners that are next to the wall onto it; their side becomes 0."""
    sign = side[corners]
    crossed = corners[(sign.min(axis=1) < 0) & (sign.max(axis=1) > 0)]
    if not len(crossed):
        return
    shortest = np.full(len(points), np.inf)
    for a, b in TETRAHEDRON_EDGES:
        length = np.linalg.norm(points[crossed[:, a]] - points[crossed[:, b]], axis=1)
        for end in (a, b):
            np.minimum.at(shortest, crossed[:, end], length)
    candidates = np.unique(crossed)
    foot = nearest(points[candidates])
    gap = np.linalg.norm(foot - points[candidates], axis=1)
    near = gap < _SNAP * shortest[candidates]
    points[candidates[near]] = foot[near]
    side[candidates[near]] = 0


def _cuts(
    points: FloatArray, corners: IntArray, sign: IntArray, inside: Inside
) -> tuple[IntArray, FloatArray]:
    """Edges that pass the wall as sorted (k, 2) ends, outside first, and where they pass it."""
    found = [np.empty((0, 2), dtype=np.int64)]
    for a in range(4):
        for b in range(4):
            some = (sign[:, a] > 0) & (sign[:, b] < 0)
            found.append(corners[some][:, (a, b)])
    ends = np.unique(np.concatenate(found), axis=0)
    out, into = points[ends[:, 0]], points[ends[:, 1]]
    low, high = np.zeros(len(ends)), np.ones(len(ends))
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        within = inside(out + middle[:, None] * (into - out))
        high = np.where(within, middle, high)
        low = np.where(within, low, middle)
    return ends, out + (0.5 * (low + high))[:, None] * (into - out)


def _pieces(corners: IntArray, sign: IntArray, ends: IntArray, first: int) -> dict[int, IntArray]:
    """The outer pieces of tetrahedra, by cell type; cut points are numbered from `first` on."""
    # Corners in the order outside, wall, inside; an odd permutation is mended afterwards.
    order = np.argsort(-sign, axis=1, kind="stable")
    v = np.take_along_axis(corners, order, axis=1)
    n_out, n_wall = (sign > 0).sum(axis=1), (sign == 0).sum(axis=1)
    key = ends[:, 0] * (1 << 31) + ends[:, 1]

    def cut(some: BoolArray, a: int, b: int) -> IntArray:
        place: IntArray = np.searchsorted(key, v[some, a] * (1 << 31) + v[some, b])
        return first + place

    def case(outside: int, wall: int) -> BoolArray:
        chosen: BoolArray = (n_out == outside) & (n_wall == wall)
        return chosen

    def pieces(some: BoolArray, *points: int | tuple[int, int]) -> IntArray:
        """Cells with corners (their place in the order) and cuts (between two places)."""
        columns = [cut(some, *p) if isinstance(p, tuple) else v[some, p] for p in points]
        return np.stack(columns, axis=1)

    tetrahedra = [
        pieces(case(1, 0), 0, (0, 1), (0, 2), (0, 3)),
        pieces(case(1, 1), 0, 1, (0, 2), (0, 3)),
        pieces(case(1, 2), 0, 1, 2, (0, 3)),
    ]
    wedges = [
        pieces(case(2, 0), 0, (0, 2), (0, 3), 1, (1, 2), (1, 3)),
        pieces(case(3, 0), 0, 1, 2, (0, 3), (1, 3), (2, 3)),
    ]
    return {
        TETRAHEDRON: np.concatenate(tetrahedra),
        WEDGE: np.concatenate(wedges),
        PYRAMID: pieces(case(2, 1), 0, 1, (1, 3), (0, 3), 2),
    }


# Three edges from a corner that a cell of VTK's handedness has right-handed.
_EDGES_OF = {TETRAHEDRON: (1, 2, 3), WEDGE: (1, 2, 3), PYRAMID: (1, 3, 4)}


def _assembled(points: FloatArray, cells: dict[int, IntArray], on_wall: BoolArray) -> CutMesh:
    used = np.unique(np.concatenate([c.ravel() for c in cells.values()]))
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    lists, kinds = [], []
    for kind, cell in cells.items():
        if not len(cell):
            continue
        edges = [points[cell[:, k]] - points[cell[:, 0]] for k in _EDGES_OF[kind]]
        left = np.einsum("ij,ij->i", np.cross(edges[0], edges[1]), edges[2]) < 0.0
        cell = np.where(left[:, None], cell[:, MIRRORED_CORNERS[kind]], cell)
        lists.append(np.insert(number[cell], 0, cell.shape[1], axis=1).ravel())
        kinds.append(np.full(len(cell), kind, dtype=np.uint8))
    grid = pv.UnstructuredGrid(np.concatenate(lists), np.concatenate(kinds), points[used])
    return CutMesh(grid, on_wall[used])
