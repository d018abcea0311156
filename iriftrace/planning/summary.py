"""Summary of a ranked sweep for plans, figures and reports."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from functools import cached_property
from typing import TYPE_CHECKING, get_args

import numpy as np
from attrs import Factory, evolve, frozen

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.core.plain import JsonObject
from iriftrace.core.units import counted
from iriftrace.image.aov_image import AovImage, Status
from iriftrace.image.resolution import seen_frontally
from iriftrace.io.exr import read_exr
from iriftrace.medium.source import stated_source, synthetic_mark
from iriftrace.planning.criteria import METRICS, STANDARD_CRITERIA, Criteria, Statistic
from iriftrace.planning.quantities import (
    PoseQuantity,
    metric_quantity,
    scatter_quantity,
    score_quantity,
)
from iriftrace.planning.rank import Plan, pareto_front, rank_poses, ranked_quietly
from iriftrace.sweep.diagnostics import Varied, series_of, setting_of, varied_of
from iriftrace.sweep.faces import faces_seen
from iriftrace.sweep.store import WHOLE_PART, attribute, file_of, line_of_sight_angles, scene_of
from iriftrace.sweep.warned import warned_of

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike


STATISTICS = {"mean": "mean", "median": "median", "p95": "95th percentile"}
"""Names in sentences."""


@frozen(eq=False)
class SweepSummary:
    """Summary of a sweep of n poses.

    Attributes
    ----------
    displacement, coverage, axial, lateral, score : PoseQuantity
    matrices : (n, 4, 4) array, mm, world
    distance : (n,) array, mm
        From the camera to its target.
    azimuth, elevation : (n,) array, degree
        The azimuth from 0 to 360.
    angles_of : str
        Reference of azimuth and elevation.
    rays : dict of (n,) arrays
        Rays of each status that occurs and hit the part, by status; -1 where unknown.
    polygons : (n,) array
        Triangles of the air in view; -1 where unknown.
    faces : (n,) array
        Faces of the region that the pose sees.
    varied : tuple of Varied
        Differences between the poses besides position and direction.
    front : (k,) array of int
        Poses on the Pareto front.
    plan : Plan
    subtitle : str
        Scene, region and number of poses.
    warned : (n, m) array of bool
        Poses of which the sweep warned, for each of `iriftrace.sweep.warned.FLAGS`.
    quartiles : (n, 2) array or None
        Quartiles of the displacement of each pose's rays, um; None if the ranking is by another
        error.
    other_winners : dict of int
        Number of the best pose by each other statistic of the displacement that the sweep has.
    scatter : PoseQuantity or None
        Standard deviation over the members of an ensemble; None for a single field.
    devices : str or None
        Number of devices that the ranking is for, a sentence; None for one camera.
    rig : dict
        ``device``, the id of the second device, and ``to_first``, (4, 4), mm, from its frame to the
        camera's; empty for one camera.
    """

    displacement: PoseQuantity
    coverage: PoseQuantity
    axial: PoseQuantity
    lateral: PoseQuantity
    score: PoseQuantity
    matrices: FloatArray
    distance: FloatArray
    azimuth: FloatArray
    elevation: FloatArray
    angles_of: str
    rays: dict[Status, IntArray]
    polygons: IntArray
    faces: IntArray
    varied: tuple[Varied, ...]
    front: IntArray
    plan: Plan
    subtitle: str
    warned: BoolArray
    quartiles: FloatArray | None
    other_winners: dict[str, int]
    scatter: PoseQuantity | None = None
    devices: str | None = None
    rig: JsonObject = Factory(dict)

    @property
    def metrics(self) -> tuple[PoseQuantity, ...]:
        """The metrics of which the score consists."""
        return self.displacement, self.coverage, self.axial, self.lateral

    @property
    def of_camera(self) -> bool:
        """True if poses are ranked by the displacement of the camera's rays."""
        return self.plan.criteria.criterion == "displacement"

    def second_at(self, matrix: ArrayLike) -> FloatArray | None:
        """Pose (4, 4) of a rig's second device where the camera's is `matrix`; None without one."""
        return np.asarray(matrix) @ np.array(self.rig["to_first"]) if self.rig else None

    @property
    def quantities(self) -> tuple[PoseQuantity, ...]:
        """The metrics, for an ensemble the scatter, and the score."""
        scatter = () if self.scatter is None else (self.scatter,)
        return *self.metrics, *scatter, self.score

    def setting(self, pose: int) -> str:
        """Settings of a pose, in brackets; empty if they are the same for all poses."""
        text = setting_of(self.varied, pose)
        return f" ({text})" if text else ""

    def value_text(self, quantity: PoseQuantity, pose: int) -> str:
        """A metric of a pose with four digits; 0 if a resolution is only rounding."""
        frontal = quantity is self.axial and self.sees_frontally(pose)
        # With zeros at the end, so that the numbers of a column are alike.
        return "0" if frontal else f"{quantity.values[pose]:#.4g}".rstrip(".")

    def sees_frontally(self, pose: int) -> bool:
        """True if a pose sees only a plane across its axis, which steps show."""
        lateral, axial = (float(self.plan.metrics[key][pose]) for key in ("lateral", "axial"))
        return bool(self.axial.known[pose]) and seen_frontally(lateral, axial)

    @property
    def origins(self) -> FloatArray:
        """(n, 3) array, mm, world: positions of the cameras."""
        return self.matrices[:, :3, 3]

    @property
    def targets(self) -> FloatArray:
        """(n, 3) array, mm, world: points where the optical axes point."""
        return self.origins + self.distance[:, None] * self.matrices[:, :3, 2]

    @cached_property
    def series(self) -> dict[str, IntArray]:
        """Poses that differ only in position: a description, which may be empty; numbers."""
        return series_of(self.varied, len(self.distance))

    @cached_property
    def azimuth_on_maps(self) -> FloatArray:
        """Azimuths (n,), degree, less 360 beyond their widest gap, so that none lies between."""
        ascending = np.unique(self.azimuth)
        gaps = np.diff(ascending, append=ascending[0] + 360.0)
        widest = int(np.argmax(gaps))
        if gaps[-1] > gaps[widest] - 1e-6:
            return self.azimuth
        return np.where(self.azimuth > ascending[widest], self.azimuth - 360.0, self.azimuth)

    @property
    def is_one_direction(self) -> bool:
        """True if the poses differ only in their distance."""
        others = [one for one in self.varied if one.quantity != "stand-off"]
        angles = np.stack((self.azimuth_on_maps, self.elevation))
        # Poses of one direction differ only by rounding.
        near = np.ptp(angles, axis=1).max() < 1e-6
        return near and not others and bool(np.unique(self.distance).size > 1)

    def grid(self, members: IntArray) -> IntArray | None:
        """Pose of each elevation (rows) and azimuth (columns); None if the members are not a grid.

        The single pose at a pole is used for all azimuths.
        """
        azimuths, column = np.unique(self.azimuth_on_maps[members], return_inverse=True)
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


def summarise(dataset: xr.Dataset, criteria: Criteria = STANDARD_CRITERIA) -> SweepSummary:
    """Rank the poses of a sweep and collect the data for plans, figures and reports.

    Raises InputError as `iriftrace.planning.rank.rank_poses`.
    """
    plan = rank_poses(dataset, criteria)
    view = dataset.sel(region=criteria.region)
    enough = np.asarray(view["rays_good"].values) >= criteria.min_hits
    azimuth, elevation, angles_of = _angles(dataset)
    return SweepSummary(
        **{key: metric_quantity(plan, key, enough) for key in METRICS},
        score=score_quantity(plan),
        matrices=np.asarray(dataset["matrix"].values, dtype=np.float64),
        distance=dataset["distance"].values,
        azimuth=azimuth,
        elevation=elevation,
        angles_of=angles_of,
        rays=_rays(view),
        polygons=np.asarray(dataset["triangles_in_view"].values, dtype=np.int64),
        faces=faces_seen(dataset, criteria.region),
        varied=varied_of(dataset),
        front=pareto_front(dataset, criteria),
        plan=plan,
        subtitle=_subtitle(dataset, criteria.region, len(enough), len(plan.unranked)),
        warned=warned_of(dataset),
        quartiles=_quartiles(view, enough) if plan.criteria.criterion == "displacement" else None,
        other_winners=_other_winners(dataset, criteria),
        scatter=scatter_quantity(view, plan.criteria, enough),
        devices=devices_text(dataset, plan.criteria),
        rig=attribute(dataset, "rig"),
    )


def _quartiles(view: xr.Dataset, enough: BoolArray) -> FloatArray:
    found = 1e3 * np.stack([view[f"displacement_{name}"].values for name in ("p25", "p75")], axis=1)
    return np.where(enough[:, None], found, np.nan)


def _other_winners(dataset: xr.Dataset, criteria: Criteria) -> dict[str, int]:
    found = {}
    for statistic in get_args(Statistic):
        if statistic == criteria.statistic or criteria.criterion == "features":
            continue
        # A sweep may not have it.
        with suppress(InputError):
            found[statistic] = ranked_quietly(dataset, evolve(criteria, statistic=statistic)).best
    return found


def _angles(dataset: xr.Dataset) -> tuple[FloatArray, FloatArray, str]:
    """Angles of the orbit, or of the line of sight where these are the same for all poses."""
    angles = dataset["azimuth"].values, dataset["elevation"].values
    sight = line_of_sight_angles(dataset["matrix"].values)
    turn = np.remainder(np.stack(angles) - np.stack(sight) + 180.0, 360.0) - 180.0
    return *angles, "of the line of sight" if np.abs(turn).max() < 0.01 else "on the orbit"


def _rays(view: xr.Dataset) -> dict[Status, IntArray]:
    counts = {
        status: np.asarray(view[f"rays_{status.key}"].values, dtype=np.int64)
        for status in Status
        if status is not Status.MISSED
    }
    return {status: count for status, count in counts.items() if (count > 0).any()}


def _subtitle(dataset: xr.Dataset, region: str, poses: int, unranked: int) -> str:
    scene, _ = scene_of(dataset)
    parts = [
        synthetic_mark(stated_source(attribute(dataset, "field"))),
        f"{scene.parent.name}/{scene.name}" if scene else None,
        "whole part" if region == WHOLE_PART else f"region {region}",
        counted(poses, "pose"),
        f"{unranked} without a rank" if unranked else None,
    ]
    return "  ·  ".join(part for part in parts if part)


def extreme_poses(summary: SweepSummary) -> dict[str, int]:
    """Numbers of the ``best`` pose and those of ``smallest`` and ``largest`` displacement."""
    values = summary.displacement.values
    smallest, largest = int(np.nanargmin(values)), int(np.nanargmax(values))
    return {"best": summary.plan.best, "smallest": smallest, "largest": largest}


def extreme_images(dataset: xr.Dataset, summary: SweepSummary) -> Iterator[tuple[str, AovImage]]:
    """Images of `extreme_poses`, with their names.

    They are read if the sweep stored them next to its file, else rendered again. Raises
    `InputError` or `SetupError` if neither can be done.
    """
    from iriftrace.sweep.reload import load_swept_scene

    swept = file_of(dataset)
    images: dict[int, AovImage] = {}
    for which, pose in extreme_poses(summary).items():
        name = str(dataset["exr"].values[pose])
        file = swept.parent / name if swept and name else None
        if pose not in images and file and file.is_file():
            images[pose] = read_exr(file)
        if pose not in images:
            images[pose] = load_swept_scene(dataset, pose).render(summary.matrices[pose]).image
        yield which, images[pose]


def devices_text(dataset: xr.Dataset, criteria: Criteria) -> str | None:
    """Number of devices that the ranking is for, one sentence; None for one camera."""
    if "error_normal_p95" not in dataset:
        return None
    if criteria.criterion == "displacement":
        return (
            "This ranking is for the camera alone, but the sensor has two devices; rank by their "
            "measurement (criterion normal or features)."
        )
    return "Both devices move together, and the coverage is the area that both see."
