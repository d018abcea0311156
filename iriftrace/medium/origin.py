"""Origin and facts of a field in the field data of its VTK file."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from iriftrace.core.plain import plain, structured
from iriftrace.medium.source import FieldFacts

if TYPE_CHECKING:
    import pyvista as pv

FIELD_ORIGIN = "field_origin"
"""Name of the string array in a file's field data: program, time, symmetry, in words."""

FIELD_FACTS = "field_facts"
"""Name of the string array that holds `FieldFacts` as JSON."""

WALL_HEAT = "wall_heat_flow_w"
"""Name of the number in a file's field data: heat from the part as computed by the solver, W."""


def origin_of(data: pv.DataSet | pv.MultiBlock | None) -> str:
    """Origin that a data set or its blocks state, joined if there are several; "" for none."""
    texts = (str(value).strip() for value in _stated(data, FIELD_ORIGIN))
    return "; ".join(dict.fromkeys(filter(None, texts)))


def facts_of(data: pv.DataSet | pv.MultiBlock | None) -> FieldFacts | None:
    """Facts that a data set or one of its blocks states; None if missing or damaged."""
    try:
        return next(
            (structured(json.loads(str(v)), FieldFacts) for v in _stated(data, FIELD_FACTS)), None
        )
    except ValueError:
        return None


def wall_heat_of(data: pv.DataSet | pv.MultiBlock | None) -> float | None:
    """Heat from the whole part, W, as computed by the solver; None if a file does not state it.

    The gradient at a file's points gives another value, because points hold averages of cells.
    """
    return next((float(value) for value in _stated(data, WALL_HEAT)), None)


def state_origin(grid: pv.UnstructuredGrid, origin: str, facts: FieldFacts) -> None:
    """Write origin and facts into the field data of a grid."""
    grid.field_data[FIELD_ORIGIN] = [one_line(origin)]
    grid.field_data[FIELD_FACTS] = [json.dumps(plain(facts))]


def one_line(text: str) -> str:
    """Text on one line in ASCII, the only encoding of VTK's string arrays."""
    return " ".join(text.split()).encode("ascii", "replace").decode("ascii")


def _stated(data: pv.DataSet | pv.MultiBlock | None, name: str) -> Iterator[str | float]:
    """Values in the field data of a data set, or of all blocks of several."""
    if data is None:
        return
    if name in data.field_data:
        yield from np.atleast_1d(data.field_data[name])
    # Figures need the text from this module but should not import VTK.
    from pyvista import MultiBlock

    if isinstance(data, MultiBlock):
        for block in data:
            yield from _stated(block, name)
