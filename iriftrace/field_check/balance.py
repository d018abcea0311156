"""The heat that leaves with the air, against the heat that comes from the wall."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from attrs import frozen
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from iriftrace.air_properties import heat_content
from iriftrace.continuous_cells import tetrahedra_of
from iriftrace.field_cells import point_gradient
from iriftrace.field_check.wall_state import conduction_potential
from iriftrace.index_field import IndexField

FloatArray = NDArray[np.float64]

ZONES = ((0.3, 0.5), (0.5, 0.7), (0.7, 0.9))
"""Families of surfaces, by their place between the wall (0) and the end of the data (1). Nearer
ones lie in the boundary layer, where values at the points of cells of finite size carry up to a
tenth less."""

_AT_ONCE = 500_000


@frozen
class HeatBalance:
    """Heat through closed surfaces around the part, W.

    Attributes
    ----------
    carried_w
        With the air, outward.
    conducted_w
        Through the air.
    stored_w
        What the air between wall and surface takes up; NaN where that is not known.
    through_zones_w
        Sum of the three, as far as known, for each of `ZONES`.
    own_flux
        Whether the field has the flux of heat itself; else it is that of temperature and
        velocity at the points, which is right for a single or a steady state on a fine mesh.
    """

    carried_w: float
    conducted_w: float
    stored_w: float
    through_zones_w: tuple[float, ...]
    own_flux: bool

    @property
    def leaving_w(self) -> float:
        """What must have come from the wall."""
        stored = self.stored_w if np.isfinite(self.stored_w) else 0.0
        return self.carried_w + self.conducted_w + stored


def heat_balance(field: IndexField) -> HeatBalance | None:
    """Heat that passes closed surfaces around the part.

    First law for the air between the wall and a closed surface S around it, at constant pressure,
    without the work of gravity and friction (Bird, Stewart and Lightfoot, Transport Phenomena,
    2nd ed. 2002, section 11.2, the equation of change for the enthalpy)::

        Q_wall = integral over S of (rho (h - h_a) U - k grad T) . n dA
                 + d/dt integral of rho (h - h_a) dV,     h - h_a = integral of c_p from T_a to T

    With h_a the enthalpy of ambient air, air that flows in from the room brings nothing, and an
    error in the mass balance does not count as heat. Density is that of a perfect gas at ambient
    pressure.

    No single surface is cut out of the mesh. With a function phi that rises from 0 to 1 between two
    surfaces, the integral of q . grad phi over the volume is the mean of the flux of q through all
    surfaces phi = const (the coarea formula), and on tetrahedra with linear phi and q it is exact.
    Phi is linear in d_wall / (d_wall + d_end), the distances from the wall and from the end of
    the data, so its surfaces are closed and fit into data of any outline. The flux that is averaged
    is the field's own (`iriftrace.air_flow.ENTHALPY_FLUX`) where it has one.

    Measured with `iriftrace field simulate`: the paper's cylinder closes to +0.6 % at the coarse
    and 0.0 % at the normal resolution (quarter), +1.4 % with cells twice the coarse ones (whole);
    a gear with a restless plume to -0.1 %; a short cylinder's starting plume, of whose heat the air
    takes up an eighth, to +4 % with cells twice the coarse ones. With the product of temperature
    and velocity at the points the coarse cylinder would close to -6 %.

    Parameters
    ----------
    field : IndexField
        With its `flow` and an inner wall.

    Returns
    -------
    HeatBalance or None
        None without velocities.
    """
    flow = field.flow
    if flow is None or flow.velocity is None:
        return None
    kelvin, air = field.temperature_k, field.air
    carried = flow.enthalpy_flux
    if carried is None:
        content = heat_content(kelvin, air.temperature_k, air.pressure_pa)
        carried = content[:, None] * flow.velocity
    # Of the gradient at the points, since that of single cells is spoilt by slivers.
    conducted = -1e3 * point_gradient(field.grid, conduction_potential(kelvin))
    zones = _through_zones(field, carried, conducted, flow.storage)
    total = np.nansum(zones, axis=1)
    means = zones.mean(axis=0)
    return HeatBalance(
        carried_w=float(means[0]),
        conducted_w=float(means[1]),
        stored_w=float(means[2]),
        through_zones_w=tuple(float(watts) for watts in total),
        own_flux=flow.enthalpy_flux is not None,
    )


def _through_zones(
    field: IndexField, carried: FloatArray, conducted: FloatArray, storage: FloatArray | None
) -> FloatArray:
    """Heat carried and conducted through the surfaces and stored within, (zones, 3), W."""
    points = np.asarray(field.grid.points, dtype=np.float64)
    corners = tetrahedra_of(field.grid).corners
    place = _place(field)
    rises = [np.clip((place - low) / (high - low), 0.0, 1.0) for low, high in ZONES]
    sums = np.zeros((len(ZONES), 3))
    for start in range(0, len(corners), _AT_ONCE):
        tets = corners[start : start + _AT_ONCE].astype(np.int64)
        edges = points[tets[:, 1:]] - points[tets[:, :1]]
        # Six times the volume times the gradients of three corners' barycentric coordinates.
        faces = np.cross(np.roll(edges, -1, axis=1), np.roll(edges, -2, axis=1))
        fluxes = [flux[tets].mean(axis=1) for flux in (carried, conducted)]
        for row, rise in zip(sums, rises, strict=True):
            change = rise[tets[:, 1:]] - rise[tets[:, :1]]
            slope = np.einsum("ij,ijk->ik", change, faces) / 6.0
            row[:2] += [np.einsum("ij,ij->", flux, slope) for flux in fluxes]
            if storage is not None:
                volume = np.einsum("ij,ij->i", edges[:, 0], faces[:, 0]) / 6.0
                row[2] += np.sum(volume * (storage[tets] * (1.0 - rise[tets])).mean(axis=1))
    if storage is None:
        sums[:, 2] = np.nan
    # W/m2 mm2 and W/m3 mm3.
    watts: FloatArray = sums * (1e-6, 1e-6, 1e-9)
    return watts


def _place(field: IndexField) -> FloatArray:
    """Place of the points between the wall (0) and the end of the data (1), (n,)."""
    grid = pv.UnstructuredGrid()
    grid.copy_structure(field.grid)
    grid.point_data["number"] = np.arange(grid.n_points)
    surface = grid.extract_surface(algorithm="geometry")
    wall = np.asarray(field.wall.point_data["number"], dtype=np.int64)
    end = np.setdiff1d(np.asarray(surface.point_data["number"], dtype=np.int64), wall)
    points = np.asarray(grid.points, dtype=np.float64)
    from_wall, from_end = (cKDTree(points[at]).query(points)[0] for at in (wall, end))
    place: FloatArray = from_wall / np.maximum(from_wall + from_end, np.finfo(float).tiny)
    return place
