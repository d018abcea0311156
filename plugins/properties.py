"""Reading plugin properties: types and ranges are checked, with one sentence when they are wrong.

Mitsuba's loader accepts a ``<string>`` where a number belongs, so every plugin reads through here.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from iriftrace.errors import InputError


def number(props: Any, name: str, default: float | None = None) -> float:
    """Read a finite number from plugin properties in double precision."""
    if name not in props:
        if default is None:
            raise InputError(f'"{name}" is missing; give it as <float name="{name}" value="..."/>.')
        return float(default)
    value = props[name]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(
            f'"{name}" is {value!r}, not a number; write <float name="{name}" value="..."/>.'
        )
    if not math.isfinite(value):
        raise InputError(f'"{name}" is {value}; give a finite number.')
    return float(value)


def whole_number(props: Any, name: str, default: int) -> int:
    """Read a whole number of at least one, small enough for 32 bits."""
    value = number(props, name, default)
    if not (value.is_integer() and 1 <= value < 2**32):
        raise InputError(
            f'"{name}" is {value:g}; write <integer name="{name}" value="..."/> with a whole '
            "number of at least 1."
        )
    return int(value)


def flag(props: Any, name: str, default: bool) -> bool:
    """Read a boolean from plugin properties."""
    value = props.get(name, default)
    if not isinstance(value, bool):
        raise InputError(
            f'"{name}" is {value!r}, not a truth value; '
            f'write <boolean name="{name}" value="true"/> or "false".'
        )
    return value


def word(props: Any, name: str, default: str) -> str:
    """Read a text from plugin properties."""
    value = props.get(name, default)
    if not isinstance(value, str):
        raise InputError(f'"{name}" is {value!r}; write <string name="{name}" value="{default}"/>.')
    return value


def file_beside(props: Any, name: str, default: str) -> Path:
    """Read a file's name from plugin properties; it lies beside the scene's file."""
    import mitsuba as mi

    # Mitsuba's resolver knows the folder of the scene's file while that is read.
    return Path(str(mi.file_resolver().resolve(word(props, name, default))))


def choice(props: Any, name: str, allowed: tuple[str, ...]) -> str:
    """Read one of several words from plugin properties; the first is the default."""
    value = props.get(name, allowed[0])
    if value not in allowed:
        raise InputError(
            f'"{name}" is {value!r}; write <string name="{name}" value="..."/> with one of '
            f"{', '.join(allowed)}."
        )
    return str(value)
