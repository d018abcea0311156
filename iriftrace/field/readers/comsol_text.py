"""Split COMSOL's text exports into header entries, sections of numbers and named columns.

Lines that begin with % or # are comments: entries of the header (``% Nodes: 1000``, in .csv files
``% Nodes,1000``), titles of sections (``% Coordinates``, ``% Data (T (K) @ t=1)``), or the names of
a spreadsheet's columns.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path

from attrs import evolve, frozen

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.files import text_in
from iriftrace.core.number_table import (
    closed_by,
    is_numbers,
    numbers,
    separator_of,
    with_gaps,
    without_statistics,
)
from iriftrace.core.units import LENGTH_UNITS, stated_length_unit
from iriftrace.field.readers.states import Column, column_of

AXES = ("x", "y", "z")
_COORDINATE = re.compile(
    r"(?P<axis>[xyz])(?:[-_ ]?(?:coord(?:inate)?|koordinate|location|position))?"
    r"(?:_(?P<unit>um|mm|cm|m|in|inch))?"
    r"|points?[:_](?P<number>[012])",
    re.IGNORECASE,
)
"""Names of coordinates: "x", "x-coordinate" (Fluent), "X Location" (ANSYS), "Points:0", "x_mm"."""
_COMPLEX = re.compile(r"[\d.][+-][\d.eE+-]*[ij](?:[\s,;]|$)")
_TECPLOT = re.compile(r"\s*(?:TITLE|VARIABLES)\s*=", re.IGNORECASE)

# A key is followed by a sign of any kind or, before a single word, by blanks.
_SET = r"\s*\"?\s*(?:[:;,=\t]|(?<=\s)(?=[^\s(]+$))"
_NODES = ("nodes", *"knoten nœuds noeuds nodi nodos 节点 節點 ノード 노드".split())
_ENTRY = re.compile(
    rf"[%#]*\s*\"?(?P<key>Model|Version|Date|Dimension|{'|'.join(_NODES)}|Elements|Expressions"
    rf"|Description|Length[ _]units?){_SET}\s*(?P<value>.*)",
    re.IGNORECASE,
)
_KIND = re.compile(r"[%#]\s*(?P<word>Coordinates|Elements|Data|Grid)\s*(?:\(|$)", re.IGNORECASE)
_DATA_TITLE = re.compile(r"[%#]\s*Data\s*(?:\((?P<inside>.*)\))?\s*", re.IGNORECASE)
_PADDED = re.compile(r"\s{2,}|\t")
# An expression ends at its unit and state; names of coordinates have neither.
_NAMED = re.compile(
    r"\S.*?\s\((?:[^()]|\([^()]*\))+\)(?:\s+@\s+(?:\d+:\s+)?[^\s=]+=\S+(?:\s+[^\s=(]+=\S+)*)?"
)
_ASSIGNMENT = re.compile(r"\s*[\w.]+\s*=[^@()]*")


@frozen(eq=False)
class Section:
    """Rows that follow each other, with the comments right above them."""

    comments: list[str]  # begin with % or #, except the names of a spreadsheet without either
    rows: list[str]

    @property
    def kind(self) -> str:
        """``"coordinates"``, ``"elements"``, ``"data"`` or ``"grid"``, as the comments say; ""."""
        found = [match["word"].lower() for line in self.comments if (match := _KIND.match(line))]
        return found[-1] if found else ""

    @property
    def titles(self) -> list[str]:
        """Comments that are not entries of the header."""
        return [line for line in self.comments if not _ENTRY.match(line)]

    @property
    def data_title(self) -> str:
        """Name of the results in a section of data: in its title or on the line below; or ""."""
        title = [_DATA_TITLE.fullmatch(line) for line in self.titles]
        place = max(k for k, found in enumerate(title) if found)
        found, below = title[place], self.titles[place + 1 :]
        inside = found["inside"] if found else None
        return inside or (_text_of(below[0]) if below else "")


@frozen(eq=False)
class TextFile:
    """A text export: values of its header by key in lower case, and at least one section."""

    path: Path
    entries: dict[str, str]
    sections: list[Section]

    @property
    def layout(self) -> str:
        """``"sectionwise"``, ``"grid"`` or ``"spreadsheet"``."""
        kinds = {section.kind for section in self.sections}
        if "coordinates" in kinds or "elements" in kinds:
            return "sectionwise"
        return "grid" if "grid" in kinds else "spreadsheet"

    @property
    def separator(self) -> str | None:
        """Separator of the numbers in a row; None for blanks."""
        return separator_of(self.sections[0].rows[0])

    @property
    def length_unit(self) -> str | None:
        """Unit of the coordinates, where the header states it."""
        text = self.entries.get("length unit", "").strip("[]() ")
        text = text or next(filter(None, map(stated_length_unit, self.sections[0].comments)), "")
        return text or None

    def origin(self, state: str) -> str:
        """Program, model and state, as a result states its origin."""
        model = self.entries.get("model", "")
        words = (self.entries.get("version", "COMSOL"), f"model {model}" if model else "", state)
        return ", ".join(filter(None, words))

    def of_kind(self, kind: str) -> list[Section]:
        """The sections of one kind."""
        return [section for section in self.sections if section.kind == kind]

    def only(self, kind: str) -> Section:
        """The only section of a kind; raises InputError if there is none, or several."""
        found = self.of_kind(kind)
        if len(found) != 1:
            raise InputError(
                f"{self.path} has {len(found)} sections of {kind} (% {kind.capitalize()}) instead "
                "of one; export it again."
            )
        return found[0]

    def numbers(self, rows: Sequence[str], what: str) -> FloatArray:
        """Rows of the file as an array (rows, columns); `what` they are, for messages."""
        # Rows of data have one number, whose decimal comma must not be taken for a separator.
        return numbers(rows, self.separator, self.path, what)

    def count(self, key: str) -> int | None:
        """A number in the header, or None; raises InputError if it is not a number."""
        text = self.entries.get(key)
        try:
            return None if text is None else int(text)
        except ValueError:
            raise InputError(
                f"The header of {self.path} gives {text!r} for {key}, not a number; export "
                "the file again."
            ) from None

    def check_count(self, key: str, *found: int) -> None:
        """Refuse another number of nodes, elements or expressions than the header states."""
        stated = self.count(key)
        if stated is not None and stated not in found:
            raise InputError(
                f"The header of {self.path} counts {stated} {key}, but the file has {found[0]}: it "
                "was cut short or edited; export it again."
            )

    def check_expressions(self, columns: Sequence[Column]) -> None:
        """The same for results; an expression counts once, or once for each of several states."""
        if columns:
            self.check_count("expressions", len(columns), len({column.name for column in columns}))


def text_file(path: Path) -> TextFile:
    """Read a text export and split it; raises InputError if it is not a table in 3D."""
    text = text_in(path)
    if "\0" in text[:4096]:
        raise InputError(f"{path} is not text; export it again as a text file in UTF-8.")
    sections: list[Section] = []
    comments: list[str] = []
    for line in filter(None, map(str.strip, without_statistics(text.splitlines(), path))):
        # The comment mark may stand in the quotation marks of the first word.
        line = with_gaps(re.sub(r'^"\s*([%#]+)\s*', r'\1 "', line))
        if not line.strip('%#" ,;\t'):
            continue
        if line.startswith(("%", "#")) or (not sections and not is_numbers(line)):
            comments.append(line)
        elif comments or not sections:
            sections.append(Section(comments, [line]))
            comments = []
        else:
            sections[-1].rows.append(line)
    if any(map(_TECPLOT.match, sections[0].comments if sections else comments)):
        raise InputError(
            f"{path} is a file of Tecplot, which is not read; export VTK, EnSight or CGNS from "
            "there."
        )
    if not sections:
        complex_values = any(map(_COMPLEX.search, comments))
        raise InputError(
            f"{path} holds complex values; export their real part, such as real(T)."
            if complex_values
            else f"{path} has no rows of numbers; is it a complete export?"
        )
    entries: dict[str, str] = {}
    for line in (line for section in sections for line in section.comments):
        if found := _ENTRY.match(line):
            key = re.sub("length.unit.*", "length unit", found["key"].lower())
            key = "nodes" if key in _NODES else key
            # Spreadsheet programs fill all rows up to the same number of columns.
            entries.setdefault(key, found["value"].rstrip(" ,;\t").strip('" '))
    file = TextFile(path, entries, sections)
    dimension = file.count("dimension")
    if dimension is not None and dimension != 3:
        raise InputError(
            f"{path} holds data in {dimension} dimensions, but rays need the air in three; "
            "revolve or extrude them to a 3D dataset in COMSOL and export that."
        )
    return file


def _text_of(comment: str) -> str:
    """A comment without its mark."""
    return comment.lstrip("%#").strip()


def spreadsheet_columns(file: TextFile) -> list[Column]:
    """All columns of a spreadsheet, coordinates included; InputError if these are not all named."""
    first = file.sections[0]
    if not first.titles:
        raise InputError(
            f"{file.path} has no header line that names its columns (% x y z T (K)), so the "
            "temperature cannot be identified; export it with its header."
        )
    separator = file.separator
    rows = [row for section in file.sections for row in section.rows]
    count = len(first.rows[0].split(separator)) - closed_by(rows, separator)
    names = _names(_text_of(first.titles[-1]), count, separator)
    units = [name.strip("[]() ") for name in names]
    if len(first.titles) > 1 and sum(unit.casefold() in LENGTH_UNITS for unit in units) == 3:
        # A row of units stands below that of the names.
        above = _names(_text_of(first.titles[-2]), count, separator)
        if len(above) == len(units):
            names = [f"{name} [{unit}]" for name, unit in zip(above, units, strict=True)]
    if len(names) != count and len(file.sections) > 1:
        titles = ", ".join(section.titles[-1] for section in file.sections if section.titles)
        raise InputError(
            f"{file.path} has {len(file.sections)} sections of numbers whose titles ({titles}) are "
            "not those of COMSOL in English; export a spreadsheet, or with COMSOL in English."
        )
    if len(names) != count:
        raise InputError(
            f"The header of {file.path} names {len(names)} columns, but its rows have {count}, so "
            "it is not clear which is which; export it again with one delimiter and a point as "
            "decimal sign."
        )
    for title in (title for section in file.sections[1:] for title in section.titles):
        others = _names(_text_of(title), count, separator)
        if len(others) == count and title not in first.titles and not is_numbers(_text_of(title)):
            raise InputError(
                f"{file.path} has other columns from {title!r} on; give a file with one table, or "
                "correct that row."
            )
    columns = []
    for column in map(column_of, names):
        if match := _COORDINATE.fullmatch(column.name):
            axis = match["axis"] or AXES[int(match["number"])]
            column = evolve(column, name=axis.lower(), unit=column.unit or match["unit"])
        columns.append(column)
    found = [column.name.lower() for column in columns]
    if any(found.count(axis) != 1 for axis in AXES):
        raise InputError(
            f"{file.path} needs one column each of x, y and z, but has "
            f"{', '.join(column.name for column in columns)}; export 3D data in x, y and z."
        )
    return columns


def _names(line: str, count: int, separator: str | None) -> list[str]:
    """Names of `count` columns in a line."""
    if separator is None:
        # Names are padded with blanks to the width of their columns.
        names = [name for name in _PADDED.split(line) if name]
        if len(names) == count:
            return names
        words = re.sub(r"\s+(?=[\[(])", "", line).split()
        if len(words) == count and not any(word[0] in "([@" for word in words):
            return words
        # A name longer than its column is followed by a single blank.
        words = line.split(None, 3)
        return words[:3] + (_NAMED.findall(words[3]) if len(words) > 3 else [])
    names = []
    for piece in next(csv.reader([line], delimiter=separator, skipinitialspace=True)):
        # Commas between several parameters of one state do not separate.
        if names and "@" in names[-1] and _ASSIGNMENT.fullmatch(piece):
            names[-1] += f", {piece.strip()}"
        else:
            names.append(piece.strip())
    return names[:count] if names[count:] == [""] else names


def section_columns(file: TextFile) -> list[Column]:
    """Results of a sectionwise or grid file, one for each section of data.

    Their names are in the section's title, ``% Data (T (K) @ t=1)``, or in a line below it.
    Otherwise the header's description must name them, without units; else raises InputError.
    """
    sections = file.of_kind("data")
    if not sections:
        raise InputError(f"{file.path} has no section of data (% Data); export it again.")
    titles = [section.data_title for section in sections]
    if not all(titles):
        titles = [name.strip() for name in file.entries.get("description", "").split(",")]
        if len(titles) != len(sections) or not all(titles):
            raise InputError(
                f"{file.path} does not name its {len(sections)} sections of data, so the "
                "temperature cannot be identified; export it with its header."
            )
    return [column_of(title) for title in titles]
