"""COMSOL's text exports at one of their states: a column of results for every time or parameter."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any
from warnings import warn

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.core.files import sha256_of
from iriftrace.field.arrays import quantity_of
from iriftrace.field.gradient import TETRAHEDRON
from iriftrace.field.readers import (
    comsol_tables as comsol_sectionwise,
)
from iriftrace.field.readers import (
    comsol_tables as comsol_spreadsheet,
)
from iriftrace.field.readers.comsol_sections import TextFile, text_file
from iriftrace.field.readers.comsol_tables import Table
from iriftrace.field.readers.scattered import merged, tetrahedra_between
from iriftrace.field.readers.states import Column, Contents, State, chosen, states_of, time_in

_COLUMNS = {
    "spreadsheet": comsol_spreadsheet.columns,
    "sectionwise": comsol_sectionwise.sectionwise_columns,
    "grid": comsol_sectionwise.sectionwise_columns,
}
_TABLES = {
    "spreadsheet": comsol_spreadsheet.table,
    "sectionwise": comsol_sectionwise.sectionwise_table,
    "grid": comsol_sectionwise.grid_table,
}


def states(path: Path) -> list[State]:
    """Label and time of every state in a file, at least one."""
    file = text_file(path)
    return _listed(_COLUMNS[file.layout](file))


def read(path: Path, member: int | None) -> Contents:
    """Points, cells and results of one state.

    Points without elements get the tetrahedra of Delaunay, which fill their hull.

    Raises
    ------
    InputError
        The file is damaged, has no header, or is not three-dimensional.

    Warns
    -----
    IriftraceWarning
        Results are NaN at some points, which are then left out.
    """
    file = text_file(path)
    table = _TABLES[file.layout](file)
    listed = _listed(table.columns)
    number = chosen(listed, member, path)
    names, values = _of_state(table, listed[number][0], path)
    points, values, cells = _with_values(table, names, values, path)
    if table.cells is None:
        points, values = merged(points, values, path)
        kind, cells = TETRAHEDRON, tetrahedra_between(points, path)
    else:
        kind = table.cells[0]
    grid = pv.UnstructuredGrid({kind: cells}, points)
    for name, column in zip(names, values.T, strict=True):
        grid.point_data[name] = np.ascontiguousarray(column)
    return Contents(
        data=grid,
        sha256=sha256_of(path),
        states=listed,
        member=number,
        length_unit=_length_unit(file),
        units={name: column.unit or "" for name, column in names.items()},
        origin=file.header.origin(listed[number][0]),
        scattered=table.cells is None,
    )


def _listed(columns: Sequence[Column]) -> list[State]:
    return [(state, time_in(state)) for state in states_of(columns)]


def _length_unit(file: TextFile) -> str | None:
    stated = file.header.length_unit
    if stated is None and file.layout == "spreadsheet":
        return comsol_spreadsheet.coordinate_unit(file)
    return stated


def _of_state(
    table: Table, state: str, path: Path
) -> tuple[dict[str, Column], NDArray[np.float64]]:
    """Columns of one state by the name of their array, and their values."""
    places = [k for k, c in enumerate(table.columns) if c.state in ("", state)]
    if not places:
        raise InputError(f"{path} has no results, only coordinates; export the temperature too.")
    names: dict[str, Column] = {}
    for k in places:
        column = table.columns[k]
        taken = column.name in names
        names[f"{column.name} ({column.unit})" if taken else column.name] = column
    if len(names) != len(places):
        raise InputError(
            f"{path} has several columns of the same name among "
            f"{', '.join(table.columns[k].name for k in places)}; export each once."
        )
    return names, table.values[:, places]


def _with_values(
    table: Table, names: dict[str, Column], values: FloatArray, path: Path
) -> tuple[FloatArray, FloatArray, Any]:
    """Points, values and cells without the points at which nothing was computed."""
    telling = [k for k, name in enumerate(names) if quantity_of(name) is not None]
    missing = np.asarray(np.isnan(values[:, telling or slice(None)]).any(axis=1))
    cells = None if table.cells is None else table.cells[1]
    if not missing.any():
        return table.points, values, cells
    if missing.all():
        raise InputError(
            f"The results in {path} are NaN at all points; export a dataset with a solution."
        )
    if cells is not None:
        cells = cells[~missing[cells].any(axis=1)]
    warn(
        f"{path} has no number (NaN) at {np.count_nonzero(missing)} of {len(missing)} points; they "
        "are left out.",
        IriftraceWarning,
        stacklevel=5,
    )
    if cells is not None:
        # Points without cells are dropped with the rest of what no cell uses.
        return table.points, values, cells
    return table.points[~missing], values[~missing], None
