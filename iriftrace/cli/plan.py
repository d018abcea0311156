"""The command ``iriftrace plan``: the best camera poses of a sweep."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from attrs import frozen
from cyclopts import Group, Parameter

from iriftrace.cli.console import say
from iriftrace.cli.options import (
    Angle,
    Interval,
    LengthWithUnit,
    LightOf,
    Whole,
    check_input,
    check_output,
    refuse_given,
)
from iriftrace.cli.plan_pairs import print_pairs, print_refined_pair, search_progress
from iriftrace.cli.plan_tables import print_pose, print_table, setting_text
from iriftrace.cli.trace_options import check_light
from iriftrace.core.errors import InputError
from iriftrace.planning.criteria import STANDARD, Criteria

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.core.arrays import IntArray
    from iriftrace.planning.cover import ViewLimits, ViewSet
    from iriftrace.planning.refine import Refinement
    from iriftrace.planning.summary import SweepSummary
    from iriftrace.planning.texts import RankingTable


Ranking = Annotated[Criteria, Parameter(name="*", group=Group("Ranking", sort_key=1))]
"""Options of the ranking of poses: the same for plan, plot and report."""

REFINE = Group("Refinement", sort_key=3)
PAIRS = Group("Two devices", sort_key=5)
POSES = Group("Poses for other programs", sort_key=4)


@Parameter(name="*", group=Group("Several views", sort_key=2))
@frozen
class ViewOptions:
    """Several poses that together see more of the part than one.

    Parameters
    ----------
    views
        Number of poses that together see as much area as possible.
    max_displacement
        A pose does not see a face whose mean displacement is larger, with its unit: "20 um".
    max_incidence
        A pose does not see a face that its rays hit at a larger angle, in degrees.
    """

    views: Whole | None = None
    max_displacement: LengthWithUnit | None = None
    max_incidence: Angle | None = None

    def limits(self) -> ViewLimits:
        """Limits within which a pose sees a face; raises InputError for limits without views."""
        from iriftrace.planning.cover import ViewLimits

        largest, steepest = self.max_displacement, self.max_incidence
        given = {"--max-displacement": largest, "--max-incidence": steepest}
        _refuse_without("--views", self.views is not None, given)
        return ViewLimits(
            displacement_mm=math.inf if largest is None else largest,
            incidence_deg=90.0 if steepest is None else steepest,
        )


def plan(
    sweep: Path,
    *,
    ranking: Ranking = STANDARD,
    top: Whole = 10,
    wavelength: LightOf = None,
    several: ViewOptions = ViewOptions(),
    refine: Annotated[bool, Parameter(group=REFINE, negative=())] = False,
    evaluations: Annotated[Whole | None, Parameter(group=REFINE)] = None,
    output: Annotated[Path | None, Parameter(name=["-o", "--output"], group=REFINE)] = None,
    pairs: Annotated[bool, Parameter(group=PAIRS, negative=())] = False,
    confirm: Annotated[bool | None, Parameter(group=PAIRS)] = None,
    system: Annotated[Literal["fringe", "stereo", "laser"] | None, Parameter(group=PAIRS)] = None,
    angle: Annotated[Interval | None, Parameter(group=PAIRS)] = None,
    feature: Annotated[str | None, Parameter(group=PAIRS)] = None,
    save_poses: Annotated[Path | None, Parameter(group=POSES)] = None,
    convention: Annotated[
        Literal["opencv", "mitsuba", "opengl", "ros", "paper"] | None, Parameter(group=POSES)
    ] = None,
) -> None:
    """Rank the poses of a sweep by the combined metric and print the best one.

    With --criterion, rank by one error alone. With --views, also find the set of poses that
    together see the most of the part; with --refine, also the best pose near the best one of the
    sweep.

    Example: ``iriftrace plan sweep.nc --statistic median --region lateral``

    Parameters
    ----------
    sweep
        A file that ``iriftrace sweep`` wrote.
    top
        Number of rows of the ranking to print.
    refine
        Search around the best pose or pair, with position, distance and roll free; needs the
        scene's files.
    evaluations
        Maximum number of poses that the search renders, or pairs that it measures, 80 by default.
    output
        Write the refined pose or pair to this .json file.
    pairs
        Rank pairs of poses for two devices, such as a camera and a projector, by their predicted
        error, the area that both see, and the angle between them; the best three are
        measured (``iriftrace measure``), unless --no-confirm is given.
    confirm
        For pairs: measure the best three, which is the default.
    system
        Kind of the second device: a projector (fringe, by default), a camera (stereo) or a laser.
    angle
        Smallest and largest angle between two lines of sight in degrees, 15:45 by default.
    feature
        Also print the error of this diameter, "cylinder:lateral", and rank by the larger error.
    save_poses
        Write the poses of the printed ranking, best first, to this .csv, .json, .npy or .txt file.
    convention
        Camera axes in that file, opencv (x right, y down, z forward) by default.
    """
    from iriftrace.planning.pose_plan import plan as plan_poses
    from iriftrace.planning.refine import check_evaluations, write_refined
    from iriftrace.planning.texts import ranking_table
    from iriftrace.sweep.store import read_sweep

    _refuse_without("--save-poses", save_poses is not None, {"--convention": convention})
    _refuse_without("--refine", refine, {"--evaluations": evaluations, "--output": output})
    of_pairs = {"--system": system, "--angle": angle, "--feature": feature, "--confirm": confirm}
    _refuse_without("--pairs", pairs, of_pairs)
    limits = several.limits()
    check_output(output, "refined.json")
    check_input(sweep)
    dataset = read_sweep(sweep)
    check_light(wavelength, dataset.attrs, sweep)
    count = 80 if evaluations is None else evaluations
    if refine:
        check_evaluations(count)
    if pairs:
        refuse_given(
            {"--views": several.views, "--save-poses": save_poses},
            "is about single poses; leave it out, or --pairs.",
        )
        measured = confirm is not False
        pair_plan = print_pairs(dataset, ranking, system or "fringe", angle, feature, measured, top)
        if refine:
            print_refined_pair(dataset, pair_plan, count, output)
        return
    with search_progress(count) as progress:
        found = plan_poses(
            dataset,
            ranking,
            views=several.views,
            limits=limits,
            evaluations=count if refine else None,
            progress=progress,
        )
    summary = found.summary
    table = ranking_table(summary, top)
    if save_poses is not None:
        _save(save_poses, dataset, summary.plan.order[:top], convention or "opencv")
    # All errors have been raised by now, so that nothing is printed in vain.
    print_plan(summary, table)
    if found.views is not None:
        print_views(summary, found.views, limits)
    if found.refined is not None:
        print_refined(summary, found.refined)
        if output is not None:
            write_refined(output, found.refined, summary.plan, dataset)
            say(f"Refined pose in {output}")
    if save_poses is not None:
        say(f"Ranked poses in {save_poses}")


def _save(path: Path, dataset: xr.Dataset, ranked: IntArray, convention: str) -> None:
    from iriftrace.camera.pose_files import write_poses
    from iriftrace.camera.pose_set import PoseSet

    if not path.parent.is_dir():
        raise InputError(f"The folder {path.parent} does not exist; create it first.")
    chosen = dataset.isel(pose=ranked)
    poses = PoseSet(chosen["matrix"].values, chosen["azimuth"].values, chosen["elevation"].values)
    write_poses(path, poses, convention)


def _refuse_without(needed: str, there: bool, options: Mapping[str, object]) -> None:
    if not there:
        refuse_given(options, f"is given without {needed}, so it changes nothing; add it.")


def print_plan(summary: SweepSummary, ranking: RankingTable) -> None:
    """Print the ranking, its stability, and the best pose."""
    from iriftrace.planning.texts import (
        alternative_text,
        front_text,
        least_error_text,
        other_statistics_text,
        ranked_by,
        robust_text,
        stability_text,
        warned_text,
    )

    plan = summary.plan
    print_table(
        f"Best poses for region {plan.criteria.region} by {ranked_by(summary)}",
        ranking.short_headings,
        ranking.rows,
    )
    if ranking.note:
        say(ranking.note)
    if summary.devices:
        say(summary.devices)
    if plan.unranked:
        pose, reason = next(iter(plan.unranked.items()))
        count = len(plan.unranked)
        noun = "pose" if count == 1 else "poses, the first of them"
        say(f"Unranked: {count} {noun} {pose}: {reason}")
    for text in (
        warned_text,
        least_error_text,
        robust_text,
        stability_text,
        other_statistics_text,
        alternative_text,
        front_text,
    ):
        said = text(summary)
        if said:
            say(said)
    _print_swept("Best pose", summary, plan.best)


def _print_swept(kind: str, summary: SweepSummary, pose: int) -> None:
    name = f"{kind} {pose}{setting_text(summary, pose)}"
    print_pose(name, summary.matrices[pose], summary.distance[pose])


def print_views(summary: SweepSummary, views: ViewSet, limits: ViewLimits) -> None:
    """Poses that together see the most, the addition of each, and how good the choice is."""
    from iriftrace.planning.texts import views_table, views_text, views_title

    say(f"{views_title(summary, limits)}:")
    found = views_table(summary, views)
    print_table(None, found.short_headings, found.rows)
    say(views_text(summary, views))
    for pose in views.poses.tolist():
        _print_swept("Pose", summary, pose)


def print_refined(summary: SweepSummary, refined: Refinement) -> None:
    """Gain of a search around the best pose."""
    end = "ended by itself" if refined.converged else "ended with the evaluations"
    if refined.gain > 0:
        found = (
            f"found the score {refined.score:.4f} instead of {refined.start_score:.4f}, a gain of "
            f"{refined.gain:.4f}: turned by {refined.turn_deg:.2f} degrees, rolled by "
            f"{refined.roll_deg:.1f} degrees, distance {refined.distance_mm:.2f} instead of "
            f"{summary.distance[refined.start]:.2f} mm."
        )
    else:
        found = f"found nothing better than its score {refined.start_score:.4f}."
    say(f"The search around pose {refined.start} ({refined.evaluations} poses, {end}) {found}")
    rows = []
    for metric in summary.metrics:
        factor = {"µm": 1e3, "%": 100.0, "mm": 1.0}[metric.unit]
        values = (refined.start_metrics[metric.key], refined.metrics[metric.key])
        rows.append((metric.label, *(f"{factor * value:.4g}" for value in values)))
    print_table("Metrics", ("", "swept pose", "refined pose"), rows)
    name = f"Refined pose{setting_text(summary, refined.start)}"
    print_pose(name, refined.matrix, refined.distance_mm)
