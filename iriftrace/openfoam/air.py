"""The air's numbers as ``thermophysicalProperties`` reads them."""

from __future__ import annotations

from typing import Any

from iriftrace import air_properties as gas


def entries() -> dict[str, Any]:
    """Perfect gas, heat capacity by "janaf" and viscosity by "sutherland"."""
    return {
        "molar_mass": gas.MOLAR_MASS,
        "cp_common_k": f"{gas.COMMON_K:g}",
        "cp_high": gas.HEAT_CAPACITY_ABOVE,
        "cp_low": gas.HEAT_CAPACITY_BELOW,
        "sutherland_as": gas.SUTHERLAND_AS,
        "sutherland_ts": gas.SUTHERLAND_TS,
    }
