"""Small pieces of HTML by which notebooks show a result."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from html import escape

from iriftrace.core.errors import InputError, SetupError
from iriftrace.core.plain import JsonObject

_drawing: list[Callable[[object, JsonObject | None], str]] = []


def html_table(title: str, rows: Mapping[str, object]) -> str:
    """A table of names and values under a title."""
    cells = "".join(
        f'<tr><th style="text-align:left">{escape(name)}</th>'
        f'<td style="text-align:left">{escape(str(value))}</td></tr>'
        for name, value in rows.items()
    )
    return f"<table><caption>{escape(title)}</caption>{cells}</table>"


def draw_with(function: Callable[[object, JsonObject | None], str]) -> None:
    """Register the function by which `picture` draws, which lies above the values it draws."""
    _drawing[:] = [function]


def picture(value: object, numbers: JsonObject | None = None) -> str:
    """A frame with the picture in space of a value; "" where it cannot be drawn.

    `numbers` are JSON values that lie next to a cloud.
    """
    try:
        return "".join(function(value, numbers) for function in _drawing)
    except (InputError, SetupError):
        return ""
