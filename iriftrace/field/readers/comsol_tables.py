"""COMSOL's spreadsheet format: a point and its results in every row."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.core.number_table import numbers, separator_of
from iriftrace.field.gradient import HEXAHEDRON, TETRAHEDRON
from iriftrace.field.readers.comsol_sections import Section, TextFile, columns_of, is_entry
from iriftrace.field.readers.states import Column, column_of

# MERGE readers.comsol_table: Points, cells and results of a text export, as numbers.


@frozen(eq=False)
class Table:
    """A text export in numbers.

    Attributes
    ----------
    points : (n, 3) array
    columns : sequence of Column
        Of the results.
    values : (n, columns) array
    cells : tuple of int and (k, corners) array, or None
        Kind of the cells (`field_cells`), and their points; None for scattered points.
    """

    points: FloatArray
    columns: Sequence[Column]
    values: FloatArray
    cells: tuple[int, IntArray] | None = None


def require_count(what: str, found: int, stated: int | None, path: Path) -> None:
    """Refuse a file that has not what its header counts.

    Raises
    ------
    InputError
    """
    if stated is not None and found != stated:
        raise InputError(
            f"The header of {path} counts {stated} {what}, but the file has {found}: it was cut "
            "short or edited; export it again."
        )


def box_cells(counts: tuple[int, int, int]) -> tuple[int, IntArray]:
    """Hexahedra between the points of a grid that are numbered with x running fastest."""
    if min(counts) < 2:
        return HEXAHEDRON, np.zeros((0, 8), dtype=np.int64)
    nx, ny, _ = counts
    k, j, i = np.meshgrid(*(np.arange(n - 1) for n in counts[::-1]), indexing="ij")
    first = (i + nx * (j + ny * k)).ravel()
    corner = np.array((0, 1, 1 + nx, nx))
    return HEXAHEDRON, first[:, None] + np.concatenate((corner, corner + nx * ny))


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


# MERGE readers.comsol_sectionwise: COMSOL's sectionwise and grid formats: coordinates, then cells

_TITLE = re.compile(r"%\s*Data\s*(?:\((?P<inside>.*)\))?\s*", re.IGNORECASE)


def sectionwise_columns(file: TextFile) -> list[Column]:
    """The results, one a section of data.

    Their names stand in the section's title, ``% Data (T (K) @ t=1)``, or in a line below it; else
    the header's description must tell them, without units.
    """
    sections = _sections(file, "data")
    if not sections:
        raise InputError(f"{file.path} has no section of data (% Data); export it again.")
    described = [d.strip() for d in file.header.entries.get("description", "").split(",")]
    titles = [_title(section) for section in sections]
    if not all(titles):
        if len(described) != len(sections) or not all(described):
            raise InputError(
                f"{file.path} does not name its {len(sections)} sections of data, so nothing tells "
                "which is the temperature; export it with its header."
            )
        titles = described
    return [column_of(title) for title in titles]


def sectionwise_table(file: TextFile) -> Table:
    """Points, tetrahedra and results of a sectionwise file."""
    path = file.path
    (coordinates,) = _only(file, "coordinates")
    points = _numbers(coordinates, file, "coordinates")
    require_count("nodes", len(points), file.header.count("nodes", path), path)
    if points.shape[1] != 3:
        raise InputError(
            f"The coordinates in {path} have {points.shape[1]} columns instead of x, y and z; "
            "export 3D data."
        )
    (elements,) = _only(file, "elements")
    corners = _numbers(elements, file, "elements")
    require_count("elements", len(corners), file.header.count("elements", path), path)
    if corners.shape[1] != 4:
        raise InputError(
            f"The elements in {path} have {corners.shape[1]} corners, so they are a surface; light "
            "needs the air between, so export tetrahedra (the volume)."
        )
    tetrahedra = corners.astype(np.int64)
    if (
        not np.array_equal(tetrahedra, corners)
        or tetrahedra.min() < 1
        or (tetrahedra.max() > len(points))
    ):
        raise InputError(
            f"The elements in {path} name points from {corners.min():g} to {corners.max():g}, but "
            f"it has points 1 to {len(points)}; the file is damaged, so export it again."
        )
    return Table(
        points,
        sectionwise_columns(file),
        _results(file, len(points)),
        (TETRAHEDRON, tetrahedra - 1),
    )


def grid_table(file: TextFile) -> Table:
    """Points, cells and results of a file in grid format: x runs along the rows, then y, then z."""
    (grid,) = _only(file, "grid")
    if len(grid.rows) != 3:
        raise InputError(
            f"The grid in {file.path} has {len(grid.rows)} rows instead of one each for x, y and "
            "z; export 3D data."
        )
    axes = [numbers([row], separator_of(row), file.path, "grid").ravel() for row in grid.rows]
    z, y, x = np.meshgrid(*axes[::-1], indexing="ij")
    points = np.stack((x.ravel(), y.ravel(), z.ravel()), axis=1)
    counts = (len(axes[0]), len(axes[1]), len(axes[2]))
    return Table(points, sectionwise_columns(file), _results(file, len(points)), box_cells(counts))


def _results(file: TextFile, count: int) -> FloatArray:
    values = []
    for section in _sections(file, "data"):
        data = _numbers(section, file, "data").ravel()
        if len(data) != count:
            raise InputError(
                f"A section of data in {file.path} has {len(data)} values for {count} points: it "
                "was cut short or edited; export it again."
            )
        values.append(data)
    return np.stack(values, axis=1)


def _title(section: Section) -> str:
    place = max(k for k, line in enumerate(section.comments) if _TITLE.fullmatch(line))
    found = _TITLE.fullmatch(section.comments[place])
    inside = found["inside"] if found else None
    below = [line for line in section.comments[place + 1 :] if not is_entry(line)]
    return inside or (below[0].removeprefix("%").strip() if below else "")


def _sections(file: TextFile, kind: str) -> list[Section]:
    return [section for section in file.sections if section.kind == kind]


def _only(file: TextFile, kind: str) -> list[Section]:
    found = _sections(file, kind)
    if len(found) != 1:
        raise InputError(
            f"{file.path} has {len(found)} sections of {kind} (% {kind.capitalize()}) instead of "
            "one; export it again."
        )
    return found


def _numbers(section: Section, file: TextFile, what: str) -> FloatArray:
    # Rows of data have one number, whose decimal comma must not be taken for a separator.
    separator = separator_of(file.sections[0].rows[0])
    return numbers(section.rows, separator, file.path, what)
