"""Read one state of an EnSight case (``.case``, ``.encas``), as Fluent and STAR-CCM+ export it."""

from __future__ import annotations

import codecs
import re
from pathlib import Path

from iriftrace.core.errors import InputError
from iriftrace.core.files import sha256_of
from iriftrace.io.refusals import damaged, not_read
from iriftrace.io.states import Contents, State, state_number, states_at
from iriftrace.io.vtk_check import read_ensight

_FORMAT = re.compile(r"^[\ufeff\s]*type\s*:\s*ensight", re.IGNORECASE | re.MULTILINE)
_ENTRY = re.compile(
    r"^[ \t]*(?P<key>[a-z][a-z ]*?)\s*:(?P<value>.*)$", re.IGNORECASE | re.MULTILINE
)
_SECTION = re.compile(r"^\s*(format|geometry|variable|time|file)\s*$", re.IGNORECASE | re.MULTILINE)
_STEPS = re.compile(r"^\s*number of steps\s*:\s*(\d+)", re.IGNORECASE | re.MULTILINE)
_TIMES = re.compile(r"^\s*time values\s*:(?P<values>[-+.\deE\s]*)", re.IGNORECASE | re.MULTILINE)


def states(path: Path) -> list[State]:
    """Label and time of every state in a case, at least one."""
    return states_at(_times(path))


def read(path: Path, member: int | None) -> Contents:
    """The parts of one state; raises InputError if the case or a file that it names is damaged."""
    times = _times(path)
    found = states_at(times)
    number = state_number(found, member, path)
    data = read_ensight(path, times[number] if times else "")
    return Contents(data, sha256_of(path), found, origin=found[number][0])


def _times(path: Path) -> list[str]:
    """Time values as they are written, of the longest time set; none for a steady case."""
    wide = path.read_bytes()[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
    text = path.read_text(encoding="utf-16" if wide else "utf-8", errors="replace")
    if not _FORMAT.search(text):
        raise InputError(
            f"{path} is not an EnSight case (it states no `type: ensight`); name the field's file, "
            "or the folder of an OpenFOAM case.",
            code="file.damaged",
        )
    _refuse_unread(path, text)
    sets = [match["values"].split() for match in _TIMES.finditer(text)]
    times = max(sets, key=len, default=[])
    steps = max(map(int, _STEPS.findall(text)), default=0)
    if steps > max(1, len(times)):
        raise damaged(path, f"it states {steps} steps and {len(times)} time values")
    try:
        list(map(float, times))
    except ValueError:
        raise damaged(path, "its time values are not numbers") from None
    return times


def _refuse_unread(path: Path, text: str) -> None:
    """Refuse a case that VTK does not read although other programs do."""
    marks = (codecs.BOM_UTF8, codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
    entries = [(entry["key"], entry["value"]) for entry in _ENTRY.finditer(text)]
    lower = "".join(key + (value if key.lower() == "type" else "") for key, value in entries)
    upper = "".join(_SECTION.findall(text))
    if path.read_bytes().startswith(marks) or lower != lower.lower() or upper != upper.upper():
        raise not_read(
            path,
            "a byte order mark or keywords in other letters",
            "save it as plain text, with FORMAT, GEOMETRY and VARIABLE in capitals and the other "
            "keywords in lower case (`type: ensight gold`)",
        )
    for key, value in entries:
        if key != "type" and re.search(r"\\|\s\"?/|[A-Za-z]:/", value):
            raise not_read(
                path,
                f"a file named by its folder ({value.strip()})",
                "put its files next to it and name them without folders",
            )
        words = value.replace("change_coords_only", "").strip().strip('"').split()
        if words and re.match(r"model|(scalar|vector|tensor \w+) per (node|element)", key):
            name = words[-1].strip('"')
            # Asterisks are digits of a time step.
            if not any(path.parent.glob(name.replace("*", "?"))):
                raise InputError(
                    f"{path} names {name}, which is not next to it; copy all its files.",
                    code="file.missing",
                )
