"""Small pieces of HTML by which notebooks show a result."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from html import escape


def html_table(title: str, rows: Mapping[str, object]) -> str:
    """A table of names and values under a title."""
    cells = "".join(
        f'<tr><th style="text-align:left">{escape(name)}</th>'
        f'<td style="text-align:left">{escape(str(value))}</td></tr>'
        for name, value in rows.items()
    )
    return f"<table><caption>{escape(title)}</caption>{cells}</table>"


def picture(png: bytes) -> str:
    """An image of the bytes of a PNG; "" without them."""
    if not png:
        return ""
    return f'<img src="data:image/png;base64,{b64encode(png).decode("ascii")}" width="800">'
