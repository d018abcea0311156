"""Read one state of an Exodus file (``.e``, ``.ex2``, ``.exo``), as MOOSE and Sierra write it."""

from __future__ import annotations

from pathlib import Path

from iriftrace.core.files import sha256_of
from iriftrace.io.states import Contents, State, state_number, states_at
from iriftrace.io.vtk_check import read_times


def states(path: Path) -> list[State]:
    """Label and time of every state in a file, at least one."""
    return states_at(read_times(path, "read_exodus", None)[1])


def read(path: Path, member: int | None) -> Contents:
    """The blocks of one state; raises InputError if the file is damaged."""
    found = states(path)
    number = state_number(found, member, path)
    data, _ = read_times(path, "read_exodus", number)
    return Contents(data, sha256_of(path), found, origin=found[number][0])
