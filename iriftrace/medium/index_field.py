"""Field of the refractive index of the air around a hot part, at the solver's own points."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import pyvista as pv
from attrs import evolve, field, frozen
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from iriftrace.core.arrays import FloatArray, as_float64
from iriftrace.core.errors import InputError
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.ambient import cells_at, not_ambient, points_of
from iriftrace.medium.flow import AirFlow
from iriftrace.medium.gradient import CORNERS, consistent_gradient, point_gradient
from iriftrace.medium.marked import chosen_cells
from iriftrace.medium.source import FieldSource
from iriftrace.medium.tetrahedra import tetrahedra_of
from iriftrace.medium.wall import inner_wall

# VTK's own tolerance grows with the size of the data, so flat cells claim points next to them and
# extrapolate to these with large errors.
_ON_FACE_MM = 1e-4


@frozen(eq=False)
class IndexField:
    """Refractivity of air on an unstructured grid.

    Attributes
    ----------
    grid : pyvista.UnstructuredGrid
        Tetrahedra, hexahedra, wedges and pyramids; n points in mm, world. Its only array is the
        point array ``"refractivity"``.
    refractivity : (n,) array
        n - 1 at the points, float64.
    air : Air
        Ambient air, which turns n - 1 into temperature and back.
    source : FieldSource
    flow : AirFlow, optional
        Velocity of the air, if requested.
    """

    grid: pv.UnstructuredGrid
    refractivity: FloatArray = field(converter=as_float64)
    air: Air
    source: FieldSource
    flow: AirFlow | None = None

    def __attrs_post_init__(self) -> None:
        """Check that the parts fit together; keep only the refractivity in the grid."""
        if len(self.refractivity) != self.grid.n_points:
            raise InputError(
                f"There are {len(self.refractivity)} refractivities for {self.grid.n_points} "
                "points of the grid; give one for each point.",
                code="field.value_count",
            )
        if not np.isin(self.grid.celltypes, list(CORNERS)).all():
            raise InputError(
                "The grid has cells that are not tetrahedra, hexahedra, wedges or pyramids; pass "
                "it through iriftrace.medium.volume.linear_volume first.",
                code="field.cell_kind",
            )
        grid = pv.UnstructuredGrid()
        grid.copy_structure(self.grid)
        grid.point_data["refractivity"] = self.refractivity
        object.__setattr__(self, "grid", grid)

    def __repr__(self) -> str:
        sizes = np.ptp(np.reshape(self.grid.bounds, (3, 2)), axis=1)
        extent = " x ".join(f"{size:.5g}" for size in sizes)
        ends = self.temperature_k.min(), self.temperature_k.max()
        return (
            f"IndexField({self.source.path}: {extent} mm, {self.grid.n_points:,} points, "
            f"{self.grid.n_cells:,} cells, {ends[0]:.5g} to {ends[1]:.5g} K)"
        )

    @cached_property
    def temperature_k(self) -> FloatArray:
        """Temperatures at the points, (n,) array, K."""
        return self.air.temperature(self.refractivity)

    @cached_property
    def hot_air(self) -> IndexField:
        """The same field without the cells of ambient air alone, where rays are straight.

        The neighbours of the other cells stay, so that the gradient at the corners of these is that
        of the whole field. The inner wall of the data is that of the whole field.
        """
        cells = cells_at(self.grid, not_ambient(self.refractivity, self.ambient_refractivity))
        cells = cells_at(self.grid, points_of(self.grid, cells))
        if cells.all():
            return self
        grid = chosen_cells(self.grid, np.flatnonzero(cells))
        return evolve(self, grid=grid, refractivity=grid["refractivity"], flow=None)

    @cached_property
    def gradient(self) -> FloatArray:
        """Gradient of n at the points, (n, 3) array, 1/mm, world.

        The volume-weighted mean of the constant gradients of the tetrahedra into which the cells
        are split; `iriftrace.medium.gradient.point_gradient` explains why VTK's is not used.
        """
        return point_gradient(self.grid, self.refractivity)

    @cached_property
    def consistent_gradient(self) -> FloatArray:
        """Gradient of n at the points, (n, 3) array, 1/mm, world, with a length that matches n.

        Directions are those of `gradient`, whose length is off by some per cent where cells grow.
        See `iriftrace.medium.gradient.consistent_gradient`.
        """
        return consistent_gradient(
            np.asarray(self.grid.points),
            tetrahedra_of(self.grid).corners,
            self.refractivity,
            self.gradient,
        )

    @cached_property
    def hessian(self) -> FloatArray:
        """Second derivatives of n at the points, (n, 3, 3) array, 1/mm^2, world, symmetric.

        Recovered from `consistent_gradient` in the same way as `gradient` from n.
        """
        rows = point_gradient(self.grid, self.consistent_gradient)
        return 0.5 * (rows + rows.transpose(0, 2, 1))

    @cached_property
    def wall(self) -> pv.PolyData:
        """Inner boundary of the data, where the hot part sits: triangles, mm, world.

        Point arrays are ``"refractivity"`` and ``"number"``, the point's number in the grid. Empty
        if the data do not surround a cavity.
        """
        numbered = self.grid.copy()
        numbered.point_data["number"] = np.arange(numbered.n_points)
        return inner_wall(numbered)

    def wall_temperature_k(self, points: ArrayLike) -> FloatArray:
        """Temperature (m,), K, at the wall's point nearest to each of (m, 3) points, mm.

        Raises InputError if the data have no inner boundary.
        """
        wall = self.wall
        if not wall.n_points:
            raise InputError(
                f"{self.source.path} has no inner boundary around a part, so the wall's "
                "temperature is unknown; give the temperatures of the part.",
                code="field.no_wall",
                argument="hot_temperature",
            )
        nearest = cKDTree(np.asarray(wall.points)).query(points)[1]
        kelvins: FloatArray = self.temperature_k[np.asarray(wall.point_data["number"])[nearest]]
        return kelvins

    @property
    def hottest_refractivity(self) -> float:
        """Refractivity n - 1 of the hottest air in the data, the smallest value."""
        return float(self.refractivity.min())

    @property
    def ambient_refractivity(self) -> float:
        """Refractivity n - 1 of the ambient air, from `air` and not from the data."""
        return self.air.ambient_refractivity

    def sample(self, points: ArrayLike) -> FloatArray:
        """Refractivity between the points of the grid, interpolated in the cells by VTK.

        Parameters
        ----------
        points : (m, 3) array_like
            mm, world.

        Returns
        -------
        (m,) array
            n - 1; NaN outside the data, and for a few points in 100,000 that lie in the gaps
            between cells with bent faces.
        """
        places = pv.PolyData(np.atleast_2d(np.asarray(points, dtype=np.float64)))
        found = places.sample(self.grid, tolerance=_ON_FACE_MM)
        values = np.array(found.point_data["refractivity"], dtype=np.float64)
        values[np.asarray(found.point_data["vtkValidPointMask"]) == 0] = np.nan
        return values
