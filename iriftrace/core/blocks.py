"""Long arrays in blocks of rows, so that intermediate values need no memory for each row."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import AnyArray, FloatArray

BLOCK = 1 << 15
"""Rows of a block: a column is 256 kB, so that intermediate values stay in a processor's cache."""


def blocks(count: int, size: int | None = None) -> Iterator[slice]:
    """Consecutive slices of `count` rows, each of at most `size`, by default `BLOCK`."""
    step = size or BLOCK
    for start in range(0, count, step):
        yield slice(start, min(start + step, count))


def by_block(count: int, values: Callable[[slice], FloatArray]) -> FloatArray:
    """Values (count,) that a function computes for each block of rows."""
    found = np.empty(count)
    for rows in blocks(count):
        found[rows] = values(rows)
    return found


@frozen(eq=False)
class CloudBlocks:
    """Rows of a cloud, which a function gives block by block: places (m, 3) and columns (m,)."""

    count: int
    of: Callable[[slice], tuple[FloatArray, dict[str, AnyArray]]]

    @classmethod
    def of_arrays(cls, points: FloatArray, columns: Mapping[str, AnyArray]) -> CloudBlocks:
        """Points (n, 3) and columns (n,)."""
        return cls(
            len(points),
            lambda rows: (points[rows], {name: each[rows] for name, each in columns.items()}),
        )
