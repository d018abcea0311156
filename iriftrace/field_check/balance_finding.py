"""The heat balance is judged."""

from __future__ import annotations

import numpy as np

from iriftrace.air_flow import AirFlow
from iriftrace.field_check.balance import HeatBalance, heat_balance
from iriftrace.field_check.finding import Finding, Verdict
from iriftrace.field_check.wall_state import WallState
from iriftrace.fit import LARGEST_BARE_SHARE
from iriftrace.index_field import IndexField
from iriftrace.units import parse_quantity
from iriftrace.velocity_arrays import NO_VELOCITIES, SI

CLOSED, OPEN, WRONG = 0.05, 0.15, 0.5
"""Shares of the wall's heat.

Simulations on the meshes on offer close within 1 % if the heat is the one that the solver counted,
and within 4 % on a mesh twice as coarse (`balance.heat_balance`): more than `CLOSED` wants an
explanation. The heat from the gradient at the wall alone is off by up to 11 % on coarse meshes, and
a flux from a product of values at points by 6 %; more than `OPEN` neither causes: then heat is lost
or made, or data do not belong together. Where it is not known what the air takes up or gives
back, that may be more, but more than `WRONG` only in the first moments of a plume.
"""

UNITS = (SI, "mm/s")
"""Units of velocities that are taken for each other."""

HOW_TO_GET = (
    "`iriftrace field simulate` writes them, OpenFOAM's cases hold them as U, from COMSOL export "
    "u, v and w too"
)

_PRODUCT = (
    "; flux from temperature and velocity at the points, usually a few per cent too small on "
    "coarse meshes, and of a time average without the heat of fluctuations"
)


def balance_finding(
    field: IndexField, wall: WallState, covered: float, *, steady: bool = False
) -> Finding:
    """Heat that leaves with the air against heat from the wall.

    Parameters
    ----------
    field : IndexField
        Read with its velocities (`iriftrace.field.read_field`, ``flow=True``).
    wall : WallState
    covered : float
        Share of the part's surface on the field's wall.
    steady : bool
        Whether the air does not change in time, so that nothing is stored.
    """
    counted = field.source.wall_heat_w
    from_wall = wall.heat_w if counted is None else counted
    numbers = {"conducted_w": wall.heat_w, "counted_w": counted}
    balance, flow = heat_balance(field), field.flow
    if balance is None or flow is None:
        why = "it was read without velocities" if flow is None else flow.missing
        reason = f"needs velocities: {why}" + (f"; {HOW_TO_GET}" if why == NO_VELOCITIES else "")
    elif covered < 1.0 - LARGEST_BARE_SHARE:
        reason = f"no surface around the part is closed in a field that reaches {covered:.0%} of it"
    elif not from_wall > 0.0:
        reason = f"no heat comes from the wall, but {from_wall:.4g} W"
    else:
        return _judged(balance, flow, wall, from_wall, counted=counted, steady=steady)
    return Finding("heat balance", "n/a", "-", reason, numbers)


def _judged(
    balance: HeatBalance,
    flow: AirFlow,
    wall: WallState,
    from_wall: float,
    *,
    counted: float | None,
    steady: bool,
) -> Finding:
    off = balance.leaving_w / from_wall - 1.0
    measured = bool(np.isfinite(balance.stored_w))
    known = measured or steady
    limit = OPEN if known else WRONG
    verdict: Verdict = "good" if abs(off) <= CLOSED else "doubtful" if abs(off) <= limit else "bad"
    low, high = min(balance.through_zones_w), max(balance.through_zones_w)
    stored = (
        f"stored {balance.stored_w:.3g}"
        if measured
        else "stored nothing, as the field is steady"
        if steady
        else "stored unknown"
    )
    source = (
        "by the gradient there"
        if counted is None
        else f"counted by the solver; {wall.heat_w:.4g} W by the gradient there"
    )
    remark = (
        f"{balance.leaving_w:.4g} W leave (carried {balance.carried_w:.4g}, conducted "
        f"{balance.conducted_w:.3g}, {stored}; {low:.4g} to {high:.4g} through near and far "
        f"surfaces), {from_wall:.4g} W come from the wall ({source}); good up to {CLOSED:.0%} off, "
        f"doubtful up to {limit:.0%}, bad beyond; {_read(flow)}"
    )
    if verdict == "bad":
        remark += _other_unit(balance, flow, from_wall)
    if not known:
        remark += "; heat that unsteady air takes up is part of the difference"
    return Finding(
        "heat balance",
        f"{round(off, 3) + 0.0:+.1%}",
        verdict,
        remark + ("" if balance.own_flux else _PRODUCT),
        {
            "conducted_w": wall.heat_w,
            "counted_w": counted,
            "off": off,
            "leaving_w": balance.leaving_w,
            "carried_w": balance.carried_w,
            "conducted_by_air_w": balance.conducted_w,
            "stored_w": balance.stored_w,
            "through_zones_w": list(balance.through_zones_w),
            "own_flux": balance.own_flux,
            "steady": steady,
            "read_from": flow.flux_name or flow.name,
            "read_in": "W/m2" if flow.flux_name else flow.unit,
        },
    )


def _read(flow: AirFlow) -> str:
    """Which array tells what the air carries, and in what unit it was read."""
    if flow.flux_name or flow.velocity is None:
        return f"flux of {flow.flux_name} read as W/m2"
    fastest = float(np.linalg.norm(flow.velocity, axis=1).max())
    return f"velocities of {flow.name} read as {flow.unit}, up to {fastest:.3g} m/s"


def _other_unit(balance: HeatBalance, flow: AirFlow, from_wall: float) -> str:
    """A question, where velocities in another unit would carry about the heat from the wall.

    About is a factor of 10 up or down, since other errors may come on top.
    """
    expected = from_wall - balance.conducted_w
    if flow.flux_name or not (expected > 0.0 and balance.carried_w > 0.0):
        return ""
    for unit in UNITS:
        change = parse_quantity(f"1 {unit}", SI) / parse_quantity(f"1 {flow.unit}", SI)
        if change != 1.0 and 0.1 <= change * balance.carried_w / expected <= 10.0:
            return f"; are they {unit}?"
    return ""
