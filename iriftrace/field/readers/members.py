"""The states that one field file holds: time steps, or values of a parameter."""

from __future__ import annotations

import math
from pathlib import Path

from attrs import frozen

from iriftrace.core.errors import InputError
from iriftrace.field.readers import (
    comsol as comsol_text,
)
from iriftrace.field.readers import (
    openfoam as openfoam_case,
)
from iriftrace.field.readers import (
    vtk_files as vtk_file,
)

# MERGE readers.kinds: Which program wrote a field file, told by its name and what lies beside it.

VTK = (".vtu", ".pvtu", ".vtk", ".vti", ".vtr", ".vts", ".pvd", ".vtm")
OPENFOAM = (".foam", ".openfoam")
COMSOL_TEXT = (".txt", ".csv", ".dat")
COMPRESSED = (".gz", ".zip", ".bz2", ".xz", ".7z")
SUFFIXES = (*VTK, *OPENFOAM, *COMSOL_TEXT)
"""Suffixes of files that can hold a field; an OpenFOAM case may also be named by its folder."""


def kind_of(path: Path) -> str:
    """``"vtk"``, ``"openfoam"`` or ``"comsol"``.

    Raises
    ------
    InputError
        The file does not exist, is of another type, or is a folder that is no OpenFOAM case.
    """
    if path.is_dir():
        if is_case(path):
            return "openfoam"
        raise InputError(
            f"The folder {path} is no OpenFOAM case (it has neither system/controlDict nor "
            "constant/polyMesh); name the case's folder or the field's file."
        )
    if not path.is_file():
        raise InputError(f"The field file {path} does not exist; check the path.")
    suffix = path.suffix.lower()
    if suffix in OPENFOAM or path.name == "controlDict":
        return "openfoam"
    if suffix in COMSOL_TEXT:
        return "comsol"
    if suffix in VTK:
        return "vtk"
    if suffix in COMPRESSED:
        raise InputError(f"The field file {path} is compressed; unpack it first.")
    raise InputError(
        f"{path} is not a field file that can be read here; export it as one of "
        f"{', '.join(SUFFIXES)}, or name the folder of an OpenFOAM case."
    )


def is_case(folder: Path) -> bool:
    """Whether a folder looks like an OpenFOAM case, reconstructed or decomposed."""
    return any(
        (folder / name).exists()
        for name in ("system/controlDict", "constant/polyMesh", "processor0/constant/polyMesh")
    )


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
        Its place in the file, from 0; `iriftrace.field.read.read_field` takes it as ``member``.
    """

    label: str
    time: float | None
    index: int


def members(path: str | Path) -> tuple[Member, ...]:
    """States of a field file in their order, at least one.

    Parameters
    ----------
    path : str or Path
        Any file or folder that `iriftrace.field.read.read_field` reads.

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
