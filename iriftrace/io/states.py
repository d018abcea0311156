"""One state of a field file as returned by readers, and the states named by columns.

COMSOL writes times and parameter values into the names of its result columns.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from attrs import frozen

from iriftrace.core.errors import InputError
from iriftrace.medium.source import FieldFacts

# In .vtu files COMSOL replaces every space by an underscore: ``Temperature_@_t=0.5``.
_STATE = re.compile(r"(?P<name>.*?\S)[\s_]*@[\s_]*(?P<state>\S.*)")
_UNIT = re.compile(r"(?P<name>.*?\S)[\s_]+\((?P<unit>(?:[^()]|\([^()]*\))+)\)")
# As in files of CFD-Post and others.
_UNIT_IN_SQUARES = re.compile(r"(?P<name>.*?\S)[\s_]*\[(?P<unit>[^\[\]]+)\]")
_TIME = re.compile(r"(?:^|[\s,])t\s*=\s*(?P<time>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)")

State = tuple[str, float | None]
"""Label and time of a state; "" and None if the file names none."""


@frozen(eq=False)
class Contents:
    """One state of a field file, as stored."""

    # A pyvista.DataSet or, before the volume cells are joined, a pyvista.MultiBlock; in the file's
    # own units.
    data: Any
    # SHA-256 of the file; for an OpenFOAM case of the list of checksums of the files read, in the
    # format of ``sha256sum``.
    sha256: str
    states: Sequence[State] = (("", None),)  # all states of the file
    length_unit: str | None = None  # of the coordinates, if the file states it
    # Unit of each array, "" if the header states none; None for formats that do not store units.
    units: Mapping[str, str] | None = None
    origin: str = ""  # what the file states about its origin, besides field data
    wall_heat_w: float | None = None  # heat from the whole part, W, if field data state it
    facts: FieldFacts | None = None  # if field data state them
    scattered: bool = False  # the cells fill the hull of scattered points, including the part


def state_number(states: Sequence[State], member: int | None, path: Path) -> int:
    """Number of the chosen state, which has to exist; the last one if none is chosen."""
    if member is None:
        return len(states) - 1
    if not 0 <= member < len(states):
        raise InputError(
            f"{path} has {len(states)} states, numbered from 0, and no state {member}; choose one "
            "of them.",
            code="field.no_state",
            argument="time",
        )
    return member


@frozen
class Column:
    """One column of results."""

    name: str  # expression or description, without unit and state
    unit: str | None  # as written, such as "K"; None if the name states none
    state: str  # time or parameters, such as "t=0.5, P=100"; "" for a column of all states


def column_of(text: str) -> Column:
    """Split the name of a column: ``T (K) @ t=0.5``, ``Temperature_(K)_@_t=0.5`` or ``T [K]``."""
    name, state = text.strip(), ""
    if found := _STATE.fullmatch(name):
        name = found["name"]
        state = re.sub(r"([,:;])[\s_]*", r"\1 ", found["state"]).strip()
    unit = None
    if found := _UNIT.fullmatch(name) or _UNIT_IN_SQUARES.fullmatch(name):
        name, unit = found["name"], found["unit"].strip()
    return Column(name, unit, state)


def states_of(columns: Iterable[Column]) -> list[State]:
    """States of columns, or one without a name.

    By their times if each has another one, else in the order in which they first appear.
    """
    labels = dict.fromkeys(column.state for column in columns if column.state)
    states = [(label, time_in(label)) for label in labels or ("",)]
    times = [time for _, time in states if time is not None]
    if len(set(times)) == len(states):
        states.sort(key=lambda state: state[1] or 0.0)
    return states


def states_at(times: Iterable[str]) -> list[State]:
    """States at times as written in a file, or one without a name."""
    return [(f"t = {time}", float(time)) for time in times] or [("", None)]


def time_in(state: str) -> float | None:
    """The time in the name of a state, or None."""
    found = _TIME.search(state)
    return float(found["time"]) if found else None
