"""The header of COMSOL's text exports: what it says of the file, and the names of its columns."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path

from attrs import frozen

from iriftrace.errors import InputError
from iriftrace.readers.states import Column, column_of

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
