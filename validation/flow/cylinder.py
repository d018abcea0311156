"""Horizontal cylinder in open air: local Nusselt numbers, and rays along its axis."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from iriftrace.air import thermophysics as gas
from iriftrace.cfd.check.nusselt import local_nusselt
from iriftrace.cfd.check.wall import wall_state
from iriftrace.core.arrays import FloatArray
from iriftrace.field.index_field import IndexField
from iriftrace.part.part import Part
from iriftrace.part.shapes.cylinder import cylinder
from validation.flow.simulated import Run, bent
from validation.flow.table import Table, per_cent

DIAMETER_MM, LENGTH_MM = 20.1, 50.0
RUNS = {1e4: Run(33.514, 10.0, 8.0, 0.4), 2.5e4: Run(60.0, 10.0, 6.0, 0.4)}
"""By the Rayleigh number with the properties at the film temperature."""

ANGLES_DEG = np.arange(0, 181, 30)
HALF_SECTOR_DEG = 5.0
MIDDLE_MM = 10.0
"""Length at mid-length that is looked at: the ends are not part of the plane solution."""

RAYS_MM = np.array((0.02, 0.5, 1.0, 2.0, 3.0, 5.0))
RAYS_MRAD = {
    "bottom": (2.063, 2.052, 1.954, 1.509, 0.953, 0.272),
    "side": (1.863, 1.847, 1.777, 1.454, 1.002, 0.344),
    "top": (0.487, 0.454, 0.413, 0.335, 0.276, 0.205),
}
"""Bending over 200 mm by the plane solution of `local_nusselt` at 2.5e4, 60 degC in 20 degC."""

NUSSELT_TEXT = """\
TODO"""

RAYS_TEXT = """\
TODO"""


def nusselt_table(folder: Path) -> Table:
    """Local Nusselt numbers at mid-length, means over ten degrees."""
    part, table = _part(), Table([f"{angle}°" for angle in ANGLES_DEG])
    for rayleigh, run in RUNS.items():
        field, mesh = run.field(part, folder / "cylinder")
        exact = local_nusselt(ANGLES_DEG, rayleigh)
        table.expected(f"Ra {rayleigh:g}: plane solution", exact)
        found = local_of(field, part)
        table.difference(f"wall {run.wall_c:g} °C, cells of {mesh}", per_cent(found, exact))
    return table


def local_of(field: IndexField, part: Part) -> FloatArray:
    """Local Nusselt numbers of a cylinder along x at `ANGLES_DEG`, with the film's properties."""
    wall = wall_state(field, part)
    x, y, z = wall.centres.T
    angle = np.degrees(np.arctan2(np.abs(y), -z))
    hot, cold = float(np.median(wall.temperature_k)), field.air.temperature_k
    scale = DIAMETER_MM * 1e-3 / (float(gas.conductivity(0.5 * (hot + cold))) * (hot - cold))
    found = []
    for middle in ANGLES_DEG:
        at = (np.abs(x) < 0.5 * MIDDLE_MM) & (np.abs(angle - middle) <= HALF_SECTOR_DEG)
        found.append(scale * np.average(wall.flux[at], weights=wall.areas[at]))
    return np.array(found)


def rays_table(folder: Path) -> Table:
    """Rays along the axis at the bottom, the side and the top."""
    part, table = _part(), Table([f"{distance:g} mm" for distance in RAYS_MM.round(1)])
    rayleigh = 2.5e4
    field, mesh = RUNS[rayleigh].field(part, folder / "cylinder")
    for name, away in {"bottom": (0.0, -1.0), "side": (1.0, 0.0), "top": (0.0, 1.0)}.items():
        across = (0.5 * DIAMETER_MM + RAYS_MM)[:, None] * away
        starts = np.column_stack((np.full(len(RAYS_MM), -0.5 * MIDDLE_MM), across))
        found = bent(field, part, starts, MIDDLE_MM) @ away * (1e3 * 200.0 / MIDDLE_MM)
        table.expected(f"{name}: plane solution, mrad", RAYS_MRAD[name])
        table.difference(f"{name}: cells of {mesh}", per_cent(found, RAYS_MRAD[name]))
    return table


def _part() -> Part:
    return cylinder(DIAMETER_MM, LENGTH_MM, segments=120)
