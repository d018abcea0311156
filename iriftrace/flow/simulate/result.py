"""Fields of a solved case, around the whole part, in mm, with their origin and heat."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv
from attrs import evolve
from scipy.spatial import cKDTree

from iriftrace.core.arrays import Float32Array, FloatArray, as_float64
from iriftrace.core.errors import SetupError
from iriftrace.core.files import write_whole
from iriftrace.flow.simulate.bodies import floor_below, write_bodies
from iriftrace.flow.simulate.case import Case
from iriftrace.flow.simulate.case_files import DENSITY_RATE
from iriftrace.flow.simulate.mesh import wall_patch
from iriftrace.flow.simulate.part_surface import mirrored_grid
from iriftrace.flow.simulate.programs import SOLVER, read_heat
from iriftrace.flow.simulate.run import Steadiness
from iriftrace.io import openfoam as openfoam_case
from iriftrace.io.vtk_write import write_vtk
from iriftrace.medium.air.thermophysics import (
    heat_content,
    heat_content_slope,
    temperature_of_density,
)
from iriftrace.medium.flow import (
    ENTHALPY_FLUX,
    HEAT_STORAGE,
    MOMENTUM_MEAN,
    VELOCITY,
    carried_heat,
    state_heat,
)
from iriftrace.medium.marked import chosen_cells
from iriftrace.medium.origin import WALL_HEAT, state_origin
from iriftrace.medium.source import FieldFacts, FieldKind
from iriftrace.part.wall_temperature import wall_temperature

_MM = 1000.0


def mean_arrays(
    case: Case, grid: pv.UnstructuredGrid, before: pv.UnstructuredGrid, seconds: float
) -> dict[str, FloatArray]:
    """Velocity and heat of a time average, as far as the solver wrote them.

    `U` (n, 3) m/s, `ENTHALPY_FLUX` by `iriftrace.medium.flow.carried_heat`, and `HEAT_STORAGE`, an
    exact difference between the last state at its points, `grid` with ``rhoMean``, ``UMean`` and
    ``rhoUMean``, and that of `seconds` earlier, `before`, when averaging began.
    """
    data = grid.point_data
    if "UMean" not in data:
        return {}
    velocity = as_float64(data["UMean"])
    arrays = {VELOCITY: velocity}
    if MOMENTUM_MEAN in data:
        density, momentum = (as_float64(data[name]) for name in ("rhoMean", MOMENTUM_MEAN))
        arrays[ENTHALPY_FLUX] = carried_heat(
            density, velocity, momentum, case.options.ambient, case.options.pressure
        )
    now, then = (
        heat_content(state.point_data["T"], case.options.ambient, case.options.pressure)
        for state in (grid, before)
    )
    arrays[HEAT_STORAGE] = (now - then) / seconds
    return arrays


def state_arrays(case: Case, grid: pv.UnstructuredGrid) -> dict[str, FloatArray]:
    """Velocity and heat of a single state, which stores f'(rho) d rho / dt, f as above."""
    data = grid.point_data
    arrays = {
        VELOCITY: as_float64(data[VELOCITY]),
        ENTHALPY_FLUX: state_heat(grid, case.options.ambient, case.options.pressure),
    }
    if DENSITY_RATE in data:
        slope = heat_content_slope(data["T"], case.options.ambient)
        arrays[HEAT_STORAGE] = slope * as_float64(data[DENSITY_RATE])
    return arrays


def write_mean(
    case: Case, folder: Path, file: Path, averaged: float, steadiness: Steadiness | None
) -> pv.UnstructuredGrid:
    """Write the field whose temperature has the time average of the density.

    The refractive index follows the density, so this temperature, and not the mean one, is what a
    long exposure sees. Returns the content of the .vtu: mm, world, point data ``T`` in K and those
    of `mean_arrays`, field data `WALL_HEAT`.
    """
    grid, moment = _read(folder, -1)
    if "rhoMean" not in grid.point_data:
        raise SetupError(
            f"the case {folder} has no mean density at t = {moment:g} s.",
            code="case.no_mean_density",
        )
    density = as_float64(grid.point_data["rhoMean"])
    kelvin = temperature_of_density(density, case.options.pressure)
    state, facts = "", FieldFacts(time="mean")
    if steadiness is not None:
        state = f", {steadiness.text}"
        facts = FieldFacts(
            FieldKind.STEADY if steadiness.steady else FieldKind.UNSTEADY,
            steadiness.heat_variation,
            steadiness.plume_swing_k,
            time="mean",
        )
    how = f"density averaged over {averaged:.3g} s up to t = {moment:.3g} s{state}"
    before = _at(folder, moment - averaged)
    carried = {} if before is None else mean_arrays(case, grid, before, averaged)
    whole = _whole(case, folder, grid, {"T": kelvin, **carried})
    if steadiness is not None:
        whole.field_data[WALL_HEAT] = [steadiness.heat_w]
    _write(case, whole, file, how, facts)
    return whole


def write_snapshots(case: Case, folder: Path, file: Path, averaged: float) -> list[Path]:
    """Write the case's last states, ``NAME_01.vtu`` and so on, and a .pvd that lists their times.

    They are those of the `averaged` seconds before the end, without that at the beginning.
    """
    entries, files = [], []
    heat = read_heat(folder)
    since = case.times.end - averaged * (1.0 - 1e-4)
    times = [moment or 0.0 for _, moment in openfoam_case.states(folder)]
    states = [number for number, moment in enumerate(times) if moment > since]
    count = case.times.snapshots
    for number, state in enumerate(states[-count:], 1):
        grid, moment = _read(folder, state)
        kelvin = as_float64(grid.point_data["T"])
        target = file.with_name(f"{file.stem}_{number:0{len(str(count))}d}.vtu")
        whole = _whole(case, folder, grid, {"T": kelvin, **state_arrays(case, grid)})
        if len(heat):
            watts = np.interp(moment, heat[:, 0], heat[:, 1])
            whole.field_data[WALL_HEAT] = [float(watts) * 2 ** len(case.mirrors)]
        _write(case, whole, target, f"snapshot at t = {moment:.4g} s", FieldFacts(time="snapshot"))
        files.append(target)
        entries.append(f'    <DataSet timestep="{moment:.9g}" part="0" file="{target.name}"/>')
    write_whole(
        file,
        '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>\n'
        + "\n".join(entries)
        + "\n  </Collection>\n</VTKFile>\n",
    )
    return files


def _read(folder: Path, member: int) -> tuple[pv.UnstructuredGrid, float]:
    """One state of the case at its points, in m, and its time."""
    states = openfoam_case.states(folder)
    number = range(len(states))[member]
    return openfoam_case.read(folder, number, flow=True).data, float(states[number][1] or 0.0)


def _at(folder: Path, moment: float) -> pv.UnstructuredGrid | None:
    """The state at a time, s, at its points, in m; None if it was not kept."""
    for number, (_, time) in enumerate(openfoam_case.states(folder)):
        if time is not None and np.isclose(time, moment, rtol=1e-6, atol=1e-9):
            grid: pv.UnstructuredGrid = openfoam_case.read(folder, number).data
            return grid
    return None


def _whole(
    case: Case, folder: Path, grid: pv.UnstructuredGrid, arrays: dict[str, FloatArray]
) -> pv.UnstructuredGrid:
    """Cells kept of the computed piece, in mm, with mirror images and arrays at their points.

    The array ``T`` has the requested temperatures on the wall. The reader assigns to points there
    the mean of the faces around them, which widens a transition by a cell.
    """
    domain = case.domain
    piece = pv.UnstructuredGrid()
    piece.copy_structure(grid)
    piece.points = as_float64(grid.points) * _MM
    for name, values in arrays.items():
        piece.point_data[name] = values
    if case.wall.varies(case.part):
        patch = wall_patch(folder)
        corners = as_float64(patch.points) * _MM
        # The reader adds the means of the corners of faces with more than four.
        means = [corners[face].mean(axis=0) for face in patch.irregular_faces if len(face) > 4]
        wall = np.concatenate((corners, np.reshape(means, (-1, 3))))
        on_wall = cKDTree(np.asarray(piece.points)).query(wall)[1]
        piece.point_data["T"][on_wall] = wall_temperature(case.wall, case.part, wall)
    centres = np.asarray(piece.cell_centers().points)
    kept = ((centres > domain.kept_lower) & (centres < domain.kept_upper)).all(axis=1)
    piece = chosen_cells(piece, np.flatnonzero(kept))
    for name, position in domain.planes.items():
        piece = mirrored_grid(piece, "xy".index(name), position)
    return piece


def _shortened(values: Float32Array) -> Float32Array:
    """Numbers rounded to 12 of 24 binary digits, 1e-4, which halves the compressed size."""
    bits = np.ascontiguousarray(values).view(np.uint32)
    return ((bits + 0x800) & 0xFFFFF000).view(np.float32)


def _write(case: Case, grid: pv.UnstructuredGrid, file: Path, how: str, facts: FieldFacts) -> None:
    parts = [f"OpenFOAM {SOLVER}", case.size.name, how]
    if case.draught is not None:
        parts.append(case.draught.text)
    if case.bodies:
        parts.append(f"around {', '.join(body.name for body in case.bodies)}")
    if case.options.floor is not None:
        parts.append(f"floor at z = {case.options.floor:g} mm")
    if case.variation is not None:
        parts.append(case.variation.text)
    planes = case.domain.planes.items()
    mirrored = [f"{name} = {round(value, 4) + 0.0:g} mm" for name, value in planes]  # no "-0"
    symmetry = (
        f"mirrored at {' and '.join(mirrored)}" if mirrored else "none, all sides were solved"
    )
    parts += [symmetry] if mirrored else []
    output = pv.UnstructuredGrid(
        grid.cells, grid.celltypes, np.asarray(grid.points, dtype=np.float32)
    )
    for name in grid.point_data:
        if not name.startswith("vtk"):
            values = np.asarray(grid.point_data[name], dtype=np.float32)
            output.point_data[name] = values if name == "T" else _shortened(values)
    for name in grid.field_data:
        output.field_data[name] = grid.field_data[name]
    bodies = case.bodies
    if case.options.floor is not None:
        bodies = (*bodies, floor_below(output, case.options.floor))
    write_bodies(bodies, file.parent)
    names = tuple(body.name for body in bodies)
    draught = None if case.draught is None else case.draught.velocity
    facts = evolve(
        facts,
        bodies=names,
        symmetry=symmetry,
        draught_m_s=draught,
        variation=case.variation,
    )
    state_origin(output, ", ".join(parts), facts)
    write_vtk(file, output)
