"""Names of result columns: quantity, unit and state, as COMSOL writes them."""

from __future__ import annotations

import re
from collections.abc import Iterable

from attrs import frozen

# In .vtu files COMSOL writes an underscore for every space: ``Temperature_@_t=0.5``.
_STATE = re.compile(r"(?P<name>.*?\S)[\s_]*@[\s_]*(?P<state>\S.*)")
_UNIT = re.compile(r"(?P<name>.*?\S)[\s_]+\((?P<unit>(?:[^()]|\([^()]*\))+)\)")
_TIME = re.compile(r"(?:^|[\s,])t\s*=\s*(?P<time>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)")


@frozen
class Column:
    """One column of results.

    Attributes
    ----------
    name : str
        Expression or description, without unit and state.
    unit : str or None
        As written, such as ``"K"``; None where the name states none.
    state : str
        Time or parameters, such as ``"t=0.5, P=100"``; "" where it is the same for all.
    """

    name: str
    unit: str | None
    state: str


def column_of(text: str) -> Column:
    """Take the name of a column apart: ``T (K) @ t=0.5`` or ``Temperature_(K)_@_t=0.5``."""
    name, state = text.strip(), ""
    if found := _STATE.fullmatch(name):
        name = found["name"]
        state = re.sub(r"([,:;])[\s_]*", r"\1 ", found["state"]).strip()
    unit = None
    if found := _UNIT.fullmatch(name):
        name, unit = found["name"], found["unit"].strip()
    return Column(name, unit, state)


def states_of(columns: Iterable[Column]) -> tuple[str, ...]:
    """The states of columns in the order in which they first appear; ("",) when there are none."""
    found = tuple(dict.fromkeys(column.state for column in columns if column.state))
    return found or ("",)


def time_in(state: str) -> float | None:
    """The time that a state names, or None."""
    found = _TIME.search(state)
    return float(found["time"]) if found else None
