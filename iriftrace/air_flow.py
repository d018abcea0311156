"""How the air of a field moves, and the heat that it carries: what a heat balance needs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from attrs import frozen
from numpy.typing import ArrayLike, NDArray

from iriftrace.air import Air
from iriftrace.air_properties import density, heat_content, heat_content_slope
from iriftrace.air_properties import temperature_of_density as temperature_of
from iriftrace.field_cells import point_mean
from iriftrace.velocity_arrays import (
    SI,
    TEMPERATURE,
    VELOCITY,
    VELOCITY_OVER_TEMPERATURE,
    is_mean,
    velocity_arrays,
)

FloatArray = NDArray[np.float64]

ENTHALPY_FLUX = "enthalpy_flux"
"""Vector array, W/m2: density times velocity times (enthalpy - that of ambient air), or its time
average. Fluctuations carry heat, so it is not the product of the averages."""

HEAT_STORAGE = "heat_storage"
"""Array, W/m3: what density times (enthalpy - that of ambient air) changes by per second."""


@frozen(eq=False)
class AirFlow:
    """Motion of the air at the n points of a field.

    Attributes
    ----------
    velocity : (n, 3) array, m/s, world, or None
        None where the file has none.
    enthalpy_flux : (n, 3) array, W/m2, world, or None
        `ENTHALPY_FLUX`, where the file has it or the cells of an OpenFOAM case tell it.
    storage : (n,) array, W/m3, or None
        `HEAT_STORAGE`, where the file has it.
    name : str
        Of the velocity's arrays; "" without.
    unit : str
        In which they were read.
    flux_name : str
        Of the array of `enthalpy_flux`; "" where there is none or it was made of velocities.
    missing : str
        Why there is no velocity; "" where there is one.
    """

    velocity: FloatArray | None
    enthalpy_flux: FloatArray | None = None
    storage: FloatArray | None = None
    name: str = ""
    unit: str = SI
    flux_name: str = ""
    missing: str = ""


def carried_heat(
    density_kg_m3: FloatArray,
    velocity: FloatArray,
    momentum: FloatArray,
    ambient_k: float,
    pressure_pa: float,
) -> FloatArray:
    """Average of f(rho) U with f = rho (h - h_ambient), from averages of rho, U and rho U.

    As f is linear in rho at constant pressure but for the change of the heat capacity
    (`air_properties.heat_content_slope`), it is to second order of the fluctuations::

        f(<rho>) <U> + f'(<rho>) (<rho U> - <rho> <U>)

    What is left out is f''/2 times the average of (rho - <rho>)^2 U: 0.3 % of the flux where air of
    650 K and 0.2 m/s alternates with air of 850 K and 0.9 m/s, and the product of the averages is
    6 % too small.

    Parameters
    ----------
    density_kg_m3 : (n,) array
        <rho>.
    velocity : (n, 3) array
        <U>, m/s.
    momentum : (n, 3) array
        <rho U>, kg/(m2 s).
    ambient_k, pressure_pa : float

    Returns
    -------
    (n, 3) array
        W/m2.
    """
    kelvin = temperature_of(density_kg_m3, pressure_pa)
    together = momentum - density_kg_m3[:, None] * velocity
    content = heat_content(kelvin, ambient_k, pressure_pa)[:, None]
    flux: FloatArray = content * velocity
    return flux + heat_content_slope(kelvin, ambient_k)[:, None] * together


def flow_in(
    grid: Any,
    array: str,
    units: Mapping[str, str] | None,
    transform: ArrayLike | None,
    air: Air,
) -> AirFlow:
    """The motion of the air in a file.

    Parameters
    ----------
    grid : pyvista.UnstructuredGrid
        Linear volume cells with the file's arrays.
    array : str
        The one that the field was made of: an average goes with the average of the velocity.
    units : mapping or None
        As `readers.contents.Contents.units`.
    transform : (4, 4) array_like or None
        From file to world; vectors are turned and mirrored by it and keep their length.
    air : Air
        Ambient air.
    """
    found, missing = velocity_arrays(grid, units, averaged=is_mean(array))
    turn = _turn(transform)
    if found is not None and turn is None:
        found, missing = (
            None,
            "the field's transform distorts, and directions of velocities with it",
        )
    if found is None or turn is None:
        return AirFlow(None, missing=missing)
    columns = [_at_points(grid, name) for name in found.names]
    velocity = columns[0] if len(columns) == 1 else np.stack(columns, axis=1)
    gaps = np.count_nonzero(~np.isfinite(velocity).all(axis=1))
    if gaps:
        names = ", ".join(found.names)
        return AirFlow(
            None,
            missing=f"{names} {'is' if len(found.names) == 1 else 'are'} not finite at {gaps:,} of "
            f"{len(velocity):,} points; export {'it' if len(found.names) == 1 else 'them'} "
            "without gaps",
        )
    flux = None
    stated = ENTHALPY_FLUX in grid.point_data
    if stated:
        flux = _at_points(grid, ENTHALPY_FLUX)
    elif VELOCITY_OVER_TEMPERATURE in grid.point_data and (array, *found.names) == (
        TEMPERATURE,
        VELOCITY,
    ):
        flux = state_heat(grid, air.temperature_k, air.pressure_pa)
    storage = _at_points(grid, HEAT_STORAGE) if HEAT_STORAGE in grid.point_data else None
    return AirFlow(
        velocity=found.factor * velocity @ turn.T,
        enthalpy_flux=None if flux is None else flux @ turn.T,
        storage=storage,
        name=", ".join(found.names),
        unit=found.unit,
        flux_name=ENTHALPY_FLUX if stated else "",
    )


def state_heat(grid: Any, ambient_k: float, pressure_pa: float) -> FloatArray:
    """Heat that the air of one state of an OpenFOAM case carries at its points, (n, 3), W/m2."""
    rho = density(grid.point_data[TEMPERATURE], pressure_pa)
    momentum = density(1.0, pressure_pa) * _at_points(grid, VELOCITY_OVER_TEMPERATURE)
    return carried_heat(rho, _at_points(grid, VELOCITY), momentum, ambient_k, pressure_pa)


def _at_points(grid: Any, name: str) -> FloatArray:
    if name in grid.point_data:
        return np.asarray(grid.point_data[name], dtype=np.float64)
    values = np.asarray(grid.cell_data[name], dtype=np.float64)
    if values.ndim == 1:
        return point_mean(grid, values)
    return np.stack([point_mean(grid, column) for column in values.T], axis=1)


def _turn(transform: ArrayLike | None) -> FloatArray | None:
    """Rotation and mirroring (3, 3) in a transform; None where it distorts besides."""
    if transform is None:
        return np.eye(3)
    linear = np.asarray(transform, dtype=np.float64)[:3, :3]
    turn: FloatArray = linear / np.cbrt(abs(np.linalg.det(linear)))
    return turn if np.allclose(turn @ turn.T, np.eye(3), atol=1e-6) else None
