"""Field file of a scene: the cells and indices that the cells engine integrates rays through."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from iriftrace.core.arrays import BoolArray, Float32Array, FloatArray, Int32Array, IntArray
from iriftrace.medium.air.refractivity import Air, dispersion
from iriftrace.medium.gradient import CORNERS
from iriftrace.medium.source import FieldSource

if TYPE_CHECKING:
    from iriftrace.medium.index_field import IndexField


AMBIENT_SHARE = 1e-4
"""Fraction of the largest contrast with the ambient air below which air counts as ambient.

That is 0.02 K around a part of 1100 degC, less than the uncertainty of any ambient temperature.
"""


@frozen(eq=False)
class FieldCells:
    """Cells of a field with the index at their n points; does not need VTK."""

    points: Float32Array  # (n, 3), mm, world
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

    def without_ambient_air(self) -> FieldCells:
        """Without the cells of ambient air alone, where rays are straight: most of a large flow."""
        kept = self.hot_cells()
        corners = np.repeat(kept, np.diff(self.cell_offsets))
        return evolve(
            self,
            celltypes=self.celltypes[kept],
            cell_connectivity=self.cell_connectivity[corners],
        )

    def hot_cells(self, factor: float = 1.0) -> BoolArray:
        """Mask (m,) of the cells that `without_ambient_air` keeps, at a multiple of its limit."""
        contrast = np.abs(self.refractivity - self.ambient)
        highest = np.maximum.reduceat(contrast[self.cell_connectivity], self.cell_offsets[:-1])
        return np.asarray(highest >= factor * AMBIENT_SHARE * contrast.max())

    def temperature_at(self, places: FloatArray) -> FloatArray:
        """Temperatures (m,), K, at points (m, 3), mm, world; ambient outside the data."""
        import pyvista as pv

        from iriftrace.medium.index_field import IndexField

        offsets = self.cell_offsets
        corners = np.insert(self.cell_connectivity, offsets[:-1], np.diff(offsets))
        grid = pv.UnstructuredGrid(corners, self.celltypes, self.points.astype(np.float64))
        values = IndexField(grid, self.refractivity, self.air, self.source).sample(places)
        return self.air.temperature(np.where(np.isfinite(values), values, self.ambient))

    @property
    def cell_offsets(self) -> IntArray:
        """Where the corners of each cell start in `cell_connectivity`, as in pyvista."""
        corners = np.zeros(256, dtype=np.int64)
        corners[list(CORNERS)] = list(CORNERS.values())
        return np.concatenate(([0], np.cumsum(corners[self.celltypes])))


def cells_of(field: IndexField) -> FieldCells:
    """The cells of a field, with points in single precision as in the file."""
    wall = np.zeros(field.grid.n_points, dtype=bool)
    if field.wall.n_points:
        wall[np.asarray(field.wall.point_data["number"])] = True
    return FieldCells(
        points=np.asarray(field.grid.points, dtype=np.float32),
        refractivity=field.refractivity,
        celltypes=np.asarray(field.grid.celltypes, dtype=np.uint8),
        cell_connectivity=np.asarray(field.grid.cell_connectivity, dtype=np.int32),
        wall=wall,
        air=field.air,
        ambient=field.ambient_refractivity,
        source=field.source,
    )
