"""Field file of a scene: the cells and indices that the cells engine integrates rays through."""

from __future__ import annotations

from collections.abc import Sequence
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
    """The first of several fields on one mesh, with the weighted sum of their refractivities.

    `weights` (k,) have the sum 1 and may be negative. Raises InputError for fields on several
    meshes.
    """
    first, shares = members[0], np.asarray(weights, dtype=np.float64)
    for one in members[1:]:
        for name in ("points", "celltypes", "cell_connectivity"):
            if not np.array_equal(getattr(one, name), getattr(first, name)):
                raise InputError(
                    f"{one.source.path} has another mesh than {first.source.path}, so their air "
                    "cannot be mixed point by point; solve both on one mesh.",
                    code="field.other_mesh",
                )
    refractivity = np.tensordot(shares, [one.refractivity for one in members], axes=1)
    ambient = float(shares @ [one.ambient for one in members])
    return evolve(first, refractivity=refractivity, ambient=ambient)


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
