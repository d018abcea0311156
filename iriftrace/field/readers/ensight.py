"""Read one state of an EnSight case (``.case``, ``.encas``), as Fluent and STAR-CCM+ export it."""

from __future__ import annotations

import re
from pathlib import Path

from iriftrace.core.errors import InputError
from iriftrace.core.files import sha256_of
from iriftrace.field.readers.states import Contents, State, state_number
from iriftrace.field.readers.vtk_process import read_ensight

_FORMAT = re.compile(r"^\s*type\s*:\s*ensight", re.IGNORECASE | re.MULTILINE)
_TIMES = re.compile(r"^\s*time values\s*:(?P<values>[-+.\deE\s]*)", re.IGNORECASE | re.MULTILINE)


def states(path: Path) -> list[State]:
    """Label and time of every state in a case, at least one."""
    times = _times(path)
    return [(f"t = {time}", float(time)) for time in times] or [("", None)]


def read(path: Path, member: int | None) -> Contents:
    """The parts of one state; an InputError if the case or a file that it names is damaged."""
    found = states(path)
    number = state_number(found, member, path)
    times = _times(path)
    data = read_ensight(path, times[number] if times else "")
    return Contents(data, sha256_of(path), found, origin=found[number][0])


def _times(path: Path) -> list[str]:
    """Time values as they are written, of the longest time set; none for a steady case."""
    text = path.read_text(errors="replace")
    if not _FORMAT.search(text):
        raise InputError(
            f"{path} is no EnSight case (it states no `type: ensight`); name the field's file, or "
            "the folder of an OpenFOAM case."
        )
    sets = [match["values"].split() for match in _TIMES.finditer(text)]
    times = max(sets, key=len, default=[])
    try:
        list(map(float, times))
    except ValueError:
        raise InputError(
            f"The time values in {path} are no numbers; export the case again."
        ) from None
    return times
