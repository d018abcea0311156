"""The heat that the computed air carries and stores, from what the solver averaged or wrote."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from iriftrace.air_flow import ENTHALPY_FLUX, HEAT_STORAGE, carried_heat, state_heat
from iriftrace.air_properties import heat_content, heat_content_slope
from iriftrace.openfoam.case import Case
from iriftrace.openfoam.case_files import DENSITY_RATE
from iriftrace.velocity_arrays import MOMENTUM_MEAN, VELOCITY

FloatArray = NDArray[np.float64]


def mean_arrays(case: Case, grid: Any, before: Any, seconds: float) -> dict[str, FloatArray]:
    """Velocity and heat of a time average.

    The stored heat is exact: what it is more at the end of the averaging than at its beginning. The
    flux is that of `air_flow.carried_heat`.

    Parameters
    ----------
    case
        Its ambient air.
    grid
        Last state at its points, with ``rhoMean``; ``UMean`` and ``rhoUMean``.
    before
        State at the beginning of the averaging.
    seconds
        Between the two.

    Returns
    -------
    dict
        ``U`` (n, 3) m/s, `ENTHALPY_FLUX` and `HEAT_STORAGE`, without those that the solver did not
        write: it knows no such average, or ran before they were asked for.
    """
    data = grid.point_data
    if "UMean" not in data:
        return {}
    velocity = np.asarray(data["UMean"], dtype=np.float64)
    arrays = {VELOCITY: velocity}
    if MOMENTUM_MEAN in data:
        density, momentum = (
            np.asarray(data[name], dtype=np.float64) for name in ("rhoMean", MOMENTUM_MEAN)
        )
        arrays[ENTHALPY_FLUX] = carried_heat(
            density, velocity, momentum, case.ambient_k, case.pressure_pa
        )
    arrays[HEAT_STORAGE] = (_content(case, grid) - _content(case, before)) / seconds
    return arrays


def state_arrays(case: Case, grid: Any) -> dict[str, FloatArray]:
    """Velocity and heat of a single state, which stores f'(rho) d rho / dt, f as above."""
    data = grid.point_data
    arrays = {
        VELOCITY: np.asarray(data[VELOCITY], dtype=np.float64),
        ENTHALPY_FLUX: state_heat(grid, case.ambient_k, case.pressure_pa),
    }
    if DENSITY_RATE in data:
        slope = heat_content_slope(data["T"], case.ambient_k)
        arrays[HEAT_STORAGE] = slope * np.asarray(data[DENSITY_RATE], dtype=np.float64)
    return arrays


def _content(case: Case, grid: Any) -> FloatArray:
    return heat_content(grid.point_data["T"], case.ambient_k, case.pressure_pa)
