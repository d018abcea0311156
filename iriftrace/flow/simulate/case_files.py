"""Files of a case: mesh, properties of the air, boundaries, numerics, times."""

from __future__ import annotations

import math
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from iriftrace.core.arrays import FloatArray
from iriftrace.flow.simulate.case import Case
from iriftrace.flow.simulate.domain import BODY_LEVEL, WALL_LEVEL
from iriftrace.flow.simulate.part_surface import write_stl
from iriftrace.medium.air import thermophysics as gas

# s; the wall heats air at rest. The step grows by a fifth each time until the flow limits it, so a
# run that is continued loses little time either.
_FIRST_STEP, _NEXT_STEP = 1e-5, 1e-4
MESH_FILES = (
    "system/blockMeshDict",
    "system/surfaceFeatureExtractDict",
    "system/snappyHexMeshDict",
)
AIR_FILES = (
    *(f"constant/{name}" for name in ("thermophysicalProperties", "g", "turbulenceProperties")),
    *("constant/hRef", "constant/radiationProperties", "system/fvSchemes"),
)
CONTROL_FILES = ("system/controlDict", "system/fvSolution")
START_FILES = ("0/T", "0/U", "0/p", "0/p_rgh")
AVERAGED = ("rho", "U", "rhoU")
"""Quantities that the solver averages over time; the results' names end with "Mean"."""
CORRECTORS, KEEPING_HEAT = ({"outer": 1, "inner": 2}, {"outer": 3, "inner": 1})
"""Number of times that all equations, and the pressure's within, are solved in a time step.

With one outer corrector the enthalpy is solved with the density of the last flux, which creates
heat where the flow changes from step to step: a starting plume takes up half more than the wall
gives (cylinder, background cells of 40 mm, 0.3 s), with three it is 3 % more. In a steady flow it
makes no difference, and three take more than twice the time.
"""
DENSITY_RATE = "ddtRho"
"""Rate of change of a state's density, kg/(m3 s)."""
COURANT = 2
"""Largest Courant number of a step."""


def _plain(value: object) -> object:
    """A value for a template: a quantity without its unit."""
    return float(value) if isinstance(value, float) else value


_TEMPLATES = Environment(
    loader=PackageLoader("iriftrace.flow"),
    finalize=_plain,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
_METRES = 1e-3
# The sides of the box and their corners in ``blockMeshDict``.
_FACES = {
    "xmin": "(0 4 7 3)",
    "xmax": "(1 2 6 5)",
    "ymin": "(0 1 5 4)",
    "ymax": "(3 7 6 2)",
    "bottom": "(0 3 2 1)",
    "top": "(4 5 6 7)",
}


def gas_entries() -> dict[str, object]:
    """Perfect gas, heat capacity by "janaf" and viscosity by "sutherland"."""
    return {
        "molar_mass": gas.MOLAR_MASS,
        "cp_common_k": f"{gas.COMMON_K:g}",
        "cp_high": gas.HEAT_CAPACITY_ABOVE,
        "cp_low": gas.HEAT_CAPACITY_BELOW,
        "sutherland_as": gas.SUTHERLAND_AS,
        "sutherland_ts": gas.SUTHERLAND_TS,
    }


def write_case(case: Case, folder: Path) -> None:
    """Write all files for mesher and solver, except temperatures of single faces of the wall."""
    for name in ("0", "constant/triSurface", "system"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    surfaces = folder / "constant/triSurface"
    write_stl(case.part, surfaces / "part.stl")
    for name, body in zip(_body_patches(case), case.bodies, strict=True):
        write_stl(body.surface, surfaces / f"{name}.stl")
    entries = mesh_entries(case) | air_entries(case)
    for name in (*MESH_FILES, *AIR_FILES):
        write_file(folder, name, entries)
    write_start(case, folder, uniform(case.wall.default))
    write_control(case, folder, averaging=False)


def write_start(case: Case, folder: Path, wall: str) -> None:
    """Write the fields at time 0; `wall` is the temperature of the wall as OpenFOAM reads it."""
    for name in START_FILES:
        write_file(folder, name, {**air_entries(case), "wall": wall})


def write_control(
    case: Case, folder: Path, *, averaging: bool, start: float = 0.0, steady: bool = False
) -> None:
    """Write the control files for the run before averaging, or for averaging from `start` on.

    Averaged states conserve heat (`KEEPING_HEAT`) unless the flow is `steady` by then.
    """
    times = case.times
    # Where averaging begins at once, the mesher still needs times that are not 0.
    late = averaging or times.settled == 0.0
    end = times.end if late else times.settled
    interval = times.averaging_interval if late else times.settling_interval
    # They count from the start, a rounded time, and the last one has to end with the run.
    intervals = max(1, math.ceil((end - start) / interval - 1e-6))
    entries = {
        "end_time": end,
        "write_interval": (end - start) / intervals,
        # One more than needed: the last may be incomplete if the run is killed.
        "times_kept": max(times.snapshots, 1) + 1 if averaging else 2,
        "start_time": f"{start:.9g}",
        "first_step": _NEXT_STEP if start else _FIRST_STEP,
        "courant": COURANT,
        "averaging": averaging,
        "averaged": AVERAGED,
        "density_rate": DENSITY_RATE,
        "probes": [_metres(point) for point in case.probes],
        **(KEEPING_HEAT if averaging and not steady else CORRECTORS),
    }
    for name in CONTROL_FILES:
        write_file(folder, name, entries)


def write_decomposition(folder: Path, processes: int) -> None:
    """Write into how many pieces along x, y and z the mesh is split for that many processes."""
    slices, left = [1, 1, 1], processes
    while left > 1:
        factor = next(n for n in range(2, left + 1) if left % n == 0)
        slices[slices.index(min(slices))] *= factor
        left //= factor
    entries = {"processes": processes, "slices": slices}
    write_file(folder, "system/decomposeParDict", entries)


def write_file(folder: Path, name: str, entries: dict[str, object]) -> None:
    """Fill one of the templates into the case."""
    text = _TEMPLATES.get_template(f"{name}.jinja").render(entries)
    (folder / name).write_text(text + "\n", encoding="utf-8")


def mesh_entries(case: Case) -> dict[str, object]:
    """Entries of the mesher's files; lengths in m except in ``blockMeshDict``."""
    domain = case.domain
    types = dict.fromkeys(_planes(case), "symmetryPlane")
    if case.options.floor is not None:
        types["bottom"] = "wall"
    (x0, y0, z0), (x1, y1, z1) = domain.lower, domain.upper
    plan = ((x0, y0), (x1, y0), (x1, y1), (x0, y1))
    return {
        "corners": [(x, y, z) for z in (z0, z1) for x, y in plan],
        "cells": domain.cells,
        "patches": [
            {"name": name, "type": types.get(name, "patch"), "faces": faces}
            for name, faces in _FACES.items()
        ],
        "bodies": _body_patches(case),
        "body_level": BODY_LEVEL,
        "surfaces": ["part", *_body_patches(case)],
        "boxes": [
            {"lower": _metres(b.lower), "upper": _metres(b.upper), "level": b.level}
            for b in domain.boxes
        ],
        "distances": [(f"{d * _METRES:.9g}", level) for d, level in domain.distances],
        "wall_level": WALL_LEVEL,
        "point_in_air": _metres(domain.point_in_air),
    }


def air_entries(case: Case) -> dict[str, object]:
    """Entries of the files of air and boundaries."""
    planes = _planes(case)
    inlets = [] if case.draught is None else list(case.draught.inlets)
    walls = [
        {"name": name, "kelvin": body.temperature_k}
        for name, body in zip(_body_patches(case), case.bodies, strict=True)
    ]
    if case.options.floor is not None:
        walls.append({"name": "bottom", "kelvin": float(case.options.ambient)})
    closed = {*inlets, *planes, *(str(wall["name"]) for wall in walls)}
    return {
        **gas_entries(),
        "ambient_k": float(case.options.ambient),
        "pressure_pa": float(case.options.pressure),
        "symmetry_planes": " ".join(f"{name} {{ type symmetryPlane; }}" for name in planes),
        "inlets": inlets,
        "free": [name for name in _FACES if name not in closed],
        "walls": walls,
        "draught": (0, 0, 0) if case.draught is None else case.draught.velocity,
        "outlet_level": f"{case.domain.upper[2] * _METRES:.9g}",
    }


def uniform(kelvin: float) -> str:
    """One temperature for the whole wall."""
    return f"uniform {kelvin:.9g}"


def nonuniform(kelvins: FloatArray) -> str:
    """A temperature for each face of the wall."""
    numbers = "\n".join(f"{kelvin:.9g}" for kelvin in kelvins)
    return f"nonuniform List<scalar>\n{len(kelvins)}\n(\n{numbers}\n)"


def _planes(case: Case) -> tuple[str, ...]:
    return tuple(f"{name}min" for name in case.domain.planes)


def _body_patches(case: Case) -> list[str]:
    """Names of the bodies' walls that every mesher accepts: "body1" and so on."""
    return [f"body{number}" for number in range(1, len(case.bodies) + 1)]


def _metres(point: tuple[float, float, float]) -> list[str]:
    return [f"{value * _METRES:.9g}" for value in point]
