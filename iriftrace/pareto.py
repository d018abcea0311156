"""Poses that are the best for some taste: nothing surpasses them in every respect."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from iriftrace.plan_candidates import METRICS, Resolution, Statistic, find_candidates

if TYPE_CHECKING:
    import xarray as xr

IntArray = NDArray[np.int64]


def pareto_front(
    dataset: xr.Dataset,
    *,
    statistic: Statistic = "mean",
    resolution: Resolution = "step",
    region: str = "part",
    min_hits: int = 100,
    min_coverage: float = 0.0,
) -> IntArray:
    """Poses that no other pose surpasses in every respect, whatever the weights.

    A pose is left out if another one is at least as good in displacement, coverage, axial and
    lateral resolution and better in one of them. Parameters and errors are those of
    `iriftrace.planning.rank_poses`.

    Returns
    -------
    (k,) array of int
        Numbers of the poses, ascending.
    """
    found = find_candidates(dataset, statistic, resolution, region, min_hits, min_coverage, METRICS)
    poses = np.flatnonzero(found.eligible)
    costs = np.stack(
        [
            -found.metrics[name][poses] if name == "coverage" else found.metrics[name][poses]
            for name in METRICS
        ],
        axis=1,
    )
    # In this order, a pose can only be dominated by an earlier one.
    order = np.lexsort(costs.T[::-1])
    poses, costs = poses[order], costs[order]
    front: list[int] = []
    for i, cost in enumerate(costs):
        others = costs[front]
        dominated = np.all(others <= cost, axis=1) & np.any(others < cost, axis=1)
        if not dominated.any():
            front.append(i)
    return np.sort(poses[front]).astype(np.int64)
