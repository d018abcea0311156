"""Points of a feature in blocks, about their centre, and triangular factors of what they give."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from attrs import evolve, frozen

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.blocks import blocks

OfPoints = Callable[[FloatArray], FloatArray]
"""Function of points (n, 3)."""


@frozen(eq=False)
class Points:
    """Points about their centre and of size 1, so that all parameters weigh alike, in blocks."""

    places: FloatArray  # (n, 3), mm
    rows: IntArray | None  # (m,) numbers of those that are fitted; None for all
    root: FloatArray | None  # (m,) roots of their weights; None for equal ones
    centre: FloatArray  # (3,), mm
    scale: float  # mm

    @classmethod
    def of(
        cls, places: FloatArray, rows: IntArray | None = None, root: FloatArray | None = None
    ) -> Points:
        """Points with their centre and size."""
        whole, moment, ends = 0.0, np.zeros(3), []
        for block, part in _parts(places, rows):
            weights = np.ones(len(part)) if root is None else root[block] ** 2
            whole += weights.sum()
            moment += weights @ part
            ends += [part.min(axis=0), part.max(axis=0)]
        centre = moment / whole
        return cls(places, rows, root, centre, float(np.abs(ends - centre).max()))

    def __len__(self) -> int:
        return len(self.places) if self.rows is None else len(self.rows)

    def __iter__(self) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Blocks of points and of the roots of their weights."""
        for block, places in _parts(self.places, self.rows):
            root = np.ones(len(places)) if self.root is None else self.root[block]
            yield (places - self.centre) / self.scale, root

    def every(self, step: int) -> Points:
        """One in so many of the points, about the same centre."""
        rows = np.arange(len(self.places))[::step] if self.rows is None else self.rows[::step]
        return evolve(self, rows=rows, root=None if self.root is None else self.root[::step])

    def factor(self, columns: OfPoints) -> FloatArray:
        """Triangular factor of weighted columns, by the factor of each block and those before.

        Its columns have the lengths of the original ones and the angles between them.
        """
        found: FloatArray | None = None
        for points, root in self:
            values = columns(points)
            values = values * np.resize(root, len(values))[:, None]
            above = values if found is None else np.vstack((found, values))
            found = np.asarray(np.linalg.qr(above, mode="r"))
        assert found is not None
        return found

    def each(self, values: OfPoints) -> FloatArray:
        """Values (m,) of the points."""
        return np.concatenate([values(points) for points, _ in self])

    @property
    def principal(self) -> tuple[FloatArray, FloatArray]:
        """Roots of the sums of squares along the principal axes, largest first, and these rows."""
        _, extents, axes = np.linalg.svd(self.factor(lambda points: points))
        return extents, axes


def extent(places: FloatArray, rows: IntArray) -> FloatArray:
    """Extents (3,), mm, along the axes of those points (n, 3) that have the numbers `rows`."""
    ends = [limit(part, axis=0) for _, part in _parts(places, rows) for limit in (np.min, np.max)]
    return np.asarray(np.ptp(ends, axis=0))


def _parts(places: FloatArray, rows: IntArray | None) -> Iterator[tuple[slice, FloatArray]]:
    """Blocks of the rows (m,), by default all, and the places (n, 3) that have their numbers."""
    for block in blocks(len(places) if rows is None else len(rows)):
        yield block, places[block if rows is None else rows[block]]
