"""Field file of a scene: the cells and indices that the cells engine integrates rays through."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from attrs import evolve, frozen
from numpy.typing import ArrayLike, NDArray

from iriftrace.core.arrays import BoolArray, Float32Array, FloatArray, Int32Array, IntArray
from iriftrace.core.errors import InputError
from iriftrace.core.mesh.topology import first_equal, weld
from iriftrace.medium.air.refractivity import Air, dispersion
from iriftrace.medium.ambient import cells_at, corners_of, not_ambient, points_of
from iriftrace.medium.gradient import CORNERS
from iriftrace.medium.source import FieldSource

if TYPE_CHECKING:
    import pyvista as pv

    from iriftrace.medium.index_field import IndexField


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


@frozen(eq=False)
class CommonMesh:
    """The mesh of several fields: all of their cells, and the excess of each at all points.

    A field is ambient in cells that it does not have.
    """

    cells: FieldCells  # of all fields, at n points, with the values of the first
    ambient: FloatArray  # (k,), n - 1 of the ambient air of each field
    excess: FloatArray  # (k, n), n - n_ambient of each field
    numbers: tuple[IntArray, ...]  # of each field's own points among all

    @classmethod
    def of(cls, members: Sequence[FieldCells]) -> CommonMesh:
        """The mesh of fields; InputError for several meshes.

        These have less than half of the cells of the smaller one in common with the first one.
        """
        first = members[0]
        points = np.concatenate([one.points for one in members])
        kept, number = np.unique(weld(points), return_inverse=True)
        points = points[kept]
        numbers = np.split(number, np.cumsum([len(one.points) for one in members])[:-1])
        cells = np.concatenate([_rows(*each) for each in zip(members, numbers, strict=True)])
        kept, cell = np.unique(first_equal(cells), return_inverse=True)
        cells = cells[kept]
        own, *others = np.split(cell, np.cumsum([len(one.celltypes) for one in members])[:-1])
        for one, its in zip(members[1:], others, strict=True):
            if np.count_nonzero(np.isin(its, own)) < 0.5 * min(len(its), len(own)):
                raise InputError(
                    f"{one.source.path} has another mesh than {first.source.path}, so their air "
                    "cannot be mixed or compared point by point; solve both on one mesh.",
                    code="field.other_mesh",
                )
        excess, wall = np.zeros((len(members), len(points))), np.zeros(len(points), dtype=bool)
        for values, one, its in zip(excess, members, numbers, strict=True):
            values[its] = one.refractivity - one.ambient
            wall[its] |= one.wall
        whole = evolve(
            first,
            points=points,
            refractivity=first.ambient + excess[0],
            celltypes=cells[:, 0].astype(np.uint8),
            cell_connectivity=cells[:, 1:][cells[:, 1:] >= 0],
            wall=wall,
        )
        return cls(whole, np.array([one.ambient for one in members]), excess, tuple(numbers))

    def mixed(self, weights: ArrayLike) -> FieldCells:
        """The cells with the sum of the refractivities by weights (k,).

        These have the sum 1 and may be negative.
        """
        shares = np.asarray(weights, dtype=np.float64)
        ambient = float(shares @ self.ambient)
        return evolve(self.cells, refractivity=ambient + shares @ self.excess, ambient=ambient)


def _rows(cells: FieldCells, number: IntArray) -> Int32Array:
    """Type and corners of cells, by new numbers of the points; (c, 9), with -1 after the last."""
    rows = np.full((len(cells.celltypes), 9), -1, dtype=np.int32)
    rows[:, 0] = cells.celltypes
    corner = np.arange(8) < np.diff(cells.cell_offsets)[:, None]
    rows[:, 1:][corner] = number[cells.cell_connectivity]
    return rows


def excess_at(cells: FieldCells, other: FieldCells) -> FloatArray:
    """n - n_ambient (m,) of another field at the points of cells; InputError for another mesh."""
    mesh = CommonMesh.of((cells, other))
    excess: FloatArray = mesh.excess[1, mesh.numbers[0]]
    return excess
