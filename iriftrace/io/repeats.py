"""Tables of repeated measurements: a column for each feature, a row for each repeat."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.units import length_factor
from iriftrace.io.refusals import check_exists
from iriftrace.io.table import read_table


def read_repeats(path: str | Path) -> dict[str, FloatArray]:
    """Values, mm, of each feature by its name, without repeats that have none.

    A unit after the name, ``bore [um]``, is obeyed. Raises InputError for a file that is not such a
    table, or has a feature twice.
    """
    check_exists(Path(path))
    table = read_table(Path(path))
    names = [column.name for column in table.columns]
    if len(set(names)) < len(names):
        raise InputError(
            f"{path} has a feature twice: {', '.join(names)}; name each column once.",
            code="repeats.twice",
        )
    values = table.numbers(range(table.width))
    factors = [length_factor(column.unit or "mm") for column in table.columns]
    return {
        name: factor * column[np.isfinite(column)]
        for name, factor, column in zip(names, factors, values.T, strict=True)
    }
