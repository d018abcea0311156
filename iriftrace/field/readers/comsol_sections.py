"""The header of COMSOL's text exports: what it says of the file, and the names of its columns."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path

from attrs import frozen

from iriftrace.core.errors import InputError
from iriftrace.core.number_table import is_numbers
from iriftrace.field.readers.states import Column, column_of

_ENTRY = re.compile(
    r"%\s*(?P<key>Model|Version|Date|Dimension|Nodes|Elements|Expressions|Description|Length unit)"
    r"\s*:\s*(?P<value>.*)",
    re.IGNORECASE,
)
_PADDED = re.compile(r"\s{2,}|\t")
# An expression ends at its unit and state; names of coordinates have neither.
_NAMED = re.compile(
    r"\S.*?\s\((?:[^()]|\([^()]*\))+\)(?:\s+@\s+(?:\d+:\s+)?[^\s=]+=\S+(?:\s+[^\s=(]+=\S+)*)?"
)
_ASSIGNMENT = re.compile(r"\s*[\w.]+\s*=[^@()]*")


@frozen
class Header:
    """What COMSOL writes above its data.

    Attributes
    ----------
    entries : dict
        Values by key in lower case: ``model``, ``version``, ``dimension``, ``nodes``, ...
    """

    entries: dict[str, str]

    def count(self, key: str, path: Path) -> int | None:
        """A number that the header states, or None."""
        text = self.entries.get(key)
        if text is None:
            return None
        try:
            return int(text)
        except ValueError:
            raise InputError(
                f"The header of {path} gives {text!r} for {key}, which is no number; export the "
                "file again."
            ) from None

    @property
    def length_unit(self) -> str | None:
        """Unit of the coordinates, where the header states it."""
        text = self.entries.get("length unit", "")
        return {"µm": "um", "μm": "um", '"': "inch"}.get(text, text) or None

    def origin(self, state: str) -> str:
        """Program and model, as results state them."""
        model = self.entries.get("model", "")
        words = (
            self.entries.get("version", "COMSOL"),
            f"model {model}" if model else "",
            state,
        )
        return ", ".join(word for word in words if word)


def header_of(comments: Sequence[str]) -> Header:
    """Entries among the lines that begin with %."""
    entries: dict[str, str] = {}
    for line in comments:
        if found := _ENTRY.match(line):
            entries.setdefault(found["key"].lower(), found["value"].strip())
    return Header(entries)


def is_entry(line: str) -> bool:
    """Whether a line that begins with % is an entry, and not names of columns."""
    return _ENTRY.match(line) is not None


def columns_of(line: str, separator: str | None, count: int, path: Path) -> list[Column]:
    """Names of the columns.

    Parameters
    ----------
    line : str
        The line above the data, with or without its %.
    separator : str or None
        Between the numbers of a row; None for blanks.
    count : int
        Numbers in a row.
    path : Path
        For messages.

    Raises
    ------
    InputError
        The line names another number of columns.
    """
    text = line.strip().removeprefix("%").strip()
    if separator is None:
        names = [name for name in _PADDED.split(text) if name]
        if len(names) != count:
            # A name longer than its column leaves one blank only.
            words = text.split(None, 3)
            names = words[:3] + (_NAMED.findall(words[3]) if len(words) > 3 else [])
    else:
        names = _rejoined(next(csv.reader([text], delimiter=separator, skipinitialspace=True)))
    if len(names) != count:
        raise InputError(
            f"The header of {path} names {len(names)} columns, but its rows have {count}, so it is "
            "not clear which is which; export it again with one delimiter and a point as decimal "
            "sign."
        )
    return [column_of(name) for name in names]


def _rejoined(pieces: Sequence[str]) -> list[str]:
    """Names split at the commas between several parameters of one state."""
    names: list[str] = []
    for piece in pieces:
        if names and "@" in names[-1] and _ASSIGNMENT.fullmatch(piece):
            names[-1] += f", {piece.strip()}"
        else:
            names.append(piece.strip())
    return names


# MERGE readers.comsol_sections: A COMSOL text file as its sections: comments above, rows of numbe

_KIND = re.compile(r"%\s*(?P<word>Coordinates|Elements|Data|Grid)\b(?!\s*:)", re.IGNORECASE)


@frozen(eq=False)
class Section:
    """Rows that follow each other, with the comments right above them.

    Attributes
    ----------
    comments : list of str
        Lines that begin with %; for a spreadsheet without %, the line with the names.
    rows : list of str
        The lines below, without empty ones.
    """

    comments: list[str]
    rows: list[str]

    @property
    def kind(self) -> str:
        """``"coordinates"``, ``"elements"``, ``"data"`` or ``"grid"``, as the comments say; ""."""
        found = [match["word"].lower() for line in self.comments if (match := _KIND.match(line))]
        return found[-1] if found else ""


@frozen(eq=False)
class TextFile:
    """A text export.

    Attributes
    ----------
    path : Path
    header : Header
    sections : list of Section
        At least one, all with rows.
    """

    path: Path
    header: Header
    sections: list[Section]

    @property
    def layout(self) -> str:
        """``"sectionwise"``, ``"grid"`` or ``"spreadsheet"``."""
        kinds = {section.kind for section in self.sections}
        if "coordinates" in kinds or "elements" in kinds:
            return "sectionwise"
        return "grid" if "grid" in kinds else "spreadsheet"


def text_file(path: Path) -> TextFile:
    """Read a text export and split it.

    Raises
    ------
    InputError
        It is no text, has no rows of numbers, or is a table that is not three-dimensional.
    """
    raw = path.read_bytes()
    if b"\0" in raw[:4096]:
        raise InputError(f"{path} is not text; export it again as a text file in UTF-8.")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    sections: list[Section] = []
    comments: list[str] = []
    for line in text.splitlines():
        line = line.strip()
        if not line:
            continue
        if line.startswith("%"):
            comments.append(line)
        elif not sections and not is_numbers(line):
            comments.append(line)
        elif comments or not sections:
            sections.append(Section(comments, [line]))
            comments = []
        else:
            sections[-1].rows.append(line)
    if not sections:
        raise InputError(f"{path} has no rows of numbers; is it a complete export?")
    header = header_of([line for section in sections for line in section.comments])
    dimension = header.count("dimension", path)
    if dimension is not None and dimension != 3:
        raise InputError(
            f"{path} holds data in {dimension} dimensions, and light needs the air in three; "
            "revolve or extrude them to a 3D dataset in COMSOL and export that."
        )
    return TextFile(path, header, sections)
