"""Field file of a scene: the cells and indices that the cells engine integrates rays through."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from attrs import evolve, frozen
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from iriftrace.core.arrays import BoolArray, Float32Array, FloatArray, Int32Array, IntArray
from iriftrace.core.errors import InputError
from iriftrace.medium.air.refractivity import Air, dispersion
from iriftrace.medium.ambient import cells_at, corners_of, not_ambient, points_of
from iriftrace.medium.gradient import CORNERS
from iriftrace.medium.source import FieldSource

if TYPE_CHECKING:
    import pyvista as pv

    from iriftrace.medium.index_field import IndexField

SAME_MM = 1e-4
"""Distance below which points of two fields are one, in single precision."""


@frozen(eq=False)
class FieldCells:
    """Cells of a field where the air is not ambient, with the index at n points; needs no VTK."""

    points: Float32Array  # (n, 3), mm, world: the cells' corners, and all points of the wall
    refractivity: FloatArray  # (n,), n - 1 at the points
    # As in a pyvista.UnstructuredGrid of tetrahedra, hexahedra, wedges and pyramids: (m,) and (c,).
    celltypes: NDArray[np.uint8]
    cell_connectivity: Int32Array
    wall: BoolArray  # (n,) points of the inner boundary, at the hot part
    air: Air  # ambient
    ambient: float  # n - 1 of the ambient air, used outside the data
    source: FieldSource

    def at_wavelength(self, wavelength_nm: float) -> FieldCells:
        """The same air for another wavelength of light."""
        factor = dispersion(self.air, wavelength_nm)
        return evolve(
            self,
            refractivity=factor * self.refractivity,
            ambient=factor * self.ambient,
            air=evolve(self.air, wavelength_nm=wavelength_nm),
        )

    def temperature_at(self, places: FloatArray) -> FloatArray:
        """Temperatures (m,), K, at points (m, 3), mm, world; ambient outside the data."""
        from iriftrace.medium.index_field import IndexField

        values = IndexField(self.grid(), self.refractivity, self.air, self.source).sample(places)
        return self.air.temperature(np.where(np.isfinite(values), values, self.ambient))

    def grid(self) -> pv.UnstructuredGrid:
        """The cells and their points, mm, world, without values."""
        import pyvista as pv

        offsets = self.cell_offsets
        corners = np.insert(self.cell_connectivity, offsets[:-1], np.diff(offsets))
        return pv.UnstructuredGrid(corners, self.celltypes, self.points.astype(np.float64))

    @property
    def cell_offsets(self) -> IntArray:
        """Where the corners of each cell start in `cell_connectivity`, as in pyvista."""
        corners = np.zeros(256, dtype=np.int64)
        corners[list(CORNERS)] = list(CORNERS.values())
        return np.concatenate(([0], np.cumsum(corners[self.celltypes])))


def cells_of(field: IndexField) -> FieldCells:
    """The cells of a field that are not ambient, with points in single precision as in the file."""
    grid = field.grid
    wall = np.zeros(grid.n_points, dtype=bool)
    if field.wall.n_points:
        wall[np.asarray(field.wall.point_data["number"])] = True
    cells = cells_at(grid, not_ambient(field.refractivity, field.ambient_refractivity))
    used = points_of(grid, cells) | wall
    number = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return FieldCells(
        points=np.asarray(grid.points)[used].astype(np.float32),
        refractivity=field.refractivity[used],
        celltypes=np.asarray(grid.celltypes, dtype=np.uint8)[cells],
        cell_connectivity=number[np.asarray(grid.cell_connectivity)[corners_of(grid, cells)]],
        wall=wall[used],
        air=field.air,
        ambient=field.ambient_refractivity,
        source=field.source,
    )


def mixed_cells(members: Sequence[FieldCells], weights: ArrayLike) -> FieldCells:
    """The cells of several fields on one mesh, with the weighted sum of their refractivities.

    `weights` (k,) have the sum 1 and may be negative. A field is ambient in cells that it does not
    have. Raises InputError for fields on several meshes: that have less than half of the cells of
    the smaller one in common.
    """
    first, shares = members[0], np.asarray(weights, dtype=np.float64)
    places = [one.points for one in members]
    starts = np.cumsum([0, *(len(one.celltypes) for one in members)])
    points, number = np.unique(np.concatenate(places), axis=0, return_inverse=True)
    numbers = np.split(number.ravel(), np.cumsum([len(one) for one in places])[:-1])
    rows = np.concatenate([_rows(*each) for each in zip(members, numbers, strict=True)])
    cells, cell = np.unique(rows, axis=0, return_inverse=True)
    of_member = [cell.ravel()[low:high] for low, high in pairwise(starts)]
    for one, its in zip(members[1:], of_member[1:], strict=True):
        common = np.count_nonzero(np.isin(its, of_member[0]))
        if common < 0.5 * min(len(its), len(of_member[0])):
            raise InputError(
                f"{one.source.path} has another mesh than {first.source.path}, so their air "
                "cannot be mixed point by point; solve both on one mesh.",
                code="field.other_mesh",
            )
    refractivity, wall = np.zeros(len(points)), np.zeros(len(points), dtype=bool)
    for share, one, its in zip(shares, members, numbers, strict=True):
        values = np.full(len(points), one.ambient)
        values[its] = one.refractivity
        refractivity += share * values
        wall[its] |= one.wall
    return evolve(
        first,
        points=points,
        refractivity=refractivity,
        celltypes=cells[:, 0].astype(np.uint8),
        cell_connectivity=cells[:, 1:][cells[:, 1:] >= 0].astype(np.int32),
        wall=wall,
        ambient=float(shares @ [one.ambient for one in members]),
    )


def _rows(cells: FieldCells, number: IntArray) -> IntArray:
    """Type and corners of cells, by new numbers of the points; (c, 9), with -1 after the last."""
    rows = np.full((len(cells.celltypes), 9), -1)
    rows[:, 0] = cells.celltypes
    corner = np.arange(8) < np.diff(cells.cell_offsets)[:, None]
    rows[:, 1:][corner] = number[cells.cell_connectivity]
    return rows


def excess_at(cells: FieldCells, other: FieldCells) -> FloatArray:
    """n - n_ambient (m,) of another field at the points of cells on the same mesh.

    Points that are left out of the other cells lie in ambient air. Raises InputError for another
    mesh: fewer than half of the points in common.
    """
    excess = other.refractivity - other.ambient
    off, nearest = cKDTree(other.points).query(cells.points, distance_upper_bound=SAME_MM)
    same = np.isfinite(off)
    if same.mean() < 0.5:
        raise InputError(
            f"{other.source.path} has another mesh than {cells.source.path}, so their air cannot "
            "be compared point by point; solve both on one mesh.",
            code="field.other_mesh",
        )
    return np.where(same, np.append(excess, 0.0)[nearest], 0.0)
