"""Counts of rays by their outcome, and statistics of values over rays."""

from __future__ import annotations

import numpy as np
from attrs import fields, frozen

from iriftrace.core.arrays import Float32Array, FloatArray, IntArray
from iriftrace.core.statistics import spread
from iriftrace.image.aov_image import (
    MEMBERS_CHANNEL,
    WORST_CHANNEL,
    WORST_NORM_CHANNEL,
    AovImage,
    Status,
)

FEWEST_RAYS = 100
"""Minimum number of good rays for a metric, which else is None, and for a pose not to be empty."""

TOO_FEW = f"fewer than {FEWEST_RAYS} good rays, so no numbers"
"""The words in place of a metric that is None."""


@frozen
class Statistics:
    """Statistics of some values in seven numbers; None for fewer than `FEWEST_RAYS` values.

    Outliers of several mm at silhouettes dominate the mean, so median and quartiles (`p25`, `p75`)
    are given as well.
    """

    mean: float | None = None
    median: float | None = None
    p95: float | None = None
    max: float | None = None
    rms: float | None = None
    p25: float | None = None
    p75: float | None = None

    @classmethod
    def of(cls, values: Float32Array | FloatArray) -> Statistics:
        """Statistics of an (n,) array."""
        if len(values) < FEWEST_RAYS:
            return cls()
        return cls(**spread(values.astype(np.float64), [one.name for one in fields(cls)]))


UNKNOWN = Statistics()
"""Statistics of too few values."""

OF_MET = "of all that did not miss"
"""The denominator of `percent`, in words. Blocked rays do not hit, so hits are none."""


def percent(count: int, met: int) -> str:
    """A number of rays or pixels as a fraction of all that did not miss, for tables and legends."""
    return f"{100 * count / met:.1f} %" if count >= 0.0005 * met else "< 0.1 %"


@frozen
class RayCounts:
    """Numbers of rays by their outcome."""

    hit: int  # straight rays that end on the part (or the region)
    # Of each `Status`; for a region those whose straight ray hits it.
    good: int
    missed: int
    out_of_focus: int
    refracted_missed: int
    only_refracted: int
    index_mismatch: int
    gave_up: int
    blocked: int
    launched: int | None = None  # all rays; None for a region
    open_boundary: int | None = None  # good rays that pass an open end of the data, where known

    def of(self, status: Status) -> int:
        """Rays of one status."""
        return int(getattr(self, status.key))

    @property
    def met(self) -> int:
        """Rays that met the part or another body: all but those that missed."""
        return sum(self.of(status) for status in Status if status is not Status.MISSED)

    @property
    def lost(self) -> int:
        """Number of rays whose refracted end is not known (`Status.lost`)."""
        return sum(self.of(status) for status in Status if status.lost)

    @property
    def lost_fraction(self) -> float:
        """Lost rays per straight hit."""
        return self.lost / max(self.hit, 1)


@frozen
class EnsembleMetrics:
    """Scatter over the fields of an ensemble; the bias is the displacement of the mean image.

    The scatter is the standard deviation over the fields, of displacement (mm) and shift (px), in
    statistics over the pixels. The bias can be corrected, the scatter cannot.
    """

    members: int  # number of fields
    scatter_mm: Statistics
    scatter_px: Statistics
    rays_in_all: int  # pixels that count in all members
    rays_in_some: int  # only in some
    worst_mm: Statistics  # displacement by the worst member of each pixel
    worst_member: int | None  # the one that is worst in most pixels; None without any


def ensemble_metrics(image: AovImage, pixels: IntArray, hits: IntArray) -> EnsembleMetrics:
    """Scatter at the row-major pixels (n,) whose rays count, among all (m,) on the part."""
    members = int((image.header.get("ensemble") or {}).get("count") or 0)
    counted = np.rint(image.channels[MEMBERS_CHANNEL].ravel()[hits]).astype(np.int64)
    members = members or int(counted.max(initial=0))
    shift = [image.channels[f"shift.px.std.{a}"].ravel()[pixels].astype(np.float64) for a in "XY"]
    worst = np.rint(image.channels[WORST_CHANNEL].ravel()[pixels]).astype(np.int64)
    return EnsembleMetrics(
        members=members,
        scatter_mm=Statistics.of(image.channels["displacement.std.norm"].ravel()[pixels]),
        scatter_px=Statistics.of(np.hypot(*shift)),
        rays_in_all=int(np.count_nonzero(counted == members)),
        rays_in_some=int(np.count_nonzero((counted > 0) & (counted < members))),
        worst_mm=Statistics.of(image.channels[WORST_NORM_CHANNEL].ravel()[pixels]),
        worst_member=int(np.bincount(worst).argmax()) if len(worst) else None,
    )
