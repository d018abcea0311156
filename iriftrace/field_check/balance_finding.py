"""The heat balance is judged."""

from __future__ import annotations

import numpy as np

from iriftrace.field_check.balance import HeatBalance, heat_balance
from iriftrace.field_check.finding import Finding, Verdict
from iriftrace.field_check.wall_state import WallState
from iriftrace.fit import LARGEST_BARE_SHARE
from iriftrace.index_field import IndexField

CLOSED, OPEN = 0.05, 0.15
"""Shares of the wall's heat.

Simulations on the meshes on offer close within 1 % if the heat is the one that the solver counted,
and within 4 % on a mesh twice as coarse (`balance.heat_balance`): more than `CLOSED` wants an
explanation. The heat from the gradient at the wall alone is off by up to 11 % on coarse meshes, and
a flux from a product of values at points by 6 %; more than `OPEN` neither causes: then heat is lost
or made, or data do not belong together.
"""

HOW_TO_GET = (
    "`iriftrace field simulate` writes them, OpenFOAM's cases hold them as U, from COMSOL export "
    "u, v and w too"
)

_PRODUCT = (
    "; flux from temperature and velocity at the points, some per cent small on coarse meshes and, "
    "of a time average, without the heat of fluctuations"
)


def balance_finding(field: IndexField, wall: WallState, covered: float) -> Finding:
    """Heat that leaves with the air against heat from the wall.

    Parameters
    ----------
    field : IndexField
        Read with its velocities (`iriftrace.field.read_field`, ``flow=True``).
    wall : WallState
    covered : float
        Share of the part's surface on the field's wall.
    """
    counted = field.source.wall_heat_w
    from_wall = wall.heat_w if counted is None else counted
    numbers = {"conducted_w": wall.heat_w, "counted_w": counted}
    balance = heat_balance(field)
    if balance is None:
        why = field.flow.missing if field.flow is not None else "it was read without velocities"
        reason = f"needs velocities: {why}; {HOW_TO_GET}"
    elif covered < 1.0 - LARGEST_BARE_SHARE:
        reason = f"no surface around the part is closed in a field that reaches {covered:.0%} of it"
    elif not from_wall > 0.0:
        reason = f"no heat comes from the wall, but {from_wall:.4g} W"
    else:
        return _judged(balance, wall, counted, from_wall)
    return Finding("heat balance", "n/a", "-", reason, numbers)


def _judged(
    balance: HeatBalance, wall: WallState, counted: float | None, from_wall: float
) -> Finding:
    off = balance.leaving_w / from_wall - 1.0
    known = bool(np.isfinite(balance.stored_w))
    # What the air takes up or gives back in an unsteady flow may be any amount.
    worst: Verdict = "bad" if known else "doubtful"
    verdict: Verdict = "good" if abs(off) <= CLOSED else "doubtful" if abs(off) <= OPEN else worst
    low, high = min(balance.through_zones_w), max(balance.through_zones_w)
    stored = (
        f"stored {balance.stored_w:.3g}"
        if known
        else "stored unknown and part of the difference, large in unsteady air"
    )
    source = (
        "by the gradient there"
        if counted is None
        else f"counted by the solver; {wall.heat_w:.4g} W by the gradient there"
    )
    return Finding(
        "heat balance",
        f"{round(off, 3) + 0.0:+.1%}",
        verdict,
        f"{balance.leaving_w:.4g} W leave (carried {balance.carried_w:.4g}, conducted "
        f"{balance.conducted_w:.3g}, {stored}; {low:.4g} to {high:.4g} through near and far "
        f"surfaces), {from_wall:.4g} W come from the wall ({source}); good within {CLOSED:.0%}, "
        f"{worst} beyond {OPEN if known else CLOSED:.0%}" + ("" if balance.own_flux else _PRODUCT),
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
        },
    )
