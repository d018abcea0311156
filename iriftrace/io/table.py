"""Tables in text files, read by pandas (exactly, from 3.1 on): a line of names, then rows.

Lines above the rows are remarks, the last one has the names; all of them may begin with ``#``,
``%`` or ``//``. Names are ``T``, ``T [K]``, ``T (K)`` or ``T_K``. A comma is a decimal sign where
semicolons, tabs or blanks separate and no number has a point.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from attrs import evolve, frozen

from iriftrace.core.arrays import AnyArray, BoolArray, FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.files import text_in
from iriftrace.core.units import LENGTH_UNITS, length_unit_of, stated_length_unit
from iriftrace.io.refusals import damaged, not_read, one_unit
from iriftrace.io.states import Column, column_of

MARKS = ("#", "%", "//")
"""Signs at the beginning of a comment."""

AXES = ("x", "y", "z")

_COORDINATES = (
    AXES,
    *(tuple(f"points{mark}{axis}" for axis in range(3)) for mark in ":_"),  # ParaView
    tuple(f"{axis}-coordinate" for axis in AXES),  # Fluent
)
_BLANKS = " "
_MARK = re.compile(r"\s*(?:[#%]+|//)\s*")
_SEPARATOR_LINE = re.compile(r"\s*\"?sep=(.)\"?\s*")  # of Excel
_NUMBER = re.compile(r"[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?|[-+]?(?:inf|nan)", re.I)
_GAP = re.compile(r"null|#n/a|-?1\.#(?:qnan|ind)\w*", re.IGNORECASE)
"""A missing number as CFD-Post, Excel and C write it; pandas reads them as such."""

_UNIT_BEHIND = re.compile(
    r"(?P<axis>[xyzXYZ])_(?P<length>um|mm|cm|m|inch|in)|(?P<name>.+)_(?P<unit>K|degC|degF)"
)
_MOST_LISTED = 20


@frozen(eq=False)
class Table:
    """The rows of a text file, and what is above them."""

    path: Path
    remarks: tuple[str, ...]  # lines above that of the names, as written
    header: str  # the line above the rows, without its mark; "" if there is none
    names: tuple[str, ...]  # words of the header, of which there may be fewer or more than columns
    separator: str  # " " for blanks
    decimal: str
    cells: pd.DataFrame
    lines: Sequence[int]  # number of each row's line in the file, from 1

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.cells.columns)

    @property
    def columns(self) -> list[Column]:
        """Names and units of all columns; an InputError if the header does not name each."""
        if len(self.names) != self.width:
            last = f" (the last one is {self.header!r})" if self.header else ""
            raise InputError(
                f"{self.path} has rows of {self.width} columns, which no line above them "
                f"names{last}; write a name for each column, and if it is a matrix of pixels, a "
                "table with their positions.",
                code="table.columns",
            )
        return [_column(name) for name in self.names]

    @property
    def coordinates(self) -> list[int]:
        """Numbers of the columns x, y and z; an InputError if there is not one of each."""
        names = [column.name.casefold() for column in self.columns]
        found = [set(axes) for axes in _COORDINATES if not set(axes).isdisjoint(names)]
        for axes in _COORDINATES:
            if found == [set(axes)] and all(names.count(axis) == 1 for axis in axes):
                return [names.index(axis) for axis in axes]
        raise InputError(
            f"{self.path} has the columns {listed(self.names)}, of which not one each is x, y and "
            "z; name them so.",
            code="table.columns",
        )

    def length_unit(self, places: Sequence[int]) -> str:
        """Unit of lengths that the names of some columns state, or a remark; "" for none.

        An InputError where they state several, or one that is not known.
        """
        named = len(self.names) == self.width
        units = [self.columns[place].unit for place in places] if named else []
        stated = {LENGTH_UNITS.get(unit.casefold(), unit) for unit in units if unit}
        if stated - set(LENGTH_UNITS.values()):
            raise InputError(
                f"{self.path} states lengths in {', '.join(sorted(stated))}, which is not known "
                "here; export them in mm.",
                code="units.unknown",
            )
        return one_unit(self.path, (*stated, length_unit_of(self.remarks, self.path.name)))

    def numbers(self, places: Sequence[int]) -> FloatArray:
        """Some columns as numbers, (rows, columns); NaN where they are missing.

        An InputError for a cell that is not a number.
        """
        found = np.empty((len(self.cells), len(places)))
        for k, place in enumerate(places):
            column = self.cells[place]
            if self.has_words(place):
                column = column.map(self._number, na_action="ignore")
                if (wrong := column.isna() & self.cells[place].notna()).any():
                    row = int(np.argmax(wrong))
                    cell = self.cells[place].iloc[row]
                    fault = f"line {self.lines[row]}: {cell!r} is not a number"
                    raise damaged(self.path, fault, "correct or remove this row")
            found[:, k] = column.to_numpy(dtype=np.float64, na_value=np.nan)
        return found

    def _number(self, cell: object) -> float | None:
        text = str(cell).strip().replace(self.decimal, ".")
        return float(text) if _NUMBER.fullmatch(text) and "," not in text else None

    def where(self, chosen: BoolArray) -> Table:
        """The table with some of its rows, by a mask."""
        lines = [line for line, is_chosen in zip(self.lines, chosen, strict=True) if is_chosen]
        return evolve(self, cells=self.cells[chosen], lines=lines)

    def has_words(self, place: int) -> bool:
        """Whether a column has cells that are neither numbers, true or false, nor missing."""
        kind: AnyArray = self.cells[place].dropna().infer_objects().to_numpy()
        return kind.dtype.kind not in "fiub"


def read_table(path: Path) -> Table:
    """Read a table from a file, as `table_in`."""
    return table_in(text_in(path), path)


def table_in(text: str, path: Path, separator: str = "") -> Table:
    """Read a table from the text of a file.

    Rows begin with the first line that has a number in a cell and is no comment. Where the
    `separator` is not given, it is that of a first line ``sep=;`` or of the first row. A separator
    at the end of all rows ends a last column, not one without a name.

    Raises InputError where there are no rows, where one has more or fewer cells than the first, or
    where a comment is between them.
    """
    if "\0" in text:
        raise damaged(path, "it is not text", "export it again, in UTF-8")
    lines = text.splitlines()
    if lines and (stated := _SEPARATOR_LINE.fullmatch(lines[0])):
        lines[0], separator = "", stated[1]
    # Tables of spreadsheets end with rows of empty cells, COMSOL's header with an empty comment.
    filled = [number for number, line in enumerate(lines) if line.strip(' \t,;"#%/')]
    begin = next((k for k, number in enumerate(filled) if _is_row(lines[number])), None)
    if begin is None:
        raise damaged(path, "it has no row of numbers")
    above, first = filled[:begin], filled[begin]
    last_row = max(number for number in filled[begin:] if not _is_comment(lines[number]))
    separator = separator or separator_of(lines[first])
    # A row of empty cells between others is a place of an organised cloud without a point.
    known = set(filled)
    body = [
        number
        for number in range(first, last_row + 1)
        if number in known or (separator != _BLANKS and separator in lines[number])
    ]
    if among := next((number for number in body if _is_comment(lines[number])), 0):
        found = f"a comment between rows, in line {among + 1}: {lines[among].strip()!r}"
        raise not_read(path, found, "give each table as a file of its own, or remove it")
    rows = [lines[number] for number in body]
    width = _width(rows[0], separator)
    for number, row in zip(body, rows, strict=True):
        if (count := _width(row, separator)) != width:
            found = f"line {number + 1}: the row {row.strip()[:40]!r} has {count} columns, but "
            found += f"the first one has {width}"
            remedy = "give a whole file with one table, not settings above a matrix of pixels"
            raise damaged(path, found, remedy)
    decimal = _decimal(rows, separator, path)
    cells = _cells(rows, separator, decimal, path)
    remarks = [lines[number].strip() for number in above]
    # A unit of length is a remark also where it is below the names.
    last = next((k for k in reversed(range(len(above))) if not _states_unit(remarks[k])), None)
    header = "" if last is None else _MARK.sub("", remarks.pop(last), count=1)
    names = _names(header, width, separator)
    if names[width - 1 :] in ([], [""]) and all(
        row.rstrip(" ").endswith(separator) for row in rows
    ):
        names, cells = names[: width - 1], cells.iloc[:, :-1]
    places = [number + 1 for number in body]
    return Table(path, tuple(remarks), header, tuple(names), separator, decimal, cells, places)


def separator_of(row: str) -> str:
    """Separator of the cells of a row: ``;``, a tab, a comma, or a blank for any number of them."""
    for mark in ";\t":
        if mark in row.strip(" "):
            return mark
    if "," not in row:
        return _BLANKS
    # A comma is a decimal sign where blanks separate, unless points are there too.
    pieces = row.split()
    decimal = len(pieces) > 1 and "." not in row and not any(p.endswith(",") for p in pieces)
    return _BLANKS if decimal else ","


def listed(names: Sequence[str]) -> str:
    """The first names, between commas."""
    rest = [f"and {len(names) - _MOST_LISTED} more"] if len(names) > _MOST_LISTED else []
    return ", ".join([*(name or '""' for name in names[:_MOST_LISTED]), *rest])


def _decimal(rows: Sequence[str], separator: str, path: Path) -> str:
    """Decimal sign of the numbers; an InputError if they have points and commas."""
    if separator == "," or not any(re.search(r"\d,\d", row) for row in rows):
        return "."
    if any(re.search(r"\d\.\d", row) for row in rows):
        found = "numbers with points and commas, of which either may be the decimal sign"
        raise not_read(path, found, "export them with decimal points and no other sign")
    return ","


def _cells(rows: Sequence[str], separator: str, decimal: str, path: Path) -> pd.DataFrame:
    try:
        cells = pd.read_csv(
            io.StringIO("\n".join(rows)),
            header=None,
            sep=r"\s+" if separator == _BLANKS else separator,
            decimal=decimal,
            skipinitialspace=True,
            skip_blank_lines=False,
            low_memory=False,
        )
    except (ValueError, OverflowError) as error:  # pandas' own errors are ValueErrors
        raise damaged(path, error) from error
    if len(cells) != len(rows):
        raise damaged(path, "it has a cell of several lines", "export it again without")
    return cells


def _is_row(line: str) -> bool:
    return not _is_comment(line) and any(map(_is_number, _words(line, separator_of(line))))


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(MARKS)


def _is_number(cell: str) -> bool:
    return bool(_NUMBER.fullmatch(cell) or _GAP.fullmatch(cell))


def _width(row: str, separator: str) -> int:
    if '"' in row or separator == _BLANKS:
        return len(_words(row, separator))
    return row.count(separator) + 1


def _words(line: str, separator: str) -> list[str]:
    """Cells of a line, without quotes."""
    if separator == _BLANKS:
        return line.split()
    try:
        cells = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    except csv.Error:  # a cell of more than 128 kB
        return [line]
    return [cell.strip() for cell in cells]


def _names(header: str, width: int, separator: str) -> list[str]:
    """Names of columns in a line; those between blanks may be padded, as ``Cp (J/(kg*K))``."""
    if separator != _BLANKS:
        names = _words(header, separator)
        return names[:width] if names[width:] == [""] else names
    padded = [name for name in re.split(r"\s{2,}|\t", header) if name]
    words = re.sub(r"\s+(?=[\[(])", "\0", header).split()
    return padded if len(padded) == width else [word.replace("\0", " ") for word in words]


def _column(name: str) -> Column:
    column = column_of(name)
    if column.unit is None and (found := _UNIT_BEHIND.fullmatch(column.name)):
        return Column(
            found["axis"] or found["name"], found["length"] or found["unit"], column.state
        )
    return column


def _states_unit(remark: str) -> bool:
    return _is_comment(remark) and bool(stated_length_unit(remark))
