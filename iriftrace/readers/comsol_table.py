"""Points, cells and results of a text export, as numbers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.errors import InputError
from iriftrace.field_cells import HEXAHEDRON
from iriftrace.readers.states import Column

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@frozen(eq=False)
class Table:
    """A text export in numbers.

    Attributes
    ----------
    points : (n, 3) array
    columns : sequence of Column
        Of the results.
    values : (n, columns) array
    cells : tuple of int and (k, corners) array, or None
        Kind of the cells (`field_cells`), and their points; None for scattered points.
    """

    points: FloatArray
    columns: Sequence[Column]
    values: FloatArray
    cells: tuple[int, IntArray] | None = None


def require_count(what: str, found: int, stated: int | None, path: Path) -> None:
    """Refuse a file that has not what its header counts.

    Raises
    ------
    InputError
    """
    if stated is not None and found != stated:
        raise InputError(
            f"The header of {path} counts {stated} {what}, but the file has {found}: it was cut "
            "short or edited; export it again."
        )


def box_cells(counts: tuple[int, int, int]) -> tuple[int, IntArray]:
    """Hexahedra between the points of a grid that are numbered with x running fastest."""
    if min(counts) < 2:
        return HEXAHEDRON, np.zeros((0, 8), dtype=np.int64)
    nx, ny, _ = counts
    k, j, i = np.meshgrid(*(np.arange(n - 1) for n in counts[::-1]), indexing="ij")
    first = (i + nx * (j + ny * k)).ravel()
    corner = np.array((0, 1, 1 + nx, nx))
    return HEXAHEDRON, first[:, None] + np.concatenate((corner, corner + nx * ny))
