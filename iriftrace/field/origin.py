"""Origin of a field as its file states it in VTK field data: program, time, symmetry."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np

FIELD_ORIGIN = "field_origin"
"""Name of the string array in a file's field data."""

WALL_HEAT = "wall_heat_flow_w"
"""Name of the number in a file's field data that the solver counted as heat from the part, W."""

SYNTHETIC = "synthetic"
"""With this word the origin of a field begins that a model made up."""

_STEADY = re.compile(r"(?<!not )(?<![\w-])steady\b", re.IGNORECASE)
_MIRRORED = re.compile(r"mirrored at [xyz] = \S+ mm(?: and [xyz] = \S+ mm)*")


def origin_of(data: Any) -> str:
    """Origin that a data set or its blocks state, joined where there are several; "" for none."""
    texts = (str(value).strip() for value in _stated(data, FIELD_ORIGIN))
    return "; ".join(dict.fromkeys(filter(None, texts)))


def wall_heat_of(data: Any) -> float | None:
    """Heat from the whole part, W, as the solver counted it; None where a file does not state it.

    The gradient at the points of a file gives another one, since they carry averages of cells.
    """
    return next((float(value) for value in _stated(data, WALL_HEAT)), None)


def state_origin(grid: Any, origin: str) -> None:
    """Write the origin into the field data of a grid; none if it is ""."""
    if origin:
        grid.field_data[FIELD_ORIGIN] = [one_line(origin)]


def one_line(text: str) -> str:
    """Text on one line in ASCII, which is all that VTK's string arrays know."""
    return " ".join(text.split()).encode("ascii", "replace").decode("ascii")


def is_steady(origin: str | None) -> bool:
    """True for air that does not change in time, by the field's own statement.

    The model of synthetic fields is steady, and of a simulation's the origin says so.
    """
    return synthetic_mark(origin) is not None or _STEADY.search(origin or "") is not None


def stated_time(origin: str | None) -> str:
    """What a field says it is in time: "steady", "mean", "snapshot" or "not stated"."""
    if is_steady(origin):
        return "steady"
    words = {"averaged over": "mean", "snapshot": "snapshot"}
    return next((time for word, time in words.items() if word in (origin or "")), "not stated")


def stated_symmetry(origin: str | None) -> str:
    """Symmetry that a field says it has, "mirrored at y = 0 mm", else "not stated"."""
    found = _MIRRORED.search(origin or "")
    return found[0] if found else "not stated"


def synthetic_mark(origin: str | None) -> str | None:
    """Words for a picture of a result that rests on no simulation; None for other origins."""
    return "SYNTHETIC FIELD" if (origin or "").lower().startswith(SYNTHETIC) else None


def _stated(data: Any, name: str) -> Iterator[Any]:
    """Values in the field data of a data set, or of all blocks of several."""
    if data is None:
        return
    if name in data.field_data:
        yield from np.atleast_1d(data.field_data[name])
    # Told by what it has: pictures need this module's words, and must not wait for VTK.
    if hasattr(data, "n_blocks"):
        for block in data:
            yield from _stated(block, name)
