"""COMSOL's sectionwise and grid formats: coordinates, then cells, then one section a result."""

from __future__ import annotations

import re

import numpy as np

from iriftrace.errors import InputError
from iriftrace.field_cells import TETRAHEDRON
from iriftrace.readers.comsol_header import is_entry
from iriftrace.readers.comsol_sections import Section, TextFile
from iriftrace.readers.comsol_table import (
    FloatArray,
    Table,
    box_cells,
    require_count,
)
from iriftrace.readers.number_table import numbers, separator_of
from iriftrace.readers.states import Column, column_of

_TITLE = re.compile(r"%\s*Data\s*(?:\((?P<inside>.*)\))?\s*", re.IGNORECASE)


def columns(file: TextFile) -> list[Column]:
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


def table(file: TextFile) -> Table:
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
    return Table(points, columns(file), _results(file, len(points)), (TETRAHEDRON, tetrahedra - 1))


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
    return Table(points, columns(file), _results(file, len(points)), box_cells(counts))


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
