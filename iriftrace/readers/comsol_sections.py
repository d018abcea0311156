"""A COMSOL text file as its sections: comments above, rows of numbers below."""

from __future__ import annotations

import re
from pathlib import Path

from attrs import frozen

from iriftrace.errors import InputError
from iriftrace.readers.comsol_header import Header, header_of
from iriftrace.readers.number_table import is_numbers

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
