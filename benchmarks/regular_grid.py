"""Cells or a regular grid for the continuous engine: ``python -m benchmarks.regular_grid``.

The exact hot cylinder of the accuracy page, by the engine from cell to cell, and by the ray
equation through tricubic splines of the cells' index on regular grids. Points of a grid in the
part, where there is no air, or beyond the data take the value of the nearest point of the cells.
Cells are layers made for this air, or the solver's mesh of a real field with the exact air at its
points. Errors are the rms of several positions of the grid, and turns of the solver's mesh.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from scipy.integrate import solve_ivp
from scipy.interpolate import NdBSpline, make_interp_spline
from scipy.spatial import KDTree

from benchmarks.accuracy.agreement import FIELD
from benchmarks.accuracy.exact_air import cylinder_cells, cylinder_ends, cylinder_values, on_cells
from benchmarks.accuracy.exact_shells import CYLINDER_UM
from iriftrace.field.read import read_volume
from iriftrace.runtime.variant import ensure
from iriftrace.scenes.analytic import CYLINDER_RADIUS_MM, HOT_AIR_RADIUS_MM
from tests.shell_fields import field_of

FloatArray = NDArray[np.float64]

OFFSETS = (0.0, 0.25, 0.5, 0.75)
"""Of the grid's points, in spacings, and turns of the solver's mesh, in right angles."""

LOW, HIGH = np.array((-2.0, -64.0, -1.0)), np.array((2.0, 1.0, 18.0))
"""Box around the rays, mm, within the layers of cells once these are stretched."""

START_MM = -62.0
SIZE_MM = np.array((60.0, 2 * HOT_AIR_RADIUS_MM, 2 * HOT_AIR_RADIUS_MM))


def by_engine(cells: pv.UnstructuredGrid) -> FloatArray:
    """Displacements of the rays of ``CYLINDER_UM`` from cell to cell, um."""
    with tempfile.TemporaryDirectory() as folder:
        ends, straight = cylinder_ends(Path(folder), on_cells(cells, cylinder_values, True))
    return np.asarray(1e3 * np.linalg.norm(ends.point - straight, axis=1))


def tricubic(cells: pv.UnstructuredGrid, spacing: float, offset: float) -> NdBSpline:
    """Spline of n - 1 through a regular grid around the rays."""
    field, shift = field_of(cells, cylinder_values), offset * spacing
    axes = [np.arange(a, b, spacing) + shift for a, b in zip(LOW, HIGH, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    values = field.sample(points)
    empty = np.isnan(values)
    values[empty] = field.refractivity[KDTree(cells.points).query(points[empty])[1]]
    values = values.reshape([len(axis) for axis in axes])
    for axis in axes:
        values = np.moveaxis(make_interp_spline(axis, values).c, 0, -1)
    knots = tuple(make_interp_spline(axis, axis).t for axis in axes)
    return NdBSpline(knots, np.ascontiguousarray(values), 3)


def by_grid(refractivity: NdBSpline) -> FloatArray:
    """The same displacements by the ray equation through a spline; NaN where a ray misses."""

    def rate(_: float, state: FloatArray) -> FloatArray:
        slope = [refractivity(state[:3], nu=nu) for nu in np.eye(3, dtype=int)]
        return np.append(state[3:], (1 + refractivity(state[:3])) * np.array(slope))

    def height(_: float, state: FloatArray) -> float:
        return float(np.hypot(*state[1:3]) - CYLINDER_RADIUS_MM)

    height.terminal = True  # type: ignore[attr-defined]
    options = {"events": height, "rtol": 1e-8, "atol": 1e-10, "max_step": 0.25}
    found = []
    for z in np.array(list(CYLINDER_UM)) * CYLINDER_RADIUS_MM:
        start = np.array((0.123, START_MM, z))
        state = np.array((*start, 0.0, 1 + refractivity(start), 0.0))
        ends = solve_ivp(rate, (0, -START_MM), state, **options).y_events[0]
        hit = (0.123, -np.sqrt(CYLINDER_RADIUS_MM**2 - z**2), z)
        found.append(1e3 * np.linalg.norm(ends[0, :3] - hit) if len(ends) else np.nan)
    return np.array(found)


def main() -> None:
    """Measure and print."""
    ensure()
    table = Table("index in", title="Hot cylinder: rms error of the displacement / %")
    for what in ("values", *(f"{b:g} R: {um:.3f} um" for b, um in CYLINDER_UM.items())):
        table.add_column(what, justify="right")

    def add_row(name: str, values: float, *found: FloatArray) -> None:
        errors = 100 * (np.array(found) / list(CYLINDER_UM.values()) - 1)
        rms = np.sqrt(np.mean(errors**2, axis=0))
        table.add_row(name, f"{values:,.0f}", *(f"{error:.2f}" for error in rms))

    def add_grids(meshes: list[pv.UnstructuredGrid], size: FloatArray) -> None:
        for h in (1.0, 0.5, 0.25):
            splines = [tricubic(c, h, x) for c, x in zip(meshes, OFFSETS, strict=True)]
            add_row(f"  grid, {h:g} mm", float(np.prod(size / h + 1)), *map(by_grid, splines))

    for layers in (15, 25, 100):
        cells = cylinder_cells(layers, 4 * layers)
        # All around, and in slices of 1 mm as these are.
        values = (layers + 1) * 4 * layers * 3.6 * (SIZE_MM[0] + 1)
        add_row(f"{layers} layers of cells", values, by_engine(cells))
    cells.points[:, 0] *= 6
    add_grids([cells] * len(OFFSETS), SIZE_MM)
    turned = [read_volume(FIELD).rotate_x(90 * turn) for turn in OFFSETS]
    add_row("solver's mesh", turned[0].n_points, *map(by_engine, turned))
    add_grids(turned, np.ptp(turned[0].points, axis=0))
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
