"""Summary of a ranked sweep, as plans, figures and reports show it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.field.source import stated_source, synthetic_mark
from iriftrace.image.aov_image import AovImage, Status, read_exr
from iriftrace.image.resolution import FRONTAL, seen_frontally
from iriftrace.planning.cover import ViewLimits, ViewSet
from iriftrace.planning.criteria import METRICS, STANDARD, Criteria, Statistic
from iriftrace.planning.quantities import (
    Quantity,
    metric_quantity,
    scatter_quantity,
    score_quantity,
)
from iriftrace.planning.rank import Plan, pareto_front, rank_poses, ranked_quietly
from iriftrace.planning.stability import close_alternative, far_apart, stability
from iriftrace.sweep.diagnostics import Varied, series_of, varied_of
from iriftrace.sweep.faces import faces_seen
from iriftrace.sweep.store import WHOLE_PART, attribute, scene_of
from iriftrace.sweep.warned import FLAGS, Flag, warned_of

if TYPE_CHECKING:
    import xarray as xr


STATISTICS = {"mean": "mean", "median": "median", "p95": "95th percentile"}
"""Names in sentences."""


@frozen(eq=False)
class SweepSummary:
    """Summary of a sweep of n poses.

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
        Triangles of the air in view; -1 where unknown.
    faces : (n,) array or None
        Faces of the region that the pose sees; None where an older sweep does not say.
    varied : tuple of Varied
        What differs between the poses besides position and direction.
    front : (k,) array of int
        Poses on the Pareto front.
    plan : Plan
    subtitle : str
        Scene, region and number of poses.
    warned : (n, m) array of bool
        Poses of which the sweep warned, for each of `iriftrace.sweep.warned.FLAGS`.
    quartiles : (n, 2) array or None
        Quartiles of the displacement of each pose's rays, um; None of an older sweep.
    other_winners : dict of int
        Number of the best pose by each other statistic of the displacement that the sweep has.
    scatter : Quantity or None
        Standard deviation over the members of an ensemble; None for a single field.
    devices : str or None
        Of how many devices the ranking is, a sentence; None for one camera.
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
    warned: BoolArray
    quartiles: FloatArray | None
    other_winners: dict[str, int]
    scatter: Quantity | None = None
    devices: str | None = None

    @property
    def metrics(self) -> tuple[Quantity, ...]:
        """What the score is made of."""
        return self.displacement, self.coverage, self.axial, self.lateral

    @property
    def of_camera(self) -> bool:
        """Whether poses are ranked by the displacement of the camera's rays."""
        return self.plan.criteria.criterion == "displacement"

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
        known = bool(self.axial.known[pose]) and self.plan.criteria.resolution == "step"
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

    @property
    def is_one_direction(self) -> bool:
        """Whether the poses differ in their distance alone."""
        others = [one for one in self.varied if not one.name.startswith("stand-off")]
        angles = np.stack((self.azimuth, self.elevation))
        # Those of one direction differ by rounding alone.
        near = np.ptp(angles, axis=1).max() < 1e-6
        return near and not others and bool(np.unique(self.distance).size > 1)

    def grid(self, members: IntArray) -> IntArray | None:
        """Pose of each elevation (rows) and azimuth (columns); None if the members are no grid.

        The one pose at a pole stands for all azimuths.
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


def summarise(dataset: xr.Dataset, criteria: Criteria = STANDARD) -> SweepSummary:
    """Rank the poses of a sweep and collect what plans, figures and reports show of them.

    Raises
    ------
    InputError
        As `iriftrace.planning.rank.rank_poses`.
    """
    plan = rank_poses(dataset, criteria)
    view = dataset.sel(region=criteria.region)
    enough = np.asarray(view["rays_good"].values) >= criteria.min_hits
    azimuth, elevation, angles_of = _angles(dataset)
    return SweepSummary(
        **{key: metric_quantity(plan, key, enough) for key in METRICS},
        score=score_quantity(plan),
        matrices=np.asarray(_variable(dataset, "matrix"), dtype=np.float64),
        distance=_variable(dataset, "distance"),
        azimuth=azimuth,
        elevation=elevation,
        angles_of=angles_of,
        rays=_rays(view),
        polygons=np.asarray(_variable(dataset, "triangles_in_view"), dtype=np.int64),
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
    )


def _quartiles(view: xr.Dataset, enough: BoolArray) -> FloatArray | None:
    names = ("displacement_p25", "displacement_p75")
    if any(name not in view for name in names):
        return None
    found = 1e3 * np.stack([view[name].values for name in names], axis=1)
    return np.where(enough[:, None], found, np.nan)


def _other_winners(dataset: xr.Dataset, criteria: Criteria) -> dict[str, int]:
    found = {}
    for statistic in get_args(Statistic):
        if statistic == criteria.statistic or criteria.criterion == "features":
            continue
        # A sweep may lack it.
        with suppress(InputError):
            found[statistic] = ranked_quietly(dataset, evolve(criteria, statistic=statistic)).best
    return found


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
    scene, _ = scene_of(dataset)
    parts = [
        synthetic_mark(stated_source(attribute(dataset, "field"))),
        f"{scene.parent.name}/{scene.name}" if scene else None,
        "whole part" if region == WHOLE_PART else f"region {region}",
        f"{poses} poses",
        f"{unranked} without a rank" if unranked else None,
    ]
    return "  ·  ".join(part for part in parts if part)


def extreme_poses(summary: SweepSummary) -> dict[str, int]:
    """Numbers of the ``best`` pose and those of ``smallest`` and ``largest`` displacement."""
    values = summary.displacement.values
    smallest, largest = int(np.nanargmin(values)), int(np.nanargmax(values))
    return {"best": summary.plan.best, "smallest": smallest, "largest": largest}


def extreme_images(
    dataset: xr.Dataset, summary: SweepSummary, beside: Path
) -> Iterator[tuple[str, AovImage]]:
    """Images of `extreme_poses`, with their names.

    Read where the sweep kept them in the folder `beside`, else rendered again; `InputError` and
    `SetupError` where neither can be done.
    """
    from iriftrace.sweep.reload import load_swept_scene

    images: dict[int, AovImage] = {}
    for name, pose in extreme_poses(summary).items():
        file = str(dataset["exr"].values[pose]) if "exr" in dataset else ""
        if pose not in images and file and (beside / file).is_file():
            images[pose] = read_exr(beside / file)
        if pose not in images:
            images[pose] = load_swept_scene(dataset, pose).render(summary.matrices[pose]).image
        yield name, images[pose]


@frozen
class RankingTable:
    """The best poses and their numbers, the best first."""

    headings: tuple[str, ...]  # with units
    short_headings: tuple[str, ...]  # fit into a terminal
    rows: tuple[tuple[str, ...], ...]
    note: str = ""  # what a number in the rows means, in sentences


def ranking_table(summary: SweepSummary, top: int) -> RankingTable:
    """Write down the best poses, at most `top`, which is at least 1."""
    if top < 1:
        raise InputError(f"A ranking of {top} rows shows no pose; give at least 1.")
    return _table(summary, summary.plan.order[:top].tolist())


def front_table(summary: SweepSummary) -> RankingTable:
    """Write down the poses on the Pareto front, by rank; those without a rank come last."""
    front = set(summary.front.tolist())
    ranked = [pose for pose in summary.plan.order.tolist() if pose in front]
    return _table(summary, [*ranked, *sorted(front - set(ranked))])


def _table(summary: SweepSummary, poses: Sequence[int]) -> RankingTable:
    ranks = {pose: str(rank) for rank, pose in enumerate(summary.plan.order.tolist(), start=1)}
    flags = _flags_met(np.asarray(summary.warned[list(poses)].any(axis=0)))
    rows = [
        (
            ranks.get(pose, ""),
            str(pose),
            f"{summary.azimuth[pose]:.1f}",
            f"{summary.elevation[pose]:.1f}",
            *(one.values[pose] for one in summary.varied),
            f"{summary.score.values[pose]:.3f}" if pose in ranks else "",
            *(summary.value_text(quantity, pose) for quantity in summary.metrics),
            *(("".join(f.letter for f in _flags_met(summary.warned[pose])),) if flags else ()),
        )
        for pose in poses
    ]
    criteria = summary.plan.criteria
    error = {"normal": f"|e| {criteria.statistic}", "features": "|d|"}
    short = (error.get(criteria.criterion or "", criteria.statistic), "cover", "axial", "lat.")
    notes = []
    if any(map(summary.sees_frontally, poses)):
        notes.append(f"Axial resolution 0: {FRONTAL}.")
    if flags:
        notes.append(f"Warned of: {', '.join(f'{flag.letter} {flag.text}' for flag in flags)}.")
    return RankingTable(
        (
            *("rank", "pose", "azimuth (°)", "elevation (°)"),
            *(one.name for one in summary.varied),
            "score",
            *(quantity.label for quantity in summary.metrics),
            *(("warned",) if flags else ()),
        ),
        (
            *("rank", "pose", "az. °", "el. °"),
            *(one.short_name for one in summary.varied),
            "score",
            *(f"{name} {metric.unit}" for name, metric in zip(short, summary.metrics, strict=True)),
            *(("warn",) if flags else ()),
        ),
        tuple(rows),
        " ".join(notes),
    )


def _flags_met(given: BoolArray) -> list[Flag]:
    return [flag for flag, met in zip(FLAGS, given.tolist(), strict=True) if met]


def devices_text(dataset: xr.Dataset, criteria: Criteria) -> str | None:
    """Of how many devices the ranking is, one sentence; None for one camera."""
    if "error_normal_p95" not in dataset:
        return None
    if criteria.criterion == "displacement":
        return (
            "This ranking is of the camera alone, but the sensor has two devices; rank by what "
            "they measure (--criterion normal or features)."
        )
    return "Both devices move together, and the coverage is that of points that both see."


def stability_text(summary: SweepSummary) -> str:
    """Ranks of the best pose with other weights, one sentence."""
    varied = stability(summary.plan)
    rivals = len(varied.rivals)
    return (
        f"When one weight varies by +-50 %, the best pose ranks {varied.worst_rank} at worst; "
        f"when all do, {rivals} other {'pose' if rivals == 1 else 'poses'} can beat it."
    )


def other_statistics_text(summary: SweepSummary) -> str | None:
    """Winners by other statistics of the displacement, one sentence; None if they are the same."""
    others = [
        f"by its {STATISTICS[statistic]} pose {pose}"
        for statistic, pose in summary.other_winners.items()
        if pose != summary.plan.best
    ]
    if not others:
        return None
    return (
        f"Scored with the {STATISTICS[summary.plan.criteria.statistic]} of the "
        f"{'displacement' if summary.of_camera else 'error along the normal'} pose "
        f"{summary.plan.best} is the best, {' and '.join(others)} (--statistic)."
    )


def robust_text(summary: SweepSummary) -> str | None:
    """Between which poses the members differ least and most, one sentence; None of one field."""
    if summary.scatter is None:
        return None
    values = summary.scatter.values
    least, most = int(np.nanargmin(values)), int(np.nanargmax(values))
    places = [
        f"{values[pose]:.3g} um in pose {pose} (azimuth {summary.azimuth[pose]:.0f}, elevation "
        f"{summary.elevation[pose]:.0f} degrees)"
        for pose in (least, most)
    ]
    factor = summary.plan.criteria.robust
    added = f"{factor:g} times it is added" if factor else "it does not count"
    return (
        f"From member to member the {summary.scatter.title.lower()} is {places[0]} to {places[1]}; "
        f"{added} (--robust)."
    )


def warned_text(summary: SweepSummary) -> str | None:
    """Warnings of the best pose, one sentence; None if there are none."""
    found = [flag.text for flag in _flags_met(summary.warned[summary.plan.best])]
    return f"The sweep warns of the best pose: {'; '.join(found)}." if found else None


def alternative_text(summary: SweepSummary) -> str | None:
    """That the winner is not clear, or sees little, one sentence; None if neither."""
    found = close_alternative(summary.plan)
    if found is None:
        coverage = summary.plan.metrics["coverage"][summary.plan.order]
        if not far_apart(coverage[0], coverage.max()):
            return None
        return (
            f"The best pose sees {100 * coverage[0]:.1f} % of {_region(summary)}, another one "
            f"{100 * coverage.max():.1f} %; ask for a --min-coverage if more has to be seen."
        )
    return (
        f"The winner is not clear: pose {found.pose} scores only {found.behind:.3f} more and sees "
        f"{100 * found.coverage:.1f} % of {_region(summary)} instead of "
        f"{100 * found.best_coverage:.1f} %; choose by what has to be measured, change the "
        "weights or ask for a --min-coverage."
    )


def views_table(summary: SweepSummary, views: ViewSet) -> RankingTable:
    """Write down poses that together see the most, and what each adds."""
    shares = 100.0 * np.column_stack((views.added, np.cumsum(views.added)))
    rows = tuple(
        (
            str(number),
            str(pose),
            f"{summary.azimuth[pose]:.1f}",
            f"{summary.elevation[pose]:.1f}",
            *(f"{share:.2f}" for share in shares[number - 1]),
        )
        for number, pose in enumerate(views.poses.tolist(), start=1)
    )
    columns = ("adds %", "together %")
    return RankingTable(
        ("view", "pose", "azimuth (°)", "elevation (°)", *columns),
        ("view", "pose", "azim. °", "elev. °", *columns),
        rows,
    )


def views_text(summary: SweepSummary, views: ViewSet) -> str:
    """What poses see together, and how good the choice is, one sentence."""
    proof = (
        "no other choice of as many poses sees more (exact)."
        if views.exact
        else f"another choice might see up to {100 * views.gap:.2f} % of its area more (gap)."
    )
    return (
        f"Together they see {100 * views.covered:.2f} % of the area of {_region(summary)}, of "
        f"{100 * views.coverable:.2f} % that all poses see within the limits; {proof}"
    )


def views_title(summary: SweepSummary, limits: ViewLimits) -> str:
    """Title of `views_table`, half a sentence."""
    return (
        f"Poses that together see the most of {_region(summary)}; a face counts that is seen "
        f"{limits.text}"
    )


def front_text(summary: SweepSummary) -> str:
    """The poses on the Pareto front, one sentence."""
    error = "displacement" if summary.of_camera else "error"
    return (
        f"Not beaten in {error}, coverage and resolution at once (Pareto front): poses "
        f"{', '.join(map(str, summary.front.tolist()))}."
    )


def _region(summary: SweepSummary) -> str:
    region = summary.plan.criteria.region
    return "the part" if region == WHOLE_PART else f"region {region}"
