"""The states that one field file holds: time steps, or values of a parameter."""

from __future__ import annotations

import math
from pathlib import Path

from attrs import frozen

from iriftrace.errors import InputError
from iriftrace.readers import comsol_text, openfoam_case, vtk_file
from iriftrace.readers.kinds import kind_of

_STATES = {
    "vtk": vtk_file.states,
    "openfoam": openfoam_case.states,
    "comsol": comsol_text.states,
}

# Solvers write their times with six digits and more.
_SAME_TIME = 1e-5


@frozen
class Member:
    """One state of a field file.

    Attributes
    ----------
    label : str
        What tells it from the others, such as ``"t = 2.5"`` or ``"t=2, P=100"``; "" where the file
        has one state and no name for it.
    time : float or None
        In the file's unit, s as a rule; None where the file does not say.
    index : int
        Its place in the file, from 0; `iriftrace.field.read_field` takes it as ``member``.
    """

    label: str
    time: float | None
    index: int


def members(path: str | Path) -> tuple[Member, ...]:
    """States of a field file in their order, at least one.

    Parameters
    ----------
    path : str or Path
        Any file or folder that `iriftrace.field.read_field` reads.

    Raises
    ------
    InputError
        The file is missing, of another type, or damaged.
    """
    path = Path(path)
    kind = kind_of(path)
    states = _STATES[kind](path)
    return tuple(Member(label, time, index) for index, (label, time) in enumerate(states))


def member_at(path: str | Path, when: str) -> Member:
    """The state of a field file that a user names.

    Parameters
    ----------
    path : str or Path
    when : str
        ``"latest"``, ``"first"``, a time such as ``"2.5"``, or a label.

    Raises
    ------
    InputError
        The file has no such state; the message lists those it has.
    """
    found = members(path)
    word = when.strip()
    if word in ("latest", "first"):
        return found[-1 if word == "latest" else 0]
    by_label = [m for m in found if _plain(m.label) == _plain(word)]
    chosen = by_label or [m for m in found if _is_time(m, word)]
    if len(chosen) != 1:
        if not found[0].label:
            raise InputError(
                f"{path} has no state {word!r}: it has {listed(found)}; leave --time out."
            )
        what = "no state" if not chosen else "several states"
        raise InputError(
            f"{path} has {what} {word!r}; give latest, first or one of {listed(found)}."
        )
    return chosen[0]


def listed(found: tuple[Member, ...]) -> str:
    """Labels of states for a message, the first and last ones of many."""
    labels = [m.label or "one state without a time" for m in found]
    if len(labels) > 12:
        labels = [*labels[:6], "...", *labels[-3:]]
    return "; ".join(labels)


def _plain(label: str) -> str:
    return "".join(label.split()).lower()


def _is_time(member: Member, word: str) -> bool:
    try:
        time = float(word)
    except ValueError:
        return False
    return member.time is not None and math.isclose(
        member.time, time, rel_tol=_SAME_TIME, abs_tol=1e-12
    )
