"""Outliers of a feature's points, removed by a gate of robust standard deviations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.core.blocks import by_block
from iriftrace.core.mesh.query import Surface
from iriftrace.measuring.features.feature import Feature
from iriftrace.measuring.features.fit import FEWEST, FLAT, SAMPLE, fit_feature
from iriftrace.measuring.features.points import extent

NORMAL_MAD = 1.4826
"""Standard deviation of normal noise over the median of its sizes."""

ROUNDS = 20
"""Largest number of iterations of the robust start and of the gate, which take three to eight."""

SETTLED = 0.05
"""Fraction of the noise: a robust fit that moves by less is accurate enough to judge outliers."""


def inliers(
    points: FloatArray,
    kind: str,
    gate: float | None,
    nearby: Sequence[Surface] = (),
    rows: IntArray | None = None,
) -> BoolArray:
    """Mask (n,) of the points (n, 3), mm, that are not outliers of a feature; all without a gate.

    With the numbers `rows` (m,) of some points that of these, (m,).

    They lie within `gate` robust standard deviations, 1.4826 times the median distance, of the
    least-squares fit to themselves: starting from a robust fit, points are removed and the rest is
    fitted again until the set does not change. Points as near to the surfaces `nearby` are removed,
    too, unless half of all are: which of them belong to the feature depends on their noise.
    """
    chosen = np.arange(len(points)) if rows is None else rows
    if gate is None or len(chosen) < 2 * FEWEST[kind]:
        return np.ones(len(chosen), dtype=bool)
    # For points without noise, the rounding of single precision is not an outlier.
    least = limit = FLAT * float(extent(points, chosen).max())
    found = _robust_fit(points[chosen[:: max(1, len(chosen) // SAMPLE)]], kind, least)
    kept = np.zeros(len(chosen), dtype=bool)
    for _ in range(ROUNDS):
        off = _distances(found, points, chosen)
        limit = max(gate * NORMAL_MAD * float(np.median(off)), least)
        before, kept = kept, off <= limit
        if np.array_equal(kept, before):
            break
        found = fit_feature(points, kind, near=found, rows=chosen[kept])
    if nearby:
        rows = chosen[kept]
        near = np.logical_or.reduce([each.within(points, limit, rows) for each in nearby])
        if near.mean() < 0.5:
            kept[kept] = ~near
    return kept


def _distances(feature: Feature, points: FloatArray, rows: IntArray) -> FloatArray:
    """Distances (m,), mm, of the rows (m,) of points (n, 3) from a feature."""
    return by_block(len(rows), lambda block: np.abs(feature.distances(points[rows[block]])))


def _robust_fit(points: FloatArray, kind: str, least: float) -> Feature:
    """Robust fit: the loss soft_l1 by reweighted least squares."""
    found = fit_feature(points, kind)
    for _ in range(ROUNDS):
        off = found.distances(points)
        scale = NORMAL_MAD * float(np.median(np.abs(off)))
        if scale <= least:
            break
        found = fit_feature(points, kind, 1.0 / np.sqrt(1.0 + (off / scale) ** 2), found)
        if np.abs(found.distances(points) - off).max() < SETTLED * scale:
            break
    return found
