"""Heat that leaves with the air, compared with the heat from the wall."""

from __future__ import annotations

import numpy as np
from attrs import frozen
from scipy.spatial import cKDTree

from iriftrace.core.arrays import FloatArray, as_float64
from iriftrace.core.units import parse_quantity
from iriftrace.flow.check.finding import Finding, Grade, outer_points
from iriftrace.flow.check.wall import WallState, conduction_potential
from iriftrace.medium.air.thermophysics import heat_content
from iriftrace.medium.flow import NO_VELOCITIES, SI, AirFlow
from iriftrace.medium.gradient import point_gradient
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.part_fit import LARGEST_BARE_SHARE
from iriftrace.medium.tetrahedra import tetrahedra_of

ZONES = ((0.3, 0.5), (0.5, 0.7), (0.7, 0.9))
"""Families of surfaces, by their position between the wall (0) and the end of the data (1). Nearer
ones lie in the boundary layer, where values at the points of cells of finite size carry up to a
tenth less."""

_AT_ONCE = 500_000

CLOSED, OPEN, WRONG = 0.05, 0.15, 0.5
"""Fractions of the wall's heat.

Simulations on the meshes of `mesh_size` close within 1 % with the heat computed by the solver, and
within 4 % on a mesh twice as coarse (`heat_balance`): a difference above `CLOSED` needs an
explanation. The heat from the gradient at the wall alone is off by up to 11 % on coarse meshes, and
a flux from a product of values at points by 6 %. Neither explains more than `OPEN`: then heat is
lost or created, or the data do not belong together. If the storage in the air is unknown the
difference may be larger, but above `WRONG` only in the first moments of a plume.
"""
UNITS = (SI, "mm/s")
"""Units of velocities that are confused with each other."""
HOW_TO_GET = (
    "`iriftrace field simulate` writes them, OpenFOAM's cases hold them as U, from COMSOL export "
    "u, v and w too"
)
_PRODUCT = (
    "; flux from temperature and velocity at the points, usually a few per cent too small on "
    "coarse meshes, and of a time average without the heat of fluctuations"
)


@frozen
class HeatBalance:
    """Heat through closed surfaces around the part, W.

    If the field has no heat flux of its own (`own_flux`), the carried heat is computed from
    temperature and velocity at the points, which is correct for a single or a steady state on a
    fine mesh.
    """

    carried_w: float  # with the air, outward
    conducted_w: float  # through the air
    stored_w: float  # in the air between wall and surface, per second; NaN if unknown
    through_zones_w: tuple[float, ...]  # sum of the three, as far as known, for each of `ZONES`
    own_flux: bool

    @property
    def leaving_w(self) -> float:
        """Heat that must have come from the wall, W."""
        stored = self.stored_w if np.isfinite(self.stored_w) else 0.0
        return self.carried_w + self.conducted_w + stored


def heat_balance(field: IndexField) -> HeatBalance | None:
    """Heat through closed surfaces around the field's inner wall; None without velocities.

    First law for the air between the wall and a closed surface S around it, at constant pressure,
    without the work of gravity and friction (Bird, Stewart and Lightfoot, Transport Phenomena,
    2nd ed. 2002, section 11.2, the equation of change for the enthalpy)::

        Q_wall = integral over S of (rho (h - h_a) U - k grad T) . n dA
                 + d/dt integral of rho (h - h_a) dV,     h - h_a = integral of c_p from T_a to T

    With h_a the enthalpy of ambient air, air that flows in from the room carries no heat, and an
    error in the mass balance does not count as heat. The density is that of a perfect gas at
    ambient pressure.

    The mesh is not cut along a single surface. With a function phi that rises from 0 to 1 between
    two surfaces, the integral of q . grad phi over the volume is the mean of the flux of q through
    all surfaces phi = const (the coarea formula); on tetrahedra with linear phi and q it is exact.
    Phi is linear in d_wall / (d_wall + d_end), the distances from the wall and from the end of
    the data, so its surfaces are closed and fit data of any outline. The field's own flux
    (`iriftrace.medium.flow.ENTHALPY_FLUX`) is averaged if it has one; with the product of
    temperature and velocity at the points a coarse cylinder closes to -6 % instead of +0.6 %.
    """
    flow = field.flow
    if flow is None or flow.velocity is None:
        return None
    kelvin, air = field.temperature_k, field.air
    carried = flow.enthalpy_flux
    if carried is None:
        content = heat_content(kelvin, air.temperature_k, air.pressure_pa)
        carried = content[:, None] * flow.velocity
    # From the gradient at the points, because slivers spoil that of single cells.
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
    points = as_float64(field.grid.points)
    corners = tetrahedra_of(field.grid).corners
    ends = (field.wall.point_data["number"], outer_points(field))
    from_wall, from_end = (cKDTree(points[at]).query(points)[0] for at in ends)
    # Between the wall (0) and the end of the data (1).
    place = from_wall / np.maximum(from_wall + from_end, np.finfo(float).tiny)
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
    return sums * (1e-6, 1e-6, 1e-9)


def balance_finding(field: IndexField, wall: WallState, covered: float, *, steady: bool) -> Finding:
    """Compare the heat that leaves with the air with the heat from the wall.

    `covered` is the fraction of the part's surface on the field's wall; in `steady` air, which does
    not change in time, nothing is stored.
    """
    counted = field.source.wall_heat_w
    from_wall = (wall.heat_w if counted is None else counted) + wall.bodies_w
    numbers = {"conducted_w": wall.heat_w, "counted_w": counted, "bodies_w": wall.bodies_w}
    balance, flow = heat_balance(field), field.flow
    if balance is None or flow is None:
        why = "it was read without velocities" if flow is None else flow.missing
        reason = f"needs velocities: {why}" + (f"; {HOW_TO_GET}" if why == NO_VELOCITIES else "")
    elif covered < 1.0 - LARGEST_BARE_SHARE:
        reason = f"no surface around the part is closed in a field that reaches {covered:.0%} of it"
    elif not from_wall > 0.0:
        reason = f"no heat comes from the wall, but {from_wall:.4g} W"
    else:
        reason = ""
    if reason or balance is None or flow is None:
        return Finding("heat balance", "n/a", "-", reason, numbers)
    off = balance.leaving_w / from_wall - 1.0
    measured = bool(np.isfinite(balance.stored_w))
    known = measured or steady
    limit = OPEN if known else WRONG
    verdict: Grade = "good" if abs(off) <= CLOSED else "doubtful" if abs(off) <= limit else "bad"
    low, high = min(balance.through_zones_w), max(balance.through_zones_w)
    unmeasured = "stored nothing, as the field is steady" if steady else "stored unknown"
    stored = f"stored {balance.stored_w:.3g}" if measured else unmeasured
    if flow.flux_name or flow.velocity is None:
        read = f"flux of {flow.flux_name} read as W/m2"
    else:
        fastest = float(np.linalg.norm(flow.velocity, axis=1).max())
        read = f"velocities of {flow.name} read as {flow.unit}, up to {fastest:.3g} m/s"
    bodies = f" and {wall.bodies_w:.3g} W of other bodies" if wall.bodies_w else ""
    remark = (
        f"heat that leaves against heat from the wall{bodies} ({balance.leaving_w:.4g} W leave: "
        f"carried {balance.carried_w:.4g}, conducted {balance.conducted_w:.3g}, {stored}; "
        f"{low:.4g} to {high:.4g} W through near and far surfaces); good up to {CLOSED:.0%} off, "
        f"doubtful up to {limit:.0%}, bad beyond; {read}"
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
            **numbers,
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


def _other_unit(balance: HeatBalance, flow: AirFlow, from_wall: float) -> str:
    """A question if velocities in another unit would carry the wall's heat to a factor of 10."""
    expected = from_wall - balance.conducted_w
    if flow.flux_name or not (expected > 0.0 and balance.carried_w > 0.0):
        return ""
    for unit in UNITS:
        change = parse_quantity(f"1 {unit}", SI) / parse_quantity(f"1 {flow.unit}", SI)
        if change != 1.0 and 0.1 <= change * balance.carried_w / expected <= 10.0:
            return f"; are they {unit}?"
    return ""
