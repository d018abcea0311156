"""Convert iriftrace's classes to plain values of JSON files and headers, and back, with cattrs."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar

from attrs import has

if TYPE_CHECKING:
    from cattrs import Converter

T = TypeVar("T")

JsonObject = dict[str, Any]
"""An object of a JSON file or header: plain values by name, which its readers check."""

_KINDS: dict[type, tuple[str, tuple[type, ...]]] = {
    bool: ("truth value", (bool,)),
    int: ("whole number", (int,)),
    float: ("number", (int, float)),
    str: ("text", (str,)),
}


class TwiceError(Exception):
    """A name that is there twice."""


def once(pairs: Iterable[tuple[str, object]]) -> dict[str, object]:
    """Names and values as a mapping; `TwiceError` for a name that is there twice.

    Parsers of YAML, JSON and XML would keep its last value.
    """
    values: dict[str, object] = {}
    for name, value in pairs:
        if name in values:
            raise TwiceError(name)
        values[name] = value
    return values


def plain(value: object) -> Any:
    """A value of iriftrace's classes as dictionaries, lists, numbers, texts and None."""
    return _converter().unstructure(value)


def structured(values: object, kind: type[T]) -> T:
    """The value of a class from plain values; raises ValueError with the fault.

    Additional keys of a dictionary are ignored.
    """
    from cattrs import BaseValidationError, transform_error

    try:
        return _converter().structure(values, kind)
    except BaseValidationError as error:
        faults = transform_error(error, format_exception=_fault)
        raise ValueError("; ".join(faults)) from error
    except (TypeError, AttributeError, LookupError) as error:
        raise ValueError(f"{error}") from error


@cache
def _converter() -> Converter:
    # Imported when needed: it takes as long as all of the package's own modules.
    from cattrs import Converter

    converter = Converter(use_alias=True, unstruct_collection_overrides={tuple: list})
    for kind, (name, taken) in _KINDS.items():
        converter.register_structure_hook(kind, _strict(kind, name, taken))
    # Quantities are numbers with a unit, which files state by other means.
    converter.register_unstructure_hook_func(
        lambda kind: float in getattr(kind, "__mro__", ()), float
    )
    converter.register_structure_hook_factory(has, _from_dictionary)
    return converter


def _from_dictionary(kind: type[T], converter: Converter) -> Callable[[object, object], T]:
    """cattrs would take a list for a class whose attributes all have defaults."""
    from cattrs.gen import make_dict_structure_fn

    made = make_dict_structure_fn(kind, converter, _cattrs_use_alias=True)

    def convert(value: object, _: object) -> T:
        if not isinstance(value, dict):
            raise ValueError(f"{value!r} is not an object")
        return made(value, kind)

    return convert


def _fault(error: BaseException, kind: type | None) -> str:
    from cattrs.v import format_exception

    return f"{error}" if isinstance(error, ValueError) else format_exception(error, kind)


def _strict(kind: type, name: str, taken: tuple[type, ...]) -> Callable[[object, object], object]:
    """cattrs would convert texts to numbers, anything to texts, and accept NaN (not JSON)."""

    def convert(value: object, _: object) -> object:
        if type(value) not in taken or value != value:
            raise ValueError(f"{value!r} is not {'an' if name[0] in 'aeiou' else 'a'} {name}")
        return kind(value)

    return convert
