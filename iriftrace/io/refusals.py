"""Refusals of files that many readers have in common."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from iriftrace.core.errors import InputError
from iriftrace.core.files import check_readable
from iriftrace.core.units import length_factor


def check_exists(path: Path, remedy: str = "check the path") -> None:
    """Refuse a file that does not exist or may not be read."""
    if not path.is_file():
        raise InputError(f"There is no file {path}; {remedy}.", code="file.missing")
    check_readable(path)


def check_ending(path: Path, endings: Sequence[str], kind: str) -> None:
    """Refuse a file, called `kind` in the message, without one of the endings."""
    if path.suffix.lower() not in endings:
        raise InputError(
            f"{path} is not {kind} of a known format; give one that ends in {', '.join(endings)}.",
            code="file.ending",
        )


def check_schema(path: str | Path, stated: object, schema: str, remedy: str) -> None:
    """Refuse a file of another schema than that of this version."""
    if stated != schema:
        raise InputError(
            f"{path} has schema {stated!r} instead of {schema!r}, so this version of iriftrace did "
            f"not write it; {remedy}.",
            code="file.schema",
        )


def damaged(
    path: str | Path,
    reason: object,
    remedy: str = "export it again",
    *,
    argument: str | None = None,
) -> InputError:
    """The error for a file that is cut short, damaged or of another kind than its name says."""
    return InputError(
        f"{path} cannot be read ({reason}); {remedy}.", code="file.damaged", argument=argument
    )


def not_read(
    path: str | Path, found: str, remedy: str, *, argument: str | None = None
) -> InputError:
    """The error for a dialect of a format that is not read: `path` has `found`."""
    return InputError(
        f"{path} has {found}, so it is not read; {remedy}.", code="file.dialect", argument=argument
    )


def one_unit(path: Path, units: Iterable[str]) -> str:
    """The one unit that a file states, or ""; an InputError where it states several."""
    stated = sorted(set(units) - {""})
    if len(stated) > 1:
        raise InputError(
            f"{path} states {' and '.join(stated)} for one quantity, so its values are ambiguous; "
            "write all in one unit.",
            code="units.two",
        )
    return "".join(stated)


def chosen_unit(
    path: Path, stated: str | None, given: str | None, argument: str, default: str = "mm"
) -> str:
    """Length unit of a file, as given or stated; an InputError if these differ."""
    if given and stated and length_factor(given) != length_factor(stated):
        factor = length_factor(given) / length_factor(stated)
        raise InputError(
            f"{path} states its coordinates in {stated}, but they were to be read in {given}; "
            f"leave out the unit, or scale them by {factor:.6g} if they are in {given} after all.",
            code="units.contradict",
            argument=argument,
        )
    return given or stated or default
