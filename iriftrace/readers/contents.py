"""What a reader takes from one state of a field file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from attrs import frozen

from iriftrace.errors import InputError

State = tuple[str, float | None]
"""Label and time of a state; "" and None where the file names none."""


@frozen(eq=False)
class Contents:
    """One state of a field file, as it was written.

    Attributes
    ----------
    data : pyvista.DataSet or pyvista.MultiBlock
        Cells and arrays, in the file's own units.
    sha256 : str
        Of the file; of an OpenFOAM case that of the list of the checksums of the files read, as
        ``sha256sum`` prints it.
    states : sequence of State
        All states of the file.
    member : int
        Which of them `data` is.
    length_unit : str or None
        Unit of the coordinates, where the file states it.
    units : mapping or None
        Unit of each array, "" where its header states none; None for files whose format has no
        place for units.
    origin : str
        What the file says of its own making, besides field data; "" where it says nothing.
    scattered : bool
        Whether the cells only fill the hull of scattered points, the part included.
    """

    data: Any
    sha256: str
    states: Sequence[State] = (("", None),)
    member: int = 0
    length_unit: str | None = None
    units: Mapping[str, str] | None = None
    origin: str = ""
    scattered: bool = False


def chosen(states: Sequence[State], member: int | None, path: Path) -> int:
    """Number of the state that is meant: the last one when none is named.

    Raises
    ------
    InputError
        The file has no such state.
    """
    if member is None:
        return len(states) - 1
    if not 0 <= member < len(states):
        raise InputError(
            f"{path} has {len(states)} states, numbered from 0, and no state {member}; choose one "
            "of them."
        )
    return member
