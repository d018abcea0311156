"""One metric of all poses of a sweep for plans, figures and reports: named, with a unit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import BoolArray, FloatArray
from iriftrace.planning.candidates import ranked_error, reading_of
from iriftrace.planning.criteria import Criteria
from iriftrace.planning.rank import Plan
from iriftrace.sweep.measures import READINGS, Limits

if TYPE_CHECKING:
    import xarray as xr


_STATISTICS = {"mean": "Mean", "median": "Median", "p95": "95th-percentile"}
# Values that span more than this factor are shown on a logarithmic scale.
_WIDE = 20.0


@frozen(eq=False)
class PoseQuantity:
    """One metric of all n poses.

    Limits are the ends of the normalisation; for the score, which is not normalised again, its
    smallest and largest value.
    """

    key: str  # for files
    title: str
    name: str  # the title with the reading, for axes
    unit: str
    values: FloatArray  # (n,), in that unit; NaN for a pose without a number
    limits: Limits  # in that unit
    normalised: FloatArray  # (n,), 0 at the lower limit, 1 at the upper one and beyond
    logarithmic: bool  # colours and axes

    @property
    def label(self) -> str:
        """Name and unit for an axis."""
        return f"{self.name} ({self.unit})"

    @property
    def known(self) -> BoolArray:
        """(n,) mask of the poses that have a number."""
        return np.isfinite(self.values)


def metric_quantity(plan: Plan, key: str, enough: BoolArray) -> PoseQuantity:
    """One of `METRICS` of a ranking; `enough` masks the poses with values from enough rays."""
    if key == "displacement":
        name = ranked_error(plan.criteria).name
        if plan.criteria.criterion == "features":
            name = name.capitalize()
        else:
            name = f"{_STATISTICS[plan.criteria.statistic]} {name}"
        if plan.criteria.robust:
            name += f" + {plan.criteria.robust:g} standard deviations"
    elif key == "coverage":
        name = "Coverage"
    else:
        name = f"{key.capitalize()} resolution"
    resolution = key in ("axial", "lateral")
    values = np.where(enough, plan.metrics[key], np.nan)
    low, high = plan.limits[key]
    factor, unit = 1e3, "µm"
    if key == "coverage":
        factor, unit = 100.0, "%"
    elif high >= 10.0:
        factor, unit = 1.0, "mm"
    # Only the displacement spans orders of magnitude; zero has no place on its scale.
    wide = key == "displacement" and bool(np.nanmin(values) > 0.0)
    return PoseQuantity(
        key=key,
        title=name,
        name=f"{name}, {READINGS[reading_of(plan.criteria)]}" if resolution else name,
        unit=unit,
        values=factor * values,
        limits=(factor * low, factor * high),
        normalised=plan.normalised[key],
        logarithmic=wide and bool(np.nanmax(values) > _WIDE * np.nanmin(values)),
    )


def scatter_quantity(
    view: xr.Dataset, criteria: Criteria, enough: BoolArray
) -> PoseQuantity | None:
    """Standard deviation over an ensemble's members in one region; None for a single field.

    The statistic is that of the standard deviations in one view; `enough` as in `metric_quantity`.
    """
    variable = ranked_error(criteria).scatter
    if variable not in view:
        return None
    values = np.where(enough, 1e3 * view[variable].values, np.nan)
    if not np.isfinite(values).any():
        return None
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    title = "Scatter of diameters"
    if criteria.criterion != "features":
        title = f"{_STATISTICS[criteria.statistic]} scatter"
    return PoseQuantity(
        key="scatter",
        title=title,
        name=f"{title}, standard deviation over the members",
        unit="µm",
        values=values,
        limits=(low, high),
        normalised=(values - low) / (high - low or 1.0),
        logarithmic=low > 0.0 and high > _WIDE * low,
    )


def score_quantity(plan: Plan) -> PoseQuantity:
    """The combined score of a ranking."""
    name, unit = "Combined score", "dimensionless, the smaller the better"
    limits = float(np.nanmin(plan.score)), float(np.nanmax(plan.score))
    return PoseQuantity("score", name, name, unit, plan.score, limits, plan.score, False)
