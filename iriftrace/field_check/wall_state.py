"""What happens at a field's wall: temperature, heat flux, and how finely the layer is resolved."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from attrs import frozen
from numpy.typing import NDArray

from iriftrace import air_properties as gas
from iriftrace.consistent_gradient import ROUNDS, consistent_gradient
from iriftrace.continuous_cells import tetrahedra_of
from iriftrace.errors import InputError
from iriftrace.field_cells import cell_corners, point_gradient
from iriftrace.index_field import IndexField
from iriftrace.part import Part
from iriftrace.triangles import face_crosses, unit_vectors
from iriftrace.wall_distance import WallDistance

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_POTENTIAL_STEPS = 2000
_LEAST_EXCESS_K = 1.0


@frozen(eq=False)
class WallState:
    """The inner boundary of a field, m triangles on n points.

    Attributes
    ----------
    temperature_k : (n,) array
    centres : (m, 3) array, mm
    nearest_face : (m,) array
        The part's face that is nearest to each centre.
    normals : (m, 3) array
        Of the triangles, out of the part.
    areas : (m,) array, mm2
    flux : (m,) array, W/m2
        Conducted from the wall into the air, positive for a hot wall.
    flux_of_cells : (m,) array, W/m2
        The same from the mean gradient of the cells at the wall, which is that of a place above
        it: too small by some per cent, and the difference tells how well the cells resolve it.
    layer_mm : (n,) array
        Conduction thickness of the boundary layer: (T_wall - T_ambient) over the gradient; NaN
        where the wall is not hotter than the room.
    cell_mm : (n,) array
        Height of the first cell above the wall.
    """

    temperature_k: FloatArray
    centres: FloatArray
    nearest_face: IntArray
    normals: FloatArray
    areas: FloatArray
    flux: FloatArray
    flux_of_cells: FloatArray
    layer_mm: FloatArray
    cell_mm: FloatArray

    @property
    def area_mm2(self) -> float:
        """Of the whole wall."""
        return float(self.areas.sum())

    @property
    def heat_w(self) -> float:
        """Conducted from the whole wall, W."""
        return float(np.sum(self.flux * self.areas)) * 1e-6

    @property
    def mean_flux(self) -> float:
        """W/m2."""
        return float(np.average(self.flux, weights=self.areas))

    @property
    def cells_across(self) -> FloatArray:
        """Cells across the conduction thickness, (n,) array; NaN as `layer_mm`."""
        return self.layer_mm / self.cell_mm


def wall_state(field: IndexField, part: Part) -> WallState:
    """Look at the inner boundary of a field.

    The flux is the gradient of the integral of the conductivity over the temperature, which is
    nearly linear in the distance where the air rests, so cells of finite height do little harm.
    Its length is corrected so that it fits the values along the cells' edges
    (`consistent_gradient`). The conductivity is that of `iriftrace.air_properties`.

    Raises
    ------
    InputError
        The field has no inner boundary, its wall is not hotter than the room, or the part is not
        closed.
    """
    wall = field.wall
    if not wall.n_points:
        raise InputError(
            f"{field.source.path} has no inner boundary where the part sits, so nothing can be "
            "said of its wall; export the air without the solid."
        )
    number = np.asarray(wall.point_data["number"], dtype=np.int64)
    faces = np.asarray(wall.regular_faces, dtype=np.int64)
    points = np.asarray(wall.points, dtype=np.float64)
    surface = WallDistance(part)
    centres = points[faces].mean(axis=1)
    nearest_face = surface.faces(centres)
    crosses = face_crosses(points, faces)
    normals = unit_vectors(crosses)
    # The triangles' own direction, turned to the side that the part's normal shows.
    outward = part.face_normals[nearest_face]
    normals *= np.where(np.einsum("ij,ij->i", normals, outward) < 0.0, -1.0, 1.0)[:, None]

    temperature = field.temperature_k
    potential = conduction_potential(temperature)
    of_cells = point_gradient(field.grid, potential)
    slope = _fitting_gradient(field.grid, number, potential, of_cells)[number]

    def conducted(gradient: FloatArray) -> FloatArray:
        flux: FloatArray = -1e3 * np.einsum("ij,ij->i", gradient[faces].mean(axis=1), normals)
        return flux

    at_wall = temperature[number]
    conductivity = np.asarray(gas.conductivity(at_wall), dtype=np.float64)
    fall = np.linalg.norm(slope, axis=1) / conductivity
    excess = at_wall - field.air.temperature_k
    if excess.max() < _LEAST_EXCESS_K:
        raise InputError(
            f"The wall in {field.source.path} has at most {at_wall.max():.1f} K in a room of "
            f"{field.air.temperature_k:.1f} K, so there is no hot air to be checked; is the "
            "ambient temperature right (--ambient)?"
        )
    hot = excess > 0.05 * float(excess.max())
    layer = np.full(len(number), np.nan)
    layer[hot] = excess[hot] / np.maximum(fall[hot], 1e-12)
    return WallState(
        temperature_k=at_wall,
        centres=centres,
        nearest_face=nearest_face,
        normals=normals,
        areas=0.5 * np.linalg.norm(crosses, axis=1),
        flux=conducted(slope),
        flux_of_cells=conducted(of_cells[number]),
        layer_mm=layer,
        cell_mm=_first_cells(field.grid, number, surface.normals(points)),
    )


def _fitting_gradient(
    grid: pv.UnstructuredGrid, wall: IntArray, values: FloatArray, gradient: FloatArray
) -> FloatArray:
    """The gradient (n, 3) with lengths at the wall that fit the values along the edges.

    Only of the cells around the wall, as far as a correction there asks its neighbours.
    """
    near = np.zeros(grid.n_points, dtype=bool)
    near[wall] = True
    for _ in range(ROUNDS + 1):
        chosen = {}
        for kind, (cells, corners) in cell_corners(grid).items():
            touching = near[corners].any(axis=1)
            chosen[kind] = cells[touching]
            near[corners[touching]] = True
    around = grid.extract_cells(np.concatenate(list(chosen.values())))
    number = np.asarray(around.point_data["vtkOriginalPointIds"], dtype=np.int64)
    fitting = gradient.copy()
    fitting[number] = consistent_gradient(
        np.asarray(around.points),
        tetrahedra_of(around).corners,
        values[number],
        gradient[number],
    )
    return fitting


def conduction_potential(temperature: FloatArray) -> FloatArray:
    """Integral of the conductivity over the temperature, W/m."""
    knots = np.linspace(float(temperature.min()), float(temperature.max()), _POTENTIAL_STEPS)
    conductivity = np.asarray(gas.conductivity(knots), dtype=np.float64)
    steps = 0.5 * (conductivity[1:] + conductivity[:-1]) * np.diff(knots)
    integral = np.concatenate(([0.0], np.cumsum(steps)))
    return np.interp(temperature, knots, integral)


def _first_cells(grid: pv.UnstructuredGrid, wall: IntArray, normals: FloatArray) -> FloatArray:
    """Height (n,), mm, of the cells on each point of the wall, across it."""
    points = np.asarray(grid.points, dtype=np.float64)
    place = np.full(len(points), -1)
    place[wall] = np.arange(len(wall))
    height = np.full(len(wall), np.inf)
    for _, corners in cell_corners(grid).values():
        on_wall = place[corners] >= 0
        touching = on_wall.any(axis=1)
        cells = corners[touching]
        for one in range(cells.shape[1]):
            at = place[cells[:, one]]
            some = at >= 0
            arms = points[cells[some]] - points[cells[some, one]][:, None]
            across = np.einsum("ijk,ik->ij", arms, normals[at[some]])
            # The farthest corner across the wall: the height of this cell.
            reach = across.max(axis=1)
            np.minimum.at(height, at[some], np.where(reach > 1e-6, reach, np.inf))
    height[~np.isfinite(height)] = np.nan
    return height
