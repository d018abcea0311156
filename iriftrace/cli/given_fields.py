"""Which fields the user gives: states of files, one by one or as an ensemble."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from attrs import frozen

from iriftrace.cli.checks import check_field
from iriftrace.cli.field_options import FieldOptions
from iriftrace.cli.options import numbers
from iriftrace.errors import InputError

if TYPE_CHECKING:
    from iriftrace.readers.members import Member

EVERY_TIME = "all"
"""With this --time every state of a file is a member."""


@frozen
class GivenField:
    """One state of one file.

    Attributes
    ----------
    path : Path
    member : int or None
        Number of the state; None for iso-surfaces, which are read as a whole.
    label : str
    time : float or None
    chosen : bool
        Whether --time named it; else whoever reads the file says which of several states it is.
    """

    path: Path
    member: int | None
    label: str
    time: float | None
    chosen: bool = False

    @property
    def member_asked_for(self) -> int | None:
        """The number, if the user asked for this state."""
        return self.member if self.chosen else None


def members_given(paths: Sequence[Path], field_options: FieldOptions) -> list[GivenField]:
    """Every state of every file, or those that --time chooses; of OpenFOAM cases the latest.

    Raises
    ------
    InputError
        A file is given twice, does not exist, or iso-surfaces are to make an ensemble.
    """
    files = [path.resolve() for path in paths]
    twice = [path for path in paths if files.count(path.resolve()) > 1]
    if twice:
        raise InputError(f"{twice[0]} is given twice, so it would count twice; remove one.")
    if field_options.isosurfaces:
        if len(paths) > 1:
            raise InputError(
                "An ensemble is made of volume fields, from which the shells of all members are "
                "cut in the same way; leave out --isosurfaces or --member."
            )
        return [GivenField(paths[0], None, paths[0].name, None)]
    check_field(*paths)
    given = []
    for path in paths:
        for state in _states(path, field_options.time):
            name = path.name if len(paths) > 1 or not state.label else ""
            label = ", ".join(text for text in (name, state.label) if text)
            chosen = field_options.time is not None
            given.append(GivenField(path, state.index, label, state.time, chosen))
    return given


def _states(path: Path, when: str | None) -> tuple[Member, ...]:
    """The states of a file that --time means."""
    from iriftrace.readers.kinds import kind_of
    from iriftrace.readers.members import listed, member_at, members

    if when is None and kind_of(path) == "openfoam":
        # A case that was run to its steady state keeps the times before it, too.
        when = "latest"
    if when is None or when.strip() == EVERY_TIME:
        return members(path)
    if ":" not in when:
        return (member_at(path, when),)
    begin, end = _span(when)
    found = tuple(m for m in members(path) if m.time is not None and begin <= m.time <= end)
    if not found:
        raise InputError(
            f"{path} has no time from {begin:g} to {end:g}; it has {listed(members(path))}."
        )
    return found


def _span(when: str) -> list[float]:
    """First and last time of --time FIRST:LAST."""
    span = numbers(when, 2, "--time", ":")
    if not span[0] <= span[1]:
        raise InputError(f'--time is "{when}", but a span goes from an earlier to a later time.')
    return span
