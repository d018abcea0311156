"""Field files of any format: list their states, choose among them, and read one.

Every reader has two functions: ``states(path)`` lists label and time of the states in a file, and
``read(path, number)`` reads one of them as `iriftrace.io.states.Contents`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

from attrs import evolve, frozen

from iriftrace.core.errors import InputError
from iriftrace.core.files import short_names
from iriftrace.io import cgns, comsol, ensight, exodus, openfoam, vtk_files, xdmf
from iriftrace.io.refusals import check_ending, check_exists
from iriftrace.io.states import Contents, State


class Reader(Protocol):
    """A module that reads files of one format."""

    def states(self, path: Path) -> list[State]: ...

    def read(self, path: Path, member: int | None) -> Contents: ...


_READERS: dict[str, Reader] = {
    **dict.fromkeys((".vtu", ".pvtu", ".vtk", ".vti", ".vtr", ".vts", ".vtm"), vtk_files),
    **dict.fromkeys(vtk_files.SERIES, vtk_files),
    **dict.fromkeys((".case", ".encas"), ensight),
    **dict.fromkeys((".e", ".ex2", ".exo"), exodus),
    ".cgns": cgns,
    **dict.fromkeys((".xdmf", ".xmf"), xdmf),
    **dict.fromkeys((".foam", ".openfoam"), openfoam),
    **dict.fromkeys((".txt", ".csv", ".dat"), comsol),
}
SUFFIXES = tuple(_READERS)
"""Suffixes of files that can hold a field; an OpenFOAM case may also be named by its folder."""
COMPRESSED = (".gz", ".zip", ".bz2", ".xz", ".7z")

# Solvers write their times with six digits or more.
_SAME_TIME = 1e-5


@frozen
class Member:
    """One state of a field file."""

    path: Path  # the file, or the folder of a case
    # Such as "t = 2.5" or "t=2, P=100"; "" if the file has one state without a name.
    label: str
    time: float | None  # in the file's unit, usually s; None if the file does not state it
    index: int  # number in the file, from 0; ``member`` of `iriftrace.io.field.read_field`


def reader_of(path: Path) -> Reader:
    """Reader of a field file or of a case's folder; InputError if there is none for it."""
    if path.is_dir():
        if openfoam.is_case(path):
            return openfoam
        raise InputError(
            f"The folder {path} is not an OpenFOAM case (it has neither system/controlDict nor "
            "constant/polyMesh); name the case's folder or the field's file.",
            code="case.no_case",
        )
    check_exists(path)
    suffix = path.suffix.lower()
    if path.name == "controlDict":
        return openfoam
    if suffix in COMPRESSED:
        raise InputError(f"{path} is compressed; unpack it first.", code="file.packed")
    check_ending(path, SUFFIXES, "a field file")
    return _READERS[suffix]


def read_state(path: Path, number: int | None, *, flow: bool = False) -> Contents:
    """Read one state of a field file; see `iriftrace.io.field.read_volume`."""
    reader = reader_of(path)
    with _file_errors(path):
        if reader is openfoam:
            return openfoam.read(path, number, flow=flow)
        return reader.read(path, number)


def members(path: str | Path) -> tuple[Member, ...]:
    """States, at least one, of a file or folder that `read_field` reads; InputError otherwise."""
    path = Path(path)
    reader = reader_of(path)
    with _file_errors(path):
        states = reader.states(path)
    return tuple(Member(path, label, time, index) for index, (label, time) in enumerate(states))


def member_at(path: str | Path, when: str) -> Member:
    """The state that a user names: ``"latest"``, ``"first"``, a time such as ``"2.5"``, or a label.

    Raises InputError if the file has no such state; the message lists those it has.
    """
    found = members(path)
    word = when.strip()
    if word in ("latest", "first"):
        return found[-1 if word == "latest" else 0]
    by_label = [m for m in found if _plain(m.label) == _plain(word)]
    try:
        time = float(word)
    except ValueError:
        time = math.nan
    chosen = by_label or [
        m
        for m in found
        if m.time is not None and math.isclose(m.time, time, rel_tol=_SAME_TIME, abs_tol=1e-12)
    ]
    if len(chosen) != 1:
        what = "no state" if not chosen else "several states"
        raise InputError(
            f"{path} has {what} {word!r}: it has {_listed(found)}.",
            code="field.no_state",
            argument="time",
        )
    return chosen[0]


def chosen_members(paths: Sequence[str | Path], when: str | None = None) -> tuple[Member, ...]:
    """States of several files that form an ensemble, with unique labels.

    `when` is one state of each file as in `member_at`, a span of times ``"FIRST:LAST"``, or
    ``"all"``; by default all states, or the latest one of an OpenFOAM case. Raises InputError if a
    file is given twice, cannot be read, or has no such state.
    """
    files = [Path(path) for path in paths]
    places = [path.resolve() for path in files]
    twice = [path for path in files if places.count(path.resolve()) > 1]
    if twice:
        raise InputError(
            f"{twice[0]} is given twice, so it would count twice; remove one.", code="file.twice"
        )
    chosen = []
    for path, name in zip(files, short_names(files), strict=True):
        for member in _chosen(path, when):
            file = name if len(files) > 1 or not member.label else ""
            chosen.append(evolve(member, label=", ".join(filter(None, (file, member.label)))))
    return tuple(chosen)


def _chosen(path: Path, when: str | None) -> tuple[Member, ...]:
    if when is None and reader_of(path) is openfoam:
        # A case that was run to its steady state keeps earlier times, too.
        when = "latest"
    if when is None or when.strip() == "all":
        return members(path)
    if ":" not in when:
        return (member_at(path, when),)
    try:
        begin, end = (float(time) for time in when.split(":"))
    except ValueError:
        begin = end = math.nan
    if not begin <= end:
        raise InputError(
            f"The time is {when!r}, but a span FIRST:LAST goes from an earlier to a later time.",
            code="field.time_span",
            argument="time",
        )
    listed = members(path)
    found = tuple(m for m in listed if m.time is not None and begin <= m.time <= end)
    if not found:
        raise InputError(
            f"{path} has no time from {begin:g} to {end:g}; it has {_listed(listed)}.",
            code="field.no_state",
            argument="time",
        )
    return found


def _listed(found: tuple[Member, ...]) -> str:
    """Labels of states for a message; only the first and last ones if there are many."""
    labels = [m.label or "one state without a time" for m in found]
    if len(labels) > 12:
        labels = [*labels[:6], "...", *labels[-3:]]
    return "; ".join(labels)


def _plain(label: str) -> str:
    return "".join(label.split()).lower()


@contextmanager
def _file_errors(path: Path) -> Iterator[None]:
    """Raise InputError for errors of the file system or a decompressor."""
    try:
        yield
    except (OSError, EOFError) as error:
        name = getattr(error, "filename", None) or path
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"Cannot read {name}: {reason}.", code="file.unreadable") from error
