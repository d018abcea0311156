"""COMSOL's spreadsheet format: a point and its results in every row."""

from __future__ import annotations

import numpy as np

from iriftrace.errors import InputError
from iriftrace.readers.comsol_header import columns_of, is_entry
from iriftrace.readers.comsol_sections import TextFile
from iriftrace.readers.comsol_table import FloatArray, IntArray, Table, box_cells, require_count
from iriftrace.readers.number_table import numbers, separator_of
from iriftrace.readers.states import Column

_AXES = ("x", "y", "z")


def columns(file: TextFile) -> list[Column]:
    """All columns, coordinates included, in the order of the file.

    Raises
    ------
    InputError
        No line names them, another number is named, or x, y and z are not among them.
    """
    rows = file.sections[0].rows
    titles = [line for line in file.sections[0].comments if not is_entry(line)]
    if not titles:
        raise InputError(
            f"{file.path} has no header line that names its columns (% x y z T (K)), so nothing "
            "tells which is the temperature; export it with its header."
        )
    separator = separator_of(rows[0])
    count = len(rows[0].strip().strip(separator or " ").split(separator))
    named = columns_of(titles[-1], separator, count, file.path)
    found = [column.name.lower() for column in named]
    if any(found.count(axis) != 1 for axis in _AXES):
        raise InputError(
            f"{file.path} needs one column each of x, y and z, but has "
            f"{', '.join(column.name for column in named)}; export 3D data in x, y and z."
        )
    return named


def table(file: TextFile) -> Table:
    """Points and results.

    Points that fill a regular grid, with NaN where there is no air, get the grid's cells.
    """
    named = columns(file)
    separator = separator_of(file.sections[0].rows[0])
    rows = [row for section in file.sections for row in section.rows]
    data = numbers(rows, separator, file.path, "rows")
    require_count("nodes", len(data), file.header.count("nodes", file.path), file.path)
    names = [column.name.lower() for column in named]
    axes = [names.index(axis) for axis in _AXES]
    others = [k for k in range(len(named)) if k not in axes]
    points, values = data[:, axes], data[:, others]
    results = [named[k] for k in others]
    order, cells = _regular(points)
    if cells is None:
        return Table(points, results, values)
    return Table(points[order], results, values[order], cells)


def coordinate_unit(file: TextFile) -> str | None:
    """Unit of the coordinates that their columns' names state."""
    stated = {c.unit for c in columns(file) if c.name.lower() in _AXES and c.unit is not None}
    return stated.pop() if len(stated) == 1 else None


def _regular(points: FloatArray) -> tuple[IntArray, tuple[int, IntArray] | None]:
    """Order of the points and cells of a regular grid, if they fill one."""
    places = [np.unique(column, return_inverse=True) for column in points.T]
    counts = tuple(len(values) for values, _ in places)
    nx, ny, nz = counts
    number = places[0][1] + nx * (places[1][1] + ny * places[2][1])
    order = np.argsort(number, kind="stable")
    if nx * ny * nz != len(points) or not np.array_equal(number[order], np.arange(len(points))):
        return order, None
    return order, box_cells((nx, ny, nz))
