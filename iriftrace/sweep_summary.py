"""What plans, figures and reports show of a sweep: its ranked poses, where they are and saw."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.errors import InputError
from iriftrace.field_origin import synthetic_mark
from iriftrace.planning import Plan, pareto_front
from iriftrace.pose_quantity import Quantity, metric_quantity, scatter_quantity, score_quantity
from iriftrace.resolution import seen_frontally
from iriftrace.status import Status
from iriftrace.sweep_faces import faces_seen
from iriftrace.sweep_origin import attribute, scene_of
from iriftrace.sweep_varied import Varied, series_of, varied_of

if TYPE_CHECKING:
    import xarray as xr

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


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

    def value_text(self, quantity: Quantity, pose: int) -> str:
        """A metric of a pose with four digits; what is only rounding of a resolution is 0."""
        frontal = quantity is self.axial and self.sees_frontally(pose)
        return "0" if frontal else f"{quantity.values[pose]:.4g}"

    def sees_frontally(self, pose: int) -> bool:
        """Whether all that a pose sees is a plane across its axis; only steps can tell that."""
        lateral, axial = (float(self.plan.metrics[key][pose]) for key in ("lateral", "axial"))
        known = bool(self.axial.known[pose]) and self.plan.resolution == "step"
        return known and seen_frontally(lateral, axial)

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


def summarise(dataset: xr.Dataset, plan: Plan) -> SweepSummary:
    """Collect what plans, figures and reports of a sweep show.

    Parameters
    ----------
    dataset
        A sweep.
    plan
        Its ranking, by `iriftrace.planning.rank_poses`.

    Raises
    ------
    InputError
        The dataset is not a sweep.
    """
    front = pareto_front(
        dataset,
        statistic=plan.statistic,
        resolution=plan.resolution,
        region=plan.region,
        min_hits=plan.min_hits,
        min_coverage=plan.min_coverage,
    )
    view = dataset.sel(region=plan.region)
    enough = np.asarray(view["rays_good"].values) >= plan.min_hits
    azimuth, elevation, angles_of = _angles(dataset)
    return SweepSummary(
        displacement=metric_quantity(plan, "displacement", enough),
        coverage=metric_quantity(plan, "coverage", enough),
        axial=metric_quantity(plan, "axial", enough),
        lateral=metric_quantity(plan, "lateral", enough),
        score=score_quantity(plan),
        matrices=np.asarray(_variable(dataset, "matrix"), dtype=np.float64),
        distance=_variable(dataset, "distance"),
        azimuth=azimuth,
        elevation=elevation,
        angles_of=angles_of,
        rays=_rays(view),
        polygons=np.asarray(_variable(dataset, "shell_triangles_in_view"), dtype=np.int64),
        faces=faces_seen(dataset, plan.region),
        varied=varied_of(dataset),
        front=front,
        plan=plan,
        subtitle=_subtitle(dataset, plan.region, len(enough), len(plan.unranked)),
        scatter=scatter_quantity(view, plan.statistic, enough),
    )


def _variable(dataset: xr.Dataset, name: str) -> NDArray[Any]:
    if name not in dataset:
        raise InputError(
            f"This is not a sweep of iriftrace: {name} is missing; give the file that "
            "`iriftrace sweep` wrote."
        )
    return np.asarray(dataset[name].values)


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
