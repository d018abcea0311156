"""Fields in text: COMSOL's exports, and the tables of CFD-Post, Fluent and STAR-CCM+.

COMSOL's spreadsheet is a table like those, whose remarks (``% Nodes: 1000``, in a .csv ``%
Nodes,1000``) are entries of a header. Its sectionwise and grid formats have rows below titles such
as ``% Coordinates`` and ``% Data (T (K) @ t=1)``. Times and parameter values are part of the
columns' names: ``T (K) @ t=1``, ``T (K) @ t=2``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pyvista as pv
from attrs import evolve, frozen

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.files import sha256_of, text_in
from iriftrace.core.units import LENGTH_UNITS
from iriftrace.io.refusals import damaged, not_read, one_unit
from iriftrace.io.scattered import merged, tetrahedra_between
from iriftrace.io.states import (
    Column,
    Contents,
    State,
    column_of,
    state_number,
    states_of,
)
from iriftrace.io.table import Table, table_in
from iriftrace.medium.arrays import quantity_of
from iriftrace.medium.gradient import HEXAHEDRON, TETRAHEDRON

_KEYS = "Model,Version,Dimension,Nodes,Elements,Expressions,Description,Length unit".split(",")
_ENTRY = re.compile(r"%\s*(?P<key>[^:;,\t]+?)\s*[:;,\t]\s*(?P<value>.*)")
_TITLE = re.compile(r"%\s*(?P<kind>Coordinates|Elements|Data|Grid)\s*(?:\((?P<inside>.*)\))?\s*")
# An expression ends at its unit and state; names of coordinates have neither.
_NAMED = re.compile(
    r"\S.*?\s\((?:[^()]|\([^()]*\))+\)(?:\s+@\s+(?:\d+:\s+)?[^\s=]+=\S+(?:\s+[^\s=(]+=\S+)*)?"
)
_ASSIGNMENT = re.compile(r"\s*[\w.]+\s*=[^@()]*")
_OF_CELLS = "cellnumber"
"""Column of Fluent's exports at the centres of cells."""


@frozen(eq=False)
class _Section:
    """Rows below a title."""

    kind: str  # "Coordinates", "Elements", "Data" or "Grid"
    name: str  # of results: in the title, or a line below it; "" if there is none
    tables: tuple[Table, ...]  # one of all rows; of a grid one for each row

    @property
    def numbers(self) -> FloatArray:
        """All rows, (rows, columns)."""
        return _all_numbers(self.tables[0])


@frozen(eq=False)
class _Export:
    """A text file: a table, or sections of rows; and the entries of COMSOL's header."""

    path: Path
    entries: dict[str, str]
    table: Table | None
    sections: tuple[_Section, ...]

    def only(self, kind: str) -> _Section:
        """The only section of a kind; raises InputError if there is none, or several."""
        found = self.of_kind(kind)
        if len(found) != 1:
            raise damaged(self.path, f"it has {len(found)} sections % {kind} instead of one")
        return found[0]

    def of_kind(self, kind: str) -> list[_Section]:
        """The sections of one kind."""
        return [section for section in self.sections if section.kind == kind]

    def check_count(self, key: str, *found: int) -> None:
        """Refuse another number of nodes, elements or expressions than the header states."""
        stated = self.entries.get(key)
        if stated is not None and stated not in map(str, found):
            raise damaged(self.path, f"its header counts {stated} {key.lower()}, not {found[0]}")

    def check_expressions(self, columns: Sequence[Column]) -> None:
        """The same for results; an expression counts once, or once for each of several states."""
        if columns:
            self.check_count("Expressions", len(columns), len({column.name for column in columns}))

    def origin(self, state: str) -> str:
        """COMSOL with its version, the model and the state, as a result states its origin."""
        model = self.entries.get("Model", "")
        program = "COMSOL" if self.entries else ""
        words = (self.entries.get("Version", program), f"model {model}" if model else "", state)
        return ", ".join(filter(None, words))

    def length_unit(self) -> str | None:
        """Unit of the coordinates in the header and in their names; InputError if these differ."""
        stated = self.entries.get("Length unit", "")
        named = self.table.length_unit(self.table.coordinates) if self.table else ""
        units = (LENGTH_UNITS.get(unit.casefold(), unit) for unit in (stated, named))
        return one_unit(self.path, units) or None


@frozen(eq=False)
class _Table:
    """Numbers of a text export."""

    points: FloatArray  # (n, 3)
    columns: Sequence[Column]  # names of the results
    values: FloatArray  # (n, columns)
    cells: IntArray | None  # corners of tetrahedra or hexahedra; None for scattered points


def states(path: Path) -> list[State]:
    """Label and time of every state in a file, at least one."""
    file = _export(path)
    return states_of(file.table.columns if file.table else _section_columns(file))


def read(path: Path, member: int | None) -> Contents:
    """Points, cells and results of one state.

    Points without elements are connected to Delaunay tetrahedra, which fill their hull. Points at
    which results are NaN are removed with a warning.
    """
    file = _export(path)
    if file.table is not None:
        table = _spreadsheet(file, file.table)
    else:
        table = _grid(file) if file.of_kind("Grid") else _sectionwise(file)
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
        length_unit=file.length_unit(),
        units={name: column.unit or "" for name, column in names.items()},
        origin=file.origin(label),
        scattered=table.cells is None,
    )


def _export(path: Path) -> _Export:
    """Read a text export and split it; raises InputError if it is not a table in 3D."""
    text = text_in(path)
    lines = text.splitlines()
    if not any(map(_TITLE.fullmatch, lines)):
        table = table_in(text, path)
        entries = _entries(table.remarks, path)
        if entries:
            # The unit of length is an entry of the header.
            rest = tuple(line for line in table.remarks if not _ENTRY.match(line))
            table = evolve(table, names=tuple(_names(table)), remarks=rest)
        file = _Export(path, entries, table, ())
    else:
        first = next(k for k, line in enumerate(lines) if _TITLE.fullmatch(line))
        file = _Export(path, _entries(lines[:first], path), None, tuple(_sections(lines, path)))
    if file.entries.get("Dimension", "3") != "3":
        raise _flat(path, f"data in {file.entries['Dimension']} dimensions")
    return file


def _flat(path: Path, found: str) -> InputError:
    """The error for a file that has something else than a volume."""
    return InputError(
        f"{path} has {found}, but rays need the air volume; export a 3D dataset, with tetrahedra "
        "if it has elements.",
        code="field.no_volume",
    )


def _entries(lines: Iterable[str], path: Path) -> dict[str, str]:
    """Values of COMSOL's header by their keys, which are those of its English version."""
    entries = {}
    for entry in filter(None, map(_ENTRY.match, lines)):
        key, value = entry["key"], entry["value"].strip('" ')
        if key in _KEYS:
            entries[key] = value
        elif value.isdecimal() or value.casefold() in LENGTH_UNITS:
            found = f"the line {entry[0].strip()!r} in its header, not COMSOL's English"
            raise not_read(path, found, "export it in English")
    return entries


def _sections(lines: Sequence[str], path: Path) -> list[_Section]:
    """Sections of rows; the separator is that of the first one, as rows may have one number."""
    begins = [k for k, line in enumerate(lines) if _TITLE.fullmatch(line)]
    found: list[_Section] = []
    for begin, end in zip(begins, [*begins[1:], len(lines)], strict=True):
        title = _TITLE.fullmatch(lines[begin])
        if title is None:
            continue
        separator = found[0].tables[0].separator if found else ""
        numbered = enumerate(lines[begin + 1 : end], begin + 1)
        # With empty lines above, the numbers of lines are those of the file.
        if title["kind"] == "Grid":
            texts = ["\n" * number + line for number, line in numbered if line.strip()]
        else:
            texts = ["\n" * (begin + 1) + "\n".join(lines[begin + 1 : end])]
        tables = tuple(table_in(text, path, separator) for text in texts)
        name = title["inside"] or (tables[0].header if tables else "")
        found.append(_Section(title["kind"], name, tables))
    return found


def _all_numbers(rows: Table) -> FloatArray:
    return rows.numbers(range(rows.width))


def _names(table: Table) -> Sequence[str]:
    """Names of columns in COMSOL's header, where blanks or commas are in them too."""
    if table.separator == " " and len(table.names) != table.width:
        # A name longer than its column is followed by a single blank.
        words = table.header.split(None, 3)
        return words[:3] + (_NAMED.findall(words[3]) if len(words) > 3 else [])
    joined: list[str] = []
    for name in table.names:
        # Commas between several parameters of one state do not separate.
        if joined and "@" in joined[-1] and _ASSIGNMENT.fullmatch(name):
            joined[-1] += f", {name}"
        else:
            joined.append(name)
    return joined


def _section_columns(file: _Export) -> list[Column]:
    """Results of a sectionwise or grid file, one for each section of data.

    Their names are in the section's title, ``% Data (T (K) @ t=1)``, or in a line below it.
    Otherwise the header's description must name them, without units; else raises InputError.
    """
    sections = file.of_kind("Data")
    if not sections:
        raise damaged(file.path, "it has no section % Data")
    titles = [section.name for section in sections]
    if not all(titles):
        titles = [name.strip() for name in file.entries.get("Description", "").split(",")]
        if len(titles) != len(sections) or not all(titles):
            raise InputError(
                f"{file.path} does not name its {len(sections)} sections of data, so the "
                "temperature cannot be identified; export it with its header.",
                code="field.no_array",
            )
    return [column_of(title) for title in titles]


def _spreadsheet(file: _Export, rows: Table) -> _Table:
    """A point and its results in every row; points that fill a regular grid get its cells."""
    columns, axes = rows.columns, rows.coordinates
    data = _all_numbers(rows)
    file.check_count("Nodes", len(data))
    if _OF_CELLS in rows.names:
        warn(
            f"{file.path} has values at the centres of cells, not those at the wall; export the "
            "values at nodes."
        )
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


def _sectionwise(file: _Export) -> _Table:
    """Coordinates, tetrahedra, and a section of data for each of the results."""
    points = file.only("Coordinates").numbers
    file.check_count("Nodes", len(points))
    if points.shape[1] != 3:
        raise _flat(file.path, f"coordinates of {points.shape[1]} columns")
    corners = file.only("Elements").numbers
    file.check_count("Elements", len(corners))
    if corners.shape[1] != 4:
        raise _flat(file.path, f"elements of {corners.shape[1]} corners")
    cells = corners.astype(np.int64)
    if not np.array_equal(cells, corners) or cells.min() < 1 or cells.max() > len(points):
        named = f"{corners.min():g} to {corners.max():g}"
        raise damaged(file.path, f"its elements name points {named} of {len(points)}")
    return _with_results(file, points, cells - 1)


def _grid(file: _Export) -> _Table:
    """Coordinates of a regular grid along x, y and z, and results, with x running fastest."""
    rows = file.only("Grid").tables
    if len(rows) != 3:
        raise _flat(file.path, f"a grid of {len(rows)} rows instead of x, y and z")
    axes = [_all_numbers(row).ravel() for row in rows]
    z, y, x = np.meshgrid(*axes[::-1], indexing="ij")
    points = np.stack((x.ravel(), y.ravel(), z.ravel()), axis=1)
    file.check_count("Nodes", len(points))
    return _with_results(file, points, _boxes(len(axes[0]), len(axes[1]), len(axes[2])))


def _boxes(nx: int, ny: int, nz: int) -> IntArray:
    """Hexahedra (k, 8) between the points of a grid that are numbered with x running fastest."""
    k, j, i = np.meshgrid(np.arange(nz - 1), np.arange(ny - 1), np.arange(nx - 1), indexing="ij")
    first = (i + nx * (j + ny * k)).ravel()
    corner = np.array((0, 1, 1 + nx, nx))
    cells: IntArray = first[:, None] + np.concatenate((corner, corner + nx * ny))
    return cells


def _with_results(file: _Export, points: FloatArray, cells: IntArray) -> _Table:
    """Points and cells with each section of data as a column."""
    columns = _section_columns(file)
    file.check_expressions(columns)
    values = [section.numbers.ravel() for section in file.of_kind("Data")]
    for data in values:
        if len(data) != len(points):
            found = f"a section of data has {len(data)} values for {len(points)} points"
            raise damaged(file.path, found)
    return _Table(points, columns, np.stack(values, axis=1), cells)


def _of_state(table: _Table, state: str, path: Path) -> tuple[dict[str, Column], _Table]:
    """Columns of one state by the name of their array, and the table without other columns."""
    places = [k for k, c in enumerate(table.columns) if c.state in ("", state)]
    if not places:
        raise InputError(
            f"{path} has no results, only coordinates; export the temperature too.",
            code="field.no_array",
        )
    names: dict[str, Column] = {}
    for column in (table.columns[k] for k in places):
        taken = column.name in names
        names[f"{column.name} ({column.unit})" if taken else column.name] = column
    if len(names) != len(places):
        raise InputError(
            f"{path} has several columns of the same name among "
            f"{', '.join(table.columns[k].name for k in places)}; export each once.",
            code="field.two_arrays",
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
            f"The results in {path} are NaN at all points; export a dataset with a solution.",
            code="field.not_finite",
        )
    warn(
        f"{path} has no number (NaN) at {np.count_nonzero(missing)} of {len(missing)} points; they "
        "are left out."
    )
    if table.cells is None:
        return evolve(table, points=table.points[~missing], values=table.values[~missing])
    # Points without cells are dropped later with all points that no cell uses.
    return evolve(table, cells=table.cells[~missing[table.cells].any(axis=1)])
