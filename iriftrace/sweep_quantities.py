"""What plans, figures and reports show of a sweep: metrics in readable units, angles, counts."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.errors import InputError
from iriftrace.field_origin import synthetic_mark
from iriftrace.planning import (
    Outside,
    Plan,
    Resolution,
    Statistic,
    Weights,
    pareto_front,
    rank_poses,
)
from iriftrace.status import Status
from iriftrace.sweep_faces import faces_seen
from iriftrace.sweep_origin import attribute, scene_of
from iriftrace.sweep_varied import Varied, series_of, varied_of

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.figure_scale import Limits

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

_STATISTICS = {"mean": "Mean", "median": "Median", "p95": "95th percentile of the"}
_READINGS = {
    "step": "step to the next pixel",
    "nn3d": "nearest neighbour in space",
    "nnxy": "nearest neighbour in the picture's plane",
}
# Values that span more than this are read on a logarithmic scale.
_WIDE = 20.0


@frozen(eq=False)
class Quantity:
    """One metric of all n poses.

    Attributes
    ----------
    key : str
        Short name, for files.
    title : str
        What it is.
    name : str
        The same with the reading, for axes.
    unit : str
        For axes.
    values : (n,) array
        In that unit; NaN for a pose without a number.
    limits : (2,) tuple
        In that unit: ends of the normalisation; of the score its smallest and largest value.
    normalised : (n,) array
        0 at the lower limit and 1 at the upper one and beyond; the score as it is.
    logarithmic : bool
        Whether colours and axes are.
    """

    key: str
    title: str
    name: str
    unit: str
    values: FloatArray
    limits: Limits
    normalised: FloatArray
    logarithmic: bool

    @property
    def label(self) -> str:
        """Name and unit for an axis."""
        return f"{self.name} ({self.unit})"

    @property
    def known(self) -> BoolArray:
        """(n,) mask of the poses that have a number."""
        return np.isfinite(self.values)


@frozen(eq=False)
class SweepSummary:
    """What is shown of a sweep of n poses.

    Attributes
    ----------
    displacement, coverage, axial, lateral, score : Quantity
    matrices : (n, 4, 4) array, mm, world
    distance : (n,) array, mm
        From the camera to what it looks at.
    azimuth, elevation : (n,) array, degree
    angles_of : str
        What azimuth and elevation belong to.
    rays : dict of (n,) arrays
        Rays of each status that occurs and hit the part, by status; -1 where unknown.
    polygons : (n,) array
        Triangles of the shells in view; -1 where unknown.
    faces : (n,) array or None
        Faces of the region that the pose sees; None where an older sweep does not say.
    varied : tuple of Varied
        What differs between the poses besides position and direction.
    front : (k,) array of int
        Poses on the Pareto front.
    plan : Plan
    subtitle : str
        Scene, region and number of poses.
    scatter : Quantity or None
        Standard deviation over the members of an ensemble; None for a single field.
    """

    displacement: Quantity
    coverage: Quantity
    axial: Quantity
    lateral: Quantity
    score: Quantity
    matrices: FloatArray
    distance: FloatArray
    azimuth: FloatArray
    elevation: FloatArray
    angles_of: str
    rays: dict[Status, IntArray]
    polygons: IntArray
    faces: IntArray | None
    varied: tuple[Varied, ...]
    front: IntArray
    plan: Plan
    subtitle: str
    scatter: Quantity | None = None

    @property
    def metrics(self) -> tuple[Quantity, ...]:
        """What the score is made of."""
        return self.displacement, self.coverage, self.axial, self.lateral

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """The metrics, of an ensemble the scatter, and the score."""
        scatter = () if self.scatter is None else (self.scatter,)
        return *self.metrics, *scatter, self.score

    @property
    def origins(self) -> FloatArray:
        """(n, 3) array, mm, world: where the cameras stand."""
        return self.matrices[:, :3, 3]

    @property
    def targets(self) -> FloatArray:
        """(n, 3) array, mm, world: where the optical axes point."""
        return self.origins + self.distance[:, None] * self.matrices[:, :3, 2]

    @cached_property
    def series(self) -> dict[str, IntArray]:
        """Poses that differ in nothing but position: a description, which may be empty; numbers."""
        return series_of(self.varied, len(self.distance))

    def grid(self, members: IntArray) -> IntArray | None:
        """Pose of each elevation (rows) and azimuth (columns); None if the poses are no grid.

        The one pose at a pole stands for all azimuths.

        Parameters
        ----------
        members
            Numbers of the poses to arrange.
        """
        azimuths, column = np.unique(self.azimuth[members], return_inverse=True)
        elevations, row = np.unique(self.elevation[members], return_inverse=True)
        poses = np.full((len(elevations), len(azimuths)), -1, dtype=np.int64)
        if min(poses.shape) < 2:
            return None
        poses[row, column] = members
        used = len(row)
        for pole in np.flatnonzero(np.abs(elevations) == 90.0):
            (there,) = np.nonzero(row == pole)
            if len(there) == 1:
                poses[pole] = members[there[0]]
                used += len(azimuths) - 1
        return poses if (poses >= 0).all() and used == poses.size else None


def summarise(
    dataset: xr.Dataset,
    *,
    weights: Weights | None = None,
    statistic: Statistic = "mean",
    resolution: Resolution = "step",
    region: str = "part",
    percentile: float = 95.0,
    outside: Outside = "clip",
    min_hits: int = 100,
) -> SweepSummary:
    """Collect what plans, figures and reports of a sweep show.

    Parameters
    ----------
    dataset
        A sweep.
    weights, statistic, resolution, region, percentile, outside, min_hits
        As for `iriftrace.planning.rank_poses`.

    Raises
    ------
    InputError
        An option is wrong, the dataset is not a sweep, or no pose can be ranked.
    """
    plan = rank_poses(
        dataset,
        weights=weights,
        statistic=statistic,
        resolution=resolution,
        region=region,
        percentile=percentile,
        outside=outside,
        min_hits=min_hits,
    )
    front = pareto_front(
        dataset, statistic=statistic, resolution=resolution, region=region, min_hits=min_hits
    )
    view = dataset.sel(region=region)
    enough = np.asarray(view["rays_good"].values) >= min_hits
    reading = _READINGS[resolution]
    azimuth, elevation, angles_of = _angles(dataset)
    return SweepSummary(
        displacement=_quantity(
            plan, "displacement", f"{_STATISTICS[statistic]} displacement", enough
        ),
        coverage=_quantity(plan, "coverage", "Coverage", enough),
        axial=_quantity(plan, "axial", f"Axial resolution, {reading}", enough),
        lateral=_quantity(plan, "lateral", f"Lateral resolution, {reading}", enough),
        score=_score(plan),
        matrices=np.asarray(_variable(dataset, "matrix"), dtype=np.float64),
        distance=_variable(dataset, "distance"),
        azimuth=azimuth,
        elevation=elevation,
        angles_of=angles_of,
        rays=_rays(view),
        polygons=np.asarray(_variable(dataset, "shell_triangles_in_view"), dtype=np.int64),
        faces=faces_seen(dataset, region),
        varied=varied_of(dataset),
        front=front,
        plan=plan,
        subtitle=_subtitle(dataset, region, len(enough), len(plan.unranked)),
        scatter=_scatter(view, statistic, enough),
    )


def _variable(dataset: xr.Dataset, name: str) -> NDArray[Any]:
    if name not in dataset:
        raise InputError(
            f"This is not a sweep of iriftrace: {name} is missing; give the file that "
            "`iriftrace sweep` wrote."
        )
    return np.asarray(dataset[name].values)


def _quantity(plan: Plan, key: str, name: str, enough: BoolArray) -> Quantity:
    values = np.where(enough, plan.metrics[key], np.nan)
    low, high = plan.limits[key]
    factor, unit = 1e3, "µm"
    if key == "coverage":
        factor, unit = 100.0, "%"
    elif high >= 10.0:
        factor, unit = 1.0, "mm"
    # Only the displacement goes over orders of magnitude; zero has no place on its scale.
    wide = key == "displacement" and bool(np.nanmin(values) > 0.0)
    return Quantity(
        key=key,
        title=name.partition(",")[0],
        name=name,
        unit=unit,
        values=factor * values,
        limits=(factor * low, factor * high),
        normalised=plan.normalised[key],
        logarithmic=wide and bool(np.nanmax(values) > _WIDE * np.nanmin(values)),
    )


def _scatter(view: xr.Dataset, statistic: Statistic, enough: BoolArray) -> Quantity | None:
    """Standard deviation over the members of an ensemble; None for a single field."""
    if f"scatter_{statistic}" not in view:
        return None
    values = np.where(enough, 1e3 * view[f"scatter_{statistic}"].values, np.nan)
    if not np.isfinite(values).any():
        return None
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    span = high - low or 1.0
    title = f"{_STATISTICS[statistic]} scatter"
    wide = low > 0.0 and high > _WIDE * low
    return Quantity(
        key="scatter",
        title=title,
        name=f"{title}, standard deviation over the members",
        unit="µm",
        values=values,
        limits=(low, high),
        normalised=np.clip((values - low) / span, 0.0, 1.0),
        logarithmic=wide,
    )


def _score(plan: Plan) -> Quantity:
    limits = float(np.nanmin(plan.score)), float(np.nanmax(plan.score))
    unit = "dimensionless, the smaller the better"
    return Quantity(
        "score", "Combined score", "Combined score", unit, plan.score, limits, plan.score, False
    )


def _angles(dataset: xr.Dataset) -> tuple[FloatArray, FloatArray, str]:
    """Angles of the orbit; of the line of sight where poses come from somewhere else."""
    azimuth, elevation = (_variable(dataset, name) for name in ("azimuth", "elevation"))
    if np.isfinite(azimuth).all() and np.isfinite(elevation).all():
        return azimuth, elevation, "on the orbit"
    # Rounded, so that straight down is azimuth 0 and not the angle of two rounding errors.
    x, y, z = 0.0 - np.round(_variable(dataset, "matrix")[:, :3, 2], 12).T
    across = np.degrees(np.arctan2(y, x))
    return across, np.degrees(np.arctan2(z, np.hypot(x, y))), "of the line of sight"


def _rays(view: xr.Dataset) -> dict[Status, IntArray]:
    counts = {
        status: np.asarray(_variable(view, f"rays_{status.key}"), dtype=np.int64)
        for status in Status
        if status is not Status.MISSED
    }
    return {status: count for status, count in counts.items() if (count > 0).any()}


def _subtitle(dataset: xr.Dataset, region: str, poses: int, unranked: int) -> str:
    parts = [
        synthetic_mark(attribute(dataset, "field").get("origin")),
        scene.parent.name + "/" + scene.name if (scene := scene_of(dataset)[0]) else None,
        "whole part" if region == "part" else f"region {region}",
        f"{poses} poses",
        f"{unranked} without a rank" if unranked else None,
    ]
    return "  ·  ".join(part for part in parts if part)
