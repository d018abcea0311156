"""Several numbers, as written in files and on the command line with separators."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Self

from iriftrace.core.errors import InputError
from iriftrace.core.units import Length


class Numbers(tuple[float, ...]):
    """Finite numbers; in a text separated by commas."""

    def __new__(cls, value: str | Iterable[float]) -> Self:
        return super().__new__(cls, _numbers(value))

    def __str__(self) -> str:
        return ",".join(f"{number:g}" for number in self)


class Pair(tuple[float, float]):
    """Two finite numbers, across and down; in a text "2448,2048"."""

    def __new__(cls, value: str | Iterable[float]) -> Self:
        return super().__new__(cls, _numbers(value, 2))

    def __str__(self) -> str:
        return ",".join(f"{number:g}" for number in self)


class Vector(tuple[float, float, float]):
    """Three finite numbers, x, y and z; in a text "150,-100,40"."""

    def __new__(cls, value: str | Iterable[float]) -> Self:
        return super().__new__(cls, _numbers(value, 3))

    def __str__(self) -> str:
        return ",".join(f"{number:g}" for number in self)


class Interval(tuple[float, float]):
    """Two numbers, the ends of an interval, which may be infinite; in a text "50:250"."""

    def __new__(cls, value: str | Iterable[float]) -> Self:
        return super().__new__(cls, _numbers(value, 2, ":", finite=False))

    def __str__(self) -> str:
        return ":".join(f"{number:g}" for number in self)


class Lengths(tuple[Length, ...]):
    """Lengths, mm, none of them twice; in a text "80 mm,100 mm"."""

    def __new__(cls, value: str | Iterable[str | float]) -> Self:
        lengths = super().__new__(cls, map(Length, _pieces(value, ",")))
        if len(set(lengths)) < len(lengths):
            raise InputError(
                f'"{value}" has a length twice, so that it would count twice; give each once.',
                code="units.twice",
            )
        return lengths

    def __str__(self) -> str:
        return ",".join(map(str, self))


class Size(tuple[Length, Length]):
    """Width and height, mm; in a text "6.7 mm,5.6 mm"."""

    def __new__(cls, value: str | Iterable[str | float]) -> Self:
        size = super().__new__(cls, map(Length, _pieces(value, ",")))
        if len(size) != 2:
            raise InputError(
                f'"{value}" is not width and height; write it like "6.7 mm,5.6 mm".',
                code="units.no_numbers",
            )
        return size

    def __str__(self) -> str:
        return ",".join(map(str, self))


def _pieces(value: str | Iterable[str | float], separator: str) -> Iterable[str | float]:
    return value.split(separator) if isinstance(value, str) else value


def _numbers(
    value: str | Iterable[str | float],
    count: int | None = None,
    separator: str = ",",
    *,
    finite: bool = True,
) -> tuple[float, ...]:
    """Numbers, `count` of them if given; InputError for others, and for one that is NaN."""
    try:
        numbers = tuple(map(float, _pieces(value, separator)))
    except (TypeError, ValueError):
        numbers = (math.nan,)
    if len(numbers) != (count or len(numbers)) or any(map(math.isnan, numbers)):
        raise InputError(
            f'"{value}" is not {"" if count is None else f"{count} "}numbers separated by '
            f'"{separator}".',
            code="units.no_numbers",
        )
    if finite and any(map(math.isinf, numbers)):
        raise InputError(f'"{value}" has a number that is not finite.', code="units.not_finite")
    return numbers
