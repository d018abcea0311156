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
        raw = cls(places, rows, root, np.zeros(3), 1.0)
        whole = sum(weight.sum() for weight in (r**2 for _, r in raw))
        centre = np.asarray(sum((r**2) @ block for block, r in raw) / whole)
        scale = max(float(np.abs(block - centre).max()) for block, _ in raw)
        return cls(places, rows, root, centre, scale)

    def __len__(self) -> int:
        return len(self.places) if self.rows is None else len(self.rows)

    def __iter__(self) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Blocks of points and of the roots of their weights."""
        for block in blocks(len(self)):
            places = self.places[block if self.rows is None else self.rows[block]]
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
            found = np.linalg.qr(values if found is None else np.vstack((found, values)), mode="r")
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
    ends = np.array([[np.inf] * 3, [-np.inf] * 3])
    for block in blocks(len(rows)):
        part = places[rows[block]]
        ends = np.array(
            (np.minimum(ends[0], part.min(axis=0)), np.maximum(ends[1], part.max(axis=0)))
        )
    return np.asarray(ends[1] - ends[0])
