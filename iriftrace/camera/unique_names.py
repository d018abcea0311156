"""Named values of a file, of which parsers of YAML, JSON and XML would keep the last of a name."""

from __future__ import annotations

from collections.abc import Iterable


class TwiceError(Exception):
    """A name that is there twice."""


def once(pairs: Iterable[tuple[str, object]]) -> dict[str, object]:
    """Names and values as a mapping; `TwiceError` for a name that is there twice."""
    values: dict[str, object] = {}
    for name, value in pairs:
        if name in values:
            raise TwiceError(name)
        values[name] = value
    return values
