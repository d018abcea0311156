"""Horizontal cylinder in open air: local Nusselt numbers, and rays along its axis."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from iriftrace.core.arrays import FloatArray
from iriftrace.core.units import ZERO_CELSIUS_K
from iriftrace.flow.check.nusselt import local_nusselt
from iriftrace.medium.air import thermophysics as gas
from iriftrace.medium.air.refractivity import Air
from iriftrace.part.part import Part
from iriftrace.part.standards import cylinder
from validation.flow.simulated import Run, bent, solved_wall
from validation.flow.table import Table, per_cent

DIAMETER_MM, LENGTH_MM = 20.1, 50.0
RAYS_RAYLEIGH = 2.43e4
RUNS = {1e4: Run(33.514, 10.0, 8.0, 0.4), RAYS_RAYLEIGH: Run(60.0, 10.0, 6.0, 0.4)}
"""Cases by the Rayleigh number with the properties at the film temperature."""

ANGLES_DEG = np.arange(0, 181, 30)
HALF_SECTOR_DEG = 5.0
NUSSELT_BOUND = 6.0
"""Per cent."""
MIDDLE_MM = 10.0
"""Evaluated length at mid-length: the ends are not part of the plane solution."""

RAYS_MM = np.array((0.02, 0.5, 1.0, 2.0, 3.0, 5.0))
RAYS_MRAD = {
    "bottom": (2.063, 2.052, 1.954, 1.509, 0.953, 0.272),
    "side": (1.863, 1.847, 1.777, 1.454, 1.002, 0.344),
    "top": (0.487, 0.454, 0.413, 0.335, 0.276, 0.205),
}
"""Bending over 200 mm by the plane solution of `local_nusselt` at 2.5e4, 60 degC in 20 degC."""

NUSSELT_TEXT = f"""\
Nusselt number along the circumference of a horizontal cylinder in open air, from the bottom (0°)
to the top, means over ten degrees. The cylinder is {DIAMETER_MM:g} mm thick and {LENGTH_MM:g} mm
long; the {MIDDLE_MM:g} mm at mid-length count. The plane solution is the one of `iriftrace field
check`: a Boussinesq fluid of Pr 0.7, far boundary at 20 diameters, within 0.6 % of Saitoh, Sajiki
and Maruhara (1993; quoted from memory) at Ra 10,000. The simulated numbers are the heat fluxes
of the solver's own faces, with the properties of the film temperature. The plane solution
leaves out the ends of the cylinder and how the air's properties vary: 1 % at 33.5 °C, up
to 4 % at 60 °C."""

RAYS_TEXT = f"""\
Bending along 200 mm of the axis of a cylinder at 60 °C, by the distance from its surface, in the
plane solution for Ra 25,000 (as above). The rays through the simulated air pass the
{MIDDLE_MM:g} mm at mid-length, and are scaled to 200 mm. Little is left at 5 mm, where the cells
are twice as large. The simulated air has real properties, the plane solution those of the film
temperature, which makes up to 4 %."""


def nusselt_table(folder: Path) -> Table:
    """Local Nusselt numbers at mid-length, means over ten degrees."""
    table = Table([f"{angle}°" for angle in ANGLES_DEG])
    fine = np.linspace(0.0, 180.0, 1801)
    for rayleigh, run in RUNS.items():
        mesh = run.field(_part(), folder / "cylinder")[1]
        exact = _in_sectors(fine, local_nusselt(fine, rayleigh), np.ones_like(fine))
        table.expected(f"Ra {rayleigh:g}: plane solution", exact)
        found = solved_numbers(folder / "cylinder" / run.name, run.wall_c + ZERO_CELSIUS_K)
        table.difference(f"wall {run.wall_c:g} °C, {mesh}", per_cent(found, exact), NUSSELT_BOUND)
    return table


def solved_numbers(case: Path, wall_k: float) -> FloatArray:
    """Local Nusselt numbers at `ANGLES_DEG` of a case, by the heat flux of the solver's own faces.

    With the diameter, and the conductivity of the film temperature.
    """
    wall = solved_wall(case)
    x, y, z = np.asarray(wall.cell_centers().points).T * 1e3
    areas = np.asarray(wall.compute_cell_sizes()["Area"])
    excess = wall_k - Air().temperature_k
    conductivity = float(gas.conductivity(wall_k - 0.5 * excess))
    numbers = np.asarray(wall["wallHeatFlux"]) * DIAMETER_MM * 1e-3 / (conductivity * excess)
    middle = np.abs(x) < 0.5 * MIDDLE_MM
    angle = np.degrees(np.arctan2(np.abs(y), -z))
    return _in_sectors(angle[middle], numbers[middle], areas[middle])


def _in_sectors(angle: FloatArray, numbers: FloatArray, weights: FloatArray) -> FloatArray:
    """Means within five degrees of `ANGLES_DEG`."""
    within = [np.abs(angle - middle) <= HALF_SECTOR_DEG for middle in ANGLES_DEG]
    return np.array([np.average(numbers[at], weights=weights[at]) for at in within])


def rays_table(folder: Path) -> Table:
    """Rays along the axis at the bottom, the side and the top."""
    part, table = _part(), Table([f"{distance:g} mm" for distance in RAYS_MM.round(1)])
    field, mesh = RUNS[RAYS_RAYLEIGH].field(part, folder / "cylinder")
    for name, away in {"bottom": (0.0, -1.0), "side": (1.0, 0.0), "top": (0.0, 1.0)}.items():
        across = (0.5 * DIAMETER_MM + RAYS_MM)[:, None] * away
        starts = np.column_stack((np.full(len(RAYS_MM), -0.5 * MIDDLE_MM), across))
        found = bent(field, part, starts, MIDDLE_MM) @ away * (1e3 * 200.0 / MIDDLE_MM)
        table.expected(f"{name}: plane solution, mrad", RAYS_MRAD[name])
        table.difference(f"{name}: simulated, {mesh}", per_cent(found, RAYS_MRAD[name]))
    return table


def _part() -> Part:
    return cylinder(DIAMETER_MM, LENGTH_MM, segments=120)
