"""Mesh of the air around a part: fine at the wall and in the plume, coarse far away.

Tetrahedra are halved at their longest edges until they are small enough, and cut off at the part's
surface.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import permutations

import numpy as np
import pyvista as pv
from attrs import frozen

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.core.mesh.query import Surface
from iriftrace.flow.synthetic.model import SyntheticAir
from iriftrace.medium.gradient import (
    MIRRORED_CORNERS,
    PYRAMID,
    TETRAHEDRON,
    TETRAHEDRON_EDGES,
    WEDGE,
)

_MOST_POINTS = 1 << 31
# A corner nearer to the wall than this fraction of its shortest edge is moved onto it, which avoids
# slivers (Labelle and Shewchuk, "Isosurface stuffing", 2007).
_SNAP = 0.25
# Halvings of an edge until its end on the wall is known to 1e-9 of its length.
_HALVINGS = 30
# Three edges from a corner that are right-handed in a cell with VTK's orientation.
_EDGES_OF = {TETRAHEDRON: (1, 2, 3), WEDGE: (1, 2, 3), PYRAMID: (1, 3, 4)}
MOST_CELLS = 4_000_000
_CELLS_ACROSS_LAYER = 5.0
_GROWTH = 0.2
_CELLS_ACROSS_PLUME = 1.5
_SIDES_IN_LAYERS = 2.5
_HEIGHT_IN_SIZES = 2.0
_COARSEST_IN_WALL_CELLS = 16


def graded_tetrahedra(
    low: FloatArray,
    high: FloatArray,
    coarsest_mm: float,
    size_at: Callable[[FloatArray], FloatArray],
) -> tuple[FloatArray, IntArray]:
    """Fill a box, enlarged to whole cubes, with tetrahedra: points (n, 3), mm, corners (m, 4).

    They come from cubes with an edge of `coarsest_mm`; one is cut in two while it is larger than
    the smallest of the sizes `size_at`, mm, at its corners. Raises InputError if there would be
    more than `MOST_CELLS`.
    """
    too_many = InputError(
        f"The air would need more than {MOST_CELLS:,} tetrahedra; give a larger cell size at the "
        "wall, or a smaller region.",
        code="mesh.too_many_cells",
        argument="cell_size",
    )
    # As float, for numbers that no integer holds.
    count = np.maximum(np.ceil((high - low) / coarsest_mm - 1e-9), 1.0)
    if 6.0 * float(count.prod()) > MOST_CELLS:
        raise too_many
    points, corners = _cubes(0.5 * (low + high), count.astype(np.int64), coarsest_mm)
    tag = np.full(len(corners), 3)
    sizes = size_at(points)
    middles = _Middles()
    while True:
        large = _size(points, corners) > sizes[corners].min(axis=1)
        chosen = large | middles.on_edges(corners)
        if not chosen.any():
            return points, corners
        if len(corners) + chosen.sum() > MOST_CELLS:
            raise too_many
        start = corners[chosen, 0]
        end = np.take_along_axis(corners[chosen], tag[chosen, None], axis=1)[:, 0]
        middle, new = middles.add(start, end, len(points))
        added = 0.5 * (points[new[:, 0]] + points[new[:, 1]])
        points = np.concatenate((points, added))
        sizes = np.concatenate((sizes, size_at(added)))
        # Both children of tetrahedra x0..x3 with tag d, cut between x0 and xd (Maubach's rule).
        whole, first, second = corners[chosen], corners[chosen], corners[chosen]
        for d in (1, 2, 3):
            some = tag[chosen] == d
            first[some, d] = second[some, d] = middle[some]
            second[some, :d] = whole[some, 1 : d + 1]
        younger = np.where(tag[chosen] > 1, tag[chosen] - 1, 3)
        corners = np.concatenate((corners[~chosen], first, second))
        tag = np.concatenate((tag[~chosen], younger, younger))


class _Middles:
    """Points in the middle of edges, indexed by the numbers of the edge's ends."""

    def __init__(self) -> None:
        # The last key is larger than any other.
        self._keys = np.array([np.iinfo(np.int64).max])
        self._points = np.array([-1])

    def on_edges(self, corners: IntArray) -> BoolArray:
        """True for each tetrahedron with a cut edge."""
        found = np.zeros(len(corners), dtype=bool)
        for a, b in TETRAHEDRON_EDGES:
            found |= self._place(_key(corners[:, a], corners[:, b]))[1]
        return found

    def add(self, start: IntArray, end: IntArray, count: int) -> tuple[IntArray, IntArray]:
        """Middle of each edge, and the (k, 2) ends of the new ones, numbered from `count` on."""
        keys = _key(start, end)
        unique, back = np.unique(keys, return_inverse=True)
        place, known = self._place(unique)
        number = np.empty(len(unique), dtype=np.int64)
        number[known] = self._points[place[known]]
        number[~known] = count + np.arange(np.count_nonzero(~known))
        fresh = unique[~known]
        merged = np.concatenate((self._keys, fresh))
        order = np.argsort(merged, kind="stable")
        self._keys = merged[order]
        self._points = np.concatenate((self._points, number[~known]))[order]
        return number[back], np.stack(np.divmod(fresh, _MOST_POINTS), axis=1)

    def _place(self, keys: IntArray) -> tuple[IntArray, BoolArray]:
        place = np.searchsorted(self._keys, keys)
        return place, self._keys[place] == keys


def _key(a: IntArray, b: IntArray) -> IntArray:
    return np.minimum(a, b) * _MOST_POINTS + np.maximum(a, b)


def _size(points: FloatArray, corners: IntArray) -> FloatArray:
    """Edge of the cube whose diagonal is the longest edge of a tetrahedron, mm."""
    square = np.zeros(len(corners))
    for a, b in TETRAHEDRON_EDGES:
        edge = points[corners[:, a]] - points[corners[:, b]]
        np.maximum(square, np.einsum("ij,ij->i", edge, edge), out=square)
    return np.sqrt(square / 3.0)


def _cubes(middle: FloatArray, count: IntArray, edge: float) -> tuple[FloatArray, IntArray]:
    """Cubes around a point, each cut into six tetrahedra along one diagonal (Kuhn)."""
    start = middle - 0.5 * edge * count
    axes = [start[k] + edge * np.arange(count[k] + 1) for k in range(3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    stride = np.array(((count[1] + 1) * (count[2] + 1), count[2] + 1, 1))
    cells = np.stack(np.meshgrid(*map(np.arange, count), indexing="ij"), axis=-1).reshape(-1, 3)
    corner = cells @ stride
    # Along the axes in each of their orders from one end of the diagonal to the other.
    paths = [np.cumsum([0, *stride[list(order)]]) for order in permutations(range(3))]
    return points, np.concatenate([corner[:, None] + path for path in paths])


def cut_at_wall(
    points: FloatArray, corners: IntArray, surface: Surface
) -> tuple[pv.UnstructuredGrid, BoolArray]:
    """Cells, mm, of tetrahedra outside a closed surface; which of their points lie on it."""
    points = points.copy()
    side = np.where(surface.inside(points), -1, 1)
    _snap(points, corners, side, surface)
    kept = (side[corners] > 0).any(axis=1)
    corners = corners[kept]
    sign = side[corners]
    crossing = (sign < 0).any(axis=1)
    ends, cut_at = _cuts(points, corners[crossing], sign[crossing], surface)
    everywhere = np.concatenate((points, cut_at))
    on_wall = np.concatenate((side == 0, np.ones(len(cut_at), dtype=bool)))
    cells = _pieces(corners[crossing], sign[crossing], ends, len(points))
    cells[TETRAHEDRON] = np.concatenate((corners[~crossing], cells[TETRAHEDRON]))
    used = np.unique(np.concatenate([cell.ravel() for cell in cells.values()]))
    number = np.full(len(everywhere), -1)
    number[used] = np.arange(len(used))
    whole = {}
    for kind, cell in cells.items():
        if len(cell):
            # Right-handed, as in VTK.
            e1, e2, e3 = (everywhere[cell[:, k]] - everywhere[cell[:, 0]] for k in _EDGES_OF[kind])
            left = np.einsum("ij,ij->i", np.cross(e1, e2), e3) < 0.0
            whole[kind] = number[np.where(left[:, None], cell[:, MIRRORED_CORNERS[kind]], cell)]
    return pv.UnstructuredGrid(whole, everywhere[used]), on_wall[used]


def _snap(points: FloatArray, corners: IntArray, side: IntArray, surface: Surface) -> None:
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
    foot = surface.nearest(points[candidates])[0]
    gap = np.linalg.norm(foot - points[candidates], axis=1)
    near = gap < _SNAP * shortest[candidates]
    points[candidates[near]] = foot[near]
    side[candidates[near]] = 0


def _cuts(
    points: FloatArray, corners: IntArray, sign: IntArray, surface: Surface
) -> tuple[IntArray, FloatArray]:
    """Edges that cross the wall as sorted (k, 2) ends, outside first, and the crossings."""
    found = [
        corners[(sign[:, a] > 0) & (sign[:, b] < 0)][:, (a, b)]
        for a, b in permutations(range(4), 2)
    ]
    ends = np.unique(np.concatenate(found), axis=0)
    out, into = points[ends[:, 0]], points[ends[:, 1]]
    low, high = np.zeros(len(ends)), np.ones(len(ends))
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        within = surface.inside(out + middle[:, None] * (into - out))
        high = np.where(within, middle, high)
        low = np.where(within, low, middle)
    return ends, out + (0.5 * (low + high))[:, None] * (into - out)


def _pieces(corners: IntArray, sign: IntArray, ends: IntArray, first: int) -> dict[int, IntArray]:
    """The outer pieces of tetrahedra, by cell type; cut points are numbered from `first` on."""
    # Corners in the order outside, wall, inside; an odd permutation is corrected afterwards.
    order = np.argsort(-sign, axis=1, kind="stable")
    v = np.take_along_axis(corners, order, axis=1)
    n_out, n_wall = (sign > 0).sum(axis=1), (sign == 0).sum(axis=1)
    key = ends[:, 0] * _MOST_POINTS + ends[:, 1]

    def cut(some: BoolArray, a: int, b: int) -> IntArray:
        place: IntArray = np.searchsorted(key, v[some, a] * _MOST_POINTS + v[some, b])
        return first + place

    def case(outside: int, wall: int) -> BoolArray:
        return np.asarray((n_out == outside) & (n_wall == wall))

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


@frozen
class AirMesh:
    """Extent and cell size of the mesh around a part.

    Attributes
    ----------
    cell_mm : float
        Edge of the cubes at the wall, which are divided into the cells.
    sides_mm : float
        Air next to and below the part.
    height_mm : float
        Air above the part.
    """

    cell_mm: float
    sides_mm: float
    height_mm: float

    def __attrs_post_init__(self) -> None:
        """Refuse sizes that leave no air or no cells."""
        for argument, name, value in (
            ("cell_size", "cell size", self.cell_mm),
            ("sides", "air next to the part", self.sides_mm),
            ("height", "air above the part", self.height_mm),
        ):
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(
                    f"The {name} is {value:g} mm; give a positive length.",
                    code="mesh.size",
                    argument=argument,
                )


def usual_mesh(
    air: SyntheticAir,
    *,
    cell_mm: float | None = None,
    sides_mm: float | None = None,
    height_mm: float | None = None,
) -> AirMesh:
    """Five cells across the boundary layer; air up to where it has the room's temperature.

    Lengths that are given, as for `AirMesh`, replace these.
    """
    low, high = air.part.bounds
    height = _HEIGHT_IN_SIZES * float(high[2] - low[2]) + 4.0 * air.boundary_layer_mm
    sides = _SIDES_IN_LAYERS * air.boundary_layer_mm
    if air.plume is not None:
        top = 0.5 * (high[2] - low[2]) + height
        left, right = air.plume.bounds(top)
        sides = max(sides, float(np.max((low[:2] - left, right - high[:2]))))
    return AirMesh(
        air.boundary_layer_mm / _CELLS_ACROSS_LAYER if cell_mm is None else cell_mm,
        sides if sides_mm is None else sides_mm,
        height if height_mm is None else height_mm,
    )


def air_mesh(air: SyntheticAir, size: AirMesh) -> tuple[pv.UnstructuredGrid, BoolArray]:
    """Cells around a part that end on its surface, and which of their points lie on it.

    Raises InputError if there would be more than `MOST_CELLS`, or they are larger than the boundary
    layer or miss the part.
    """
    if size.cell_mm > air.boundary_layer_mm:
        raise InputError(
            f"Cells of {size.cell_mm:g} mm at the wall would miss the boundary layer, which is "
            f"{air.boundary_layer_mm:.3g} mm thick; give smaller ones, a fifth of it by default.",
            code="mesh.too_coarse",
            argument="cell_size",
        )
    low, high = (np.array(bound, dtype=np.float64) for bound in air.part.bounds)
    low -= size.sides_mm
    high += size.sides_mm
    high[2] = air.part.bounds[1, 2] + size.height_mm

    def size_at(points: FloatArray) -> FloatArray:
        distance = air.surface.distance(points)
        edge = size.cell_mm + _GROWTH * np.maximum(distance - size.cell_mm, 0.0)
        if air.plume is not None:
            width = air.plume.half_width(points[:, 2] - air.plume.base[2])
            excess = air.plume.excess(points)[0]
            fine = np.maximum(width / _CELLS_ACROSS_PLUME, size.cell_mm)
            # Where the excess temperature is small, the plume needs no resolution.
            edge = np.where(excess > 0.02, np.minimum(edge, fine), edge)
        return edge

    mesh = graded_tetrahedra(low, high, _COARSEST_IN_WALL_CELLS * size.cell_mm, size_at)
    grid, on_wall = cut_at_wall(*mesh, air.surface)
    if not on_wall.any():
        raise InputError(
            f"Cells of {size.cell_mm:.3g} mm at the wall do not resolve {air.part.path}, which is "
            f"{np.ptp(air.part.bounds, axis=0).min():.3g} mm thin; give smaller ones.",
            code="mesh.too_coarse",
            argument="cell_size",
        )
    return grid, on_wall
