"""Options about how the poses of a sweep are ranked: the same for plan, plot and report."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from attrs import frozen
from cyclopts import Group, Parameter

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.sweep_summary import SweepSummary

RANKING = Group("Ranking", sort_key=1)


@Parameter(name="*", group=RANKING)
@frozen
class RankingOptions:
    """How poses are ranked.

    Parameters
    ----------
    displacement
        Weight in the score = displacement d + coverage (1 - c) + axial a + lateral l of the
        normalised metrics, the smaller the better.
    coverage
        Weight of the part's area that is not seen.
    axial
        Weight of the resolution along the line of sight.
    lateral
        Weight of the resolution across the line of sight.
    statistic
        Which displacement: the paper's mean, or one that silhouettes cannot spoil.
    resolution
        Reading of the resolution.
    region
        Region of the part.
    percentile
        Upper end of the normalisation.
    outside
        What becomes of poses beyond the percentile.
    min_hits
        Poses with fewer good rays stay unranked.
    min_coverage
        Poses that see a smaller share of the area, from 0 to 1, stay unranked.
    """

    displacement: float = 0.5
    coverage: float = 0.2
    axial: float = 0.15
    lateral: float = 0.15
    statistic: Literal["mean", "median", "p95"] = "mean"
    resolution: Literal["step", "nn3d", "nnxy"] = "step"
    region: str = "part"
    percentile: float = 95.0
    outside: Literal["clip", "discard"] = "clip"
    min_hits: int = 100
    min_coverage: float = 0.0

    def summary_of(self, dataset: xr.Dataset) -> SweepSummary:
        """The sweep's poses ranked by these options."""
        from iriftrace.plan_weights import Weights
        from iriftrace.planning import rank_poses
        from iriftrace.sweep_summary import summarise

        plan = rank_poses(
            dataset,
            weights=Weights(self.displacement, self.coverage, self.axial, self.lateral),
            statistic=self.statistic,
            resolution=self.resolution,
            region=self.region,
            percentile=self.percentile,
            outside=self.outside,
            min_hits=self.min_hits,
            min_coverage=self.min_coverage,
        )
        return summarise(dataset, plan)


THE_PAPERS = RankingOptions()
"""Weights and normalisation of Kern et al. (2025)."""
