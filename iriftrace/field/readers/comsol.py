"""Read one state of COMSOL's text exports: spreadsheet, sectionwise or grid format.

Times and parameter values are part of the columns' names: ``T (K) @ t=1``, ``T (K) @ t=2``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyvista as pv
from attrs import evolve, frozen

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.files import sha256_of
from iriftrace.core.number_table import numbers, separator_of
from iriftrace.core.units import LENGTH_UNITS, length_factor
from iriftrace.field.arrays import quantity_of
from iriftrace.field.gradient import HEXAHEDRON, TETRAHEDRON
from iriftrace.field.readers.comsol_text import (
    AXES,
    TextFile,
    section_columns,
    spreadsheet_columns,
    text_file,
)
from iriftrace.field.readers.scattered import merged, tetrahedra_between
from iriftrace.field.readers.states import Column, Contents, State, state_number, states_of

_CELL_NUMBER = re.compile(r"cell[ _-]?(?:number|id|index)")


@frozen(eq=False)
class _Table:
    """Numbers of a text export."""

    points: FloatArray  # (n, 3)
    columns: Sequence[Column]  # names of the results
    values: FloatArray  # (n, columns)
    cells: IntArray | None  # corners of tetrahedra or hexahedra; None for scattered points


def states(path: Path) -> list[State]:
    """Label and time of every state in a file, at least one."""
    file = text_file(path)
    spreadsheet = file.layout == "spreadsheet"
    return states_of(spreadsheet_columns(file) if spreadsheet else section_columns(file))


def read(path: Path, member: int | None) -> Contents:
    """Points, cells and results of one state.

    Points without elements are connected to Delaunay tetrahedra, which fill their hull. Points at
    which results are NaN are removed with a warning.
    """
    file = text_file(path)
    layouts = {"spreadsheet": _spreadsheet, "sectionwise": _sectionwise, "grid": _grid}
    table = layouts[file.layout](file)
    listed = states_of(table.columns)
    number = state_number(listed, member, path)
    label = listed[number][0]
    names, table = _of_state(table, label, path)
    table = _without_gaps(table, names, path)
    points, values, cells = table.points, table.values, table.cells
    if cells is None:
        points, values = merged(points, values, path)
        cells = tetrahedra_between(points, path)
    kind = {4: TETRAHEDRON, 8: HEXAHEDRON}[cells.shape[1]]
    grid = pv.UnstructuredGrid({kind: cells}, points)
    for name, column in zip(names, values.T, strict=True):
        grid.point_data[name] = np.ascontiguousarray(column)
    return Contents(
        data=grid,
        sha256=sha256_of(path),
        states=listed,
        length_unit=length_unit_of(file),
        units={name: column.unit or "" for name, column in names.items()},
        origin=file.origin(label),
        scattered=table.cells is None,
    )


def length_unit_of(file: TextFile) -> str | None:
    """Unit of the coordinates in the header and in their names; InputError if these differ."""
    units = [file.length_unit] if file.length_unit else []
    if file.layout == "spreadsheet":
        units += [c.unit for c in spreadsheet_columns(file) if c.name.lower() in AXES and c.unit]
    if len({length_factor(unit) for unit in units}) > 1:
        raise InputError(
            f"{file.path} states several units of its coordinates ({', '.join(units)}), so it is "
            "not clear where its points are; correct its header."
        )
    return LENGTH_UNITS.get(units[0].casefold(), units[0]) if units else None


def _spreadsheet(file: TextFile) -> _Table:
    """A point and its results in every row; points that fill a regular grid get its cells."""
    columns = spreadsheet_columns(file)
    data = file.numbers([row for section in file.sections for row in section.rows], "rows")
    file.check_count("nodes", len(data))
    names = [column.name.lower() for column in columns]
    if any(map(_CELL_NUMBER.fullmatch, names)):
        warn(
            f"{file.path} has values at the centres of cells, not those at the wall; export the "
            "values at nodes."
        )
    axes = [names.index(axis) for axis in AXES]
    others = [k for k in range(len(columns)) if k not in axes]
    points, values, results = data[:, axes], data[:, others], [columns[k] for k in others]
    file.check_expressions(results)
    places = [np.unique(column, return_inverse=True) for column in points.T]
    nx, ny, nz = (len(coordinates) for coordinates, _ in places)
    number = places[0][1] + nx * (places[1][1] + ny * places[2][1])
    order = np.argsort(number, kind="stable")
    if nx * ny * nz != len(points) or not np.array_equal(number[order], np.arange(len(points))):
        return _Table(points, results, values, None)
    return _Table(points[order], results, values[order], _boxes(nx, ny, nz))


def _sectionwise(file: TextFile) -> _Table:
    """Coordinates, tetrahedra, and a section of data for each of the results."""
    points = file.numbers(file.only("coordinates").rows, "coordinates")
    file.check_count("nodes", len(points))
    if points.shape[1] != 3:
        raise InputError(
            f"The coordinates in {file.path} have {points.shape[1]} columns instead of x, y and z; "
            "export 3D data."
        )
    corners = file.numbers(file.only("elements").rows, "elements")
    file.check_count("elements", len(corners))
    if corners.shape[1] != 4:
        raise InputError(
            f"The elements in {file.path} have {corners.shape[1]} corners, so they are a surface; "
            "rays need the air volume, so export tetrahedra (the volume)."
        )
    cells = corners.astype(np.int64)
    if not np.array_equal(cells, corners) or cells.min() < 1 or cells.max() > len(points):
        raise InputError(
            f"The elements in {file.path} name points from {corners.min():g} to "
            f"{corners.max():g}, but it has points 1 to {len(points)}; the file is damaged, so "
            "export it again."
        )
    return _with_results(file, points, cells - 1)


def _grid(file: TextFile) -> _Table:
    """Coordinates of a regular grid along x, y and z, and results, with x running fastest."""
    rows = file.only("grid").rows
    if len(rows) != 3:
        raise InputError(
            f"The grid in {file.path} has {len(rows)} rows instead of one each for x, y and z; "
            "export 3D data."
        )
    axes = [numbers([row], separator_of(row), file.path, "grid").ravel() for row in rows]
    z, y, x = np.meshgrid(*axes[::-1], indexing="ij")
    points = np.stack((x.ravel(), y.ravel(), z.ravel()), axis=1)
    file.check_count("nodes", len(points))
    return _with_results(file, points, _boxes(len(axes[0]), len(axes[1]), len(axes[2])))


def _boxes(nx: int, ny: int, nz: int) -> IntArray:
    """Hexahedra (k, 8) between the points of a grid that are numbered with x running fastest."""
    k, j, i = np.meshgrid(np.arange(nz - 1), np.arange(ny - 1), np.arange(nx - 1), indexing="ij")
    first = (i + nx * (j + ny * k)).ravel()
    corner = np.array((0, 1, 1 + nx, nx))
    cells: IntArray = first[:, None] + np.concatenate((corner, corner + nx * ny))
    return cells


def _with_results(file: TextFile, points: FloatArray, cells: IntArray) -> _Table:
    """Points and cells with each section of data as a column."""
    columns = section_columns(file)
    file.check_expressions(columns)
    values = [file.numbers(section.rows, "data").ravel() for section in file.of_kind("data")]
    for data in values:
        if len(data) != len(points):
            raise InputError(
                f"A section of data in {file.path} has {len(data)} values for {len(points)} "
                "points: it was cut short or edited; export it again."
            )
    return _Table(points, columns, np.stack(values, axis=1), cells)


def _of_state(table: _Table, state: str, path: Path) -> tuple[dict[str, Column], _Table]:
    """Columns of one state by the name of their array, and the table without other columns."""
    places = [k for k, c in enumerate(table.columns) if c.state in ("", state)]
    if not places:
        raise InputError(f"{path} has no results, only coordinates; export the temperature too.")
    names: dict[str, Column] = {}
    for column in (table.columns[k] for k in places):
        taken = column.name in names
        names[f"{column.name} ({column.unit})" if taken else column.name] = column
    if len(names) != len(places):
        raise InputError(
            f"{path} has several columns of the same name among "
            f"{', '.join(table.columns[k].name for k in places)}; export each once."
        )
    return names, evolve(table, columns=list(names.values()), values=table.values[:, places])


def _without_gaps(table: _Table, names: dict[str, Column], path: Path) -> _Table:
    """The table without points that have no results, and without cells at such points."""
    telling = [k for k, name in enumerate(names) if quantity_of(name) is not None]
    missing = np.asarray(np.isnan(table.values[:, telling or slice(None)]).any(axis=1))
    missing |= np.isnan(table.points).any(axis=1)
    if not missing.any():
        return table
    if missing.all():
        raise InputError(
            f"The results in {path} are NaN at all points; export a dataset with a solution."
        )
    warn(
        f"{path} has no number (NaN) at {np.count_nonzero(missing)} of {len(missing)} points; they "
        "are left out."
    )
    if table.cells is None:
        return evolve(table, points=table.points[~missing], values=table.values[~missing])
    # Points without cells are dropped later with all points that no cell uses.
    return evolve(table, cells=table.cells[~missing[table.cells].any(axis=1)])
