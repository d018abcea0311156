"""Classes of the library as groups of options: what only a command adds to their fields."""

from __future__ import annotations

from collections.abc import Sequence
from types import UnionType
from typing import Annotated, Any, get_args

import attrs
from cyclopts import Group, Parameter, Token

from iriftrace.cli.options import Whole
from iriftrace.core import units
from iriftrace.core.errors import InputError

_WORDS = {
    units.Length: "LENGTH",
    units.LengthWithUnit: "LENGTH",
    units.Wavelength: "LENGTH",
    units.Temperature: "TEMPERATURE",
    units.Pressure: "PRESSURE",
    units.Duration: "TIME",
    units.Angle: "ANGLE",
    units.Speed: "SPEED",
    units.Expansion: "EXPANSION",
    units.Fraction: "FRACTION",
    units.Numbers: "NUMBER,...",
    units.Pair: "ACROSS,DOWN",
    units.Vector: "X,Y,Z",
    units.Interval: "NEAR:FAR",
    units.Lengths: "LENGTH,...",
    units.Size: "WIDTH,HEIGHT",
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


def group(
    options: type[Any],
    name: str | None = None,
    place: int = 1,
    *,
    show_default: bool = True,
    **fields: Parameter,
) -> Parameter:
    """The group of a class's fields in the help, under a name; more for single `fields`."""
    for one in attrs.fields(attrs.resolve_types(options)):
        # A converter takes text and numbers; the command reads the type that it gives.
        more = [Parameter(show_default=False)] if not show_default else []
        more += [fields[one.name]] if one.name in fields else []
        kind = _read(one.type, one.default)
        options.__init__.__annotations__[one.alias] = Annotated[kind, *more] if more else kind
    return Parameter(name="*", group=None if name is None else Group(name, sort_key=place))


def _read(kind: Any, default: object) -> Any:
    """Type of an option: text where text is read, and whole numbers and switches of commands."""
    if default is False:
        return Annotated[kind, Parameter(negative=())]
    if str in get_args(kind):
        # Python also gives arrays and numbers, or several texts.
        return list[str] | None if Sequence[str] in get_args(kind) else str | None
    if kind is int or (isinstance(kind, UnionType) and set(get_args(kind)) == {int, type(None)}):
        return Whole if kind is int else Whole | None
    return kind
