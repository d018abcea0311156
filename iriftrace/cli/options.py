"""Options that several commands share, and how their values are read."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Annotated, Any

from cyclopts import Parameter, Token

from iriftrace.errors import InputError

# No option of the program begins with a digit.
_NEGATIVE = re.compile(r"-\.?\d")


def with_negative_values(words: Sequence[str]) -> list[str]:
    """The command line with options joined to negative values: ``--ambient=-10 degC``.

    Cyclopts knows -10 for a number, but takes -10 degC and -50,-100,120 for options.
    """
    joined: list[str] = []
    for word in words:
        takes = bool(joined) and joined[-1].startswith("--") and "=" not in joined[-1]
        if takes and _NEGATIVE.match(word):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


def numbers(text: str, count: int, option: str, separator: str = ",") -> list[float]:
    """Numbers of a compound option; InputError when there are more or fewer, or one is NaN."""
    try:
        values = [float(piece) for piece in text.split(separator)]
    except ValueError:
        values = []
    if len(values) != count or any(math.isnan(value) for value in values):
        raise InputError(
            f'{option} is "{text}", but {count} numbers separated by "{separator}" are needed.'
        )
    return values


def finite_numbers(text: str, count: int, option: str) -> list[float]:
    """Numbers of a compound option, none of which may be infinite."""
    values = numbers(text, count, option)
    if any(math.isinf(value) for value in values):
        raise InputError(f'{option} is "{text}", but its numbers must be finite.')
    return values


def quantity(text: str, unit: str, option: str) -> float:
    """A number with or without a unit; the error names the option."""
    from iriftrace.units import parse_quantity

    try:
        value = parse_quantity(text, unit)
    except InputError as error:
        raise InputError(f"{option}: {error}") from error
    if unit == "kelvin" and value < 0.0:
        raise InputError(f"{option}: {text!r} is below absolute zero; check number and unit.")
    return value


def quantity_with_unit(text: str, unit: str, option: str, example: str) -> float:
    """A quantity that users think of in another unit than the library's, so a number needs one."""
    try:
        float(text)
    except ValueError:
        return quantity(text, unit, option)
    raise InputError(f'{option} is "{text}" without a unit; write it with one, like "{example}".')


def optional_quantity(text: str | None, unit: str, option: str) -> float | None:
    """The same of an option that may be left out."""
    return None if text is None else quantity(text, unit, option)


def _whole(_type: Any, tokens: Sequence[Token]) -> int:
    """A whole number; the default conversion would cut 2.5 to 2."""
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError(f'"{tokens[0].value}" is not a whole number.') from None


Whole = Annotated[int, Parameter(converter=_whole)]


Variables = Annotated[
    list[str] | None,
    Parameter(
        name=["-D", "--define"], negative=(), help="Scene parameter, name=value; repeatable."
    ),
]


def variables_of(definitions: list[str] | None) -> dict[str, str]:
    """Scene parameters by name."""
    values = {}
    for text in definitions or []:
        name, equals, value = text.partition("=")
        if not (name and equals and value):
            raise InputError(f'-D is "{text}"; write it as name=value, such as -D scale=0.25.')
        values[name] = value
    return values


Wavelength = Annotated[
    str | None,
    Parameter(help='Wavelength of the light, "450 nm"; by default the one the scene was made for.'),
]


def scene_variables(definitions: list[str] | None, wavelength: str | None) -> dict[str, str]:
    """Scene parameters by name, the wavelength (nm) among them if it is given."""
    values = variables_of(definitions)
    if wavelength is not None:
        values["wavelength"] = f"{quantity(wavelength, 'nm', '--wavelength')!r}"
    return values


Statuses = Annotated[
    list[Whole] | None,
    Parameter(
        negative=(),
        help="Further status codes whose rays the metrics use, such as 5; repeatable.",
    ),
]


def statuses(include: list[int] | None) -> tuple[int, ...]:
    """Status codes of the rays that the metrics use."""
    from iriftrace.status import Status

    known = [status.value for status in Status]
    wrong = [code for code in include or () if code not in known]
    if wrong:
        meanings = ", ".join(f"{status.value} {status.key}" for status in Status)
        raise InputError(f"--include {wrong[0]} is no status of a ray; the codes are {meanings}.")
    return (0, *(include or ()))
