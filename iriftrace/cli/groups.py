"""Classes of the library as groups of options: what only a command adds to their fields."""

from __future__ import annotations

from collections.abc import Sequence
from types import UnionType
from typing import Annotated, Any, get_args

import attrs
from cyclopts import Group, Parameter

from iriftrace.cli.options import Whole


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
    if name is None:
        return Parameter(name="*")
    return Parameter(name="*", group=Group(name, sort_key=place))


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
