"""Options of one word, and what several commands have."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter, Token

from iriftrace.core import number_lists, units
from iriftrace.core.errors import InputError

_WORDS = {
    units.Length: "LENGTH",
    units.LengthWithUnit: "LENGTH",
    units.Wavelength: "LENGTH",
    units.FNumber: "f/NUMBER",
    units.Temperature: "TEMPERATURE",
    units.Pressure: "PRESSURE",
    units.Duration: "TIME",
    units.Angle: "ANGLE",
    units.Speed: "SPEED",
    units.Expansion: "EXPANSION",
    number_lists.Numbers: "NUMBER,...",
    number_lists.Pair: "ACROSS,DOWN",
    number_lists.Vector: "X,Y,Z",
    number_lists.Interval: "NEAR:FAR",
    number_lists.Lengths: "LENGTH,...",
    number_lists.Size: "WIDTH,HEIGHT",
}


def read_as_word(kind: type[Any], metavar: str) -> None:
    """Let options of a type be one word, called `metavar` in the help, that its class reads."""

    def convert(_type: object, tokens: Sequence[Token]) -> Any:
        try:
            return kind(tokens[0].value)
        except InputError as error:
            argument = (tokens[0].keyword or "").lstrip("-").replace("-", "_")
            raise InputError(str(error), code=error.code, argument=argument or None) from error

    def shown(value: object) -> str | None:
        return None if value is None else str(value)

    Parameter(
        converter=convert, metavar=metavar, n_tokens=1, accepts_keys=False, show_default=shown
    )(kind)


for _kind, _metavar in _WORDS.items():
    read_as_word(_kind, _metavar)


def _whole(_type: object, tokens: Sequence[Token]) -> int:
    """A whole number; the default conversion would truncate 2.5 to 2."""
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError(f'"{tokens[0].value}" is not a whole number.') from None


Output = Annotated[Path, Parameter(name=["-o", "--output"])]
Flag = Annotated[bool, Parameter(negative=())]
"""A switch without a ``--no-`` form."""
Whole = Annotated[int, Parameter(converter=_whole, metavar="INT", n_tokens=1, accepts_keys=False)]
LightOf = Annotated[
    units.Wavelength | None,
    Parameter(help='Wavelength that the file must have, "450 nm"; other light is refused.'),
]
