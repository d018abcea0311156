"""Tables and sentences about a plan, for the terminal and for the report."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import BoolArray
from iriftrace.core.errors import InputError
from iriftrace.core.units import counted
from iriftrace.image.resolution import FRONTAL
from iriftrace.measuring.uncertainty.inputs import NOTHING_STATED, Inputs
from iriftrace.planning.candidates import ranked_error
from iriftrace.planning.cover import ViewSet
from iriftrace.planning.criteria import SHOWN, Views
from iriftrace.planning.quantities import PoseQuantity
from iriftrace.planning.stability import close_alternative, far_apart, stability
from iriftrace.planning.summary import STATISTICS, SweepSummary
from iriftrace.sweep.store import WHOLE_PART
from iriftrace.sweep.warned import FLAGS, Flag


@frozen
class RankingTable:
    """The best poses and their numbers, the best first."""

    headings: tuple[str, ...]  # with units
    short_headings: tuple[str, ...]  # fit into a terminal
    rows: tuple[tuple[str, ...], ...]
    note: str = ""  # meaning of numbers in the rows, in sentences


def ranking_table(summary: SweepSummary, top: int) -> RankingTable:
    """Build the table of the best poses, at most `top`, which is at least 1."""
    if top < 1:
        raise InputError(
            f"A ranking of {top} rows shows no pose; give at least 1.",
            code="ranking.below_one",
            argument="top",
        )
    return _table(summary, summary.plan.order[:top].tolist())


def front_table(summary: SweepSummary) -> RankingTable:
    """Build the table of the poses on the Pareto front, by rank; unranked ones come last."""
    front = set(summary.front.tolist())
    ranked = [pose for pose in summary.plan.order.tolist() if pose in front]
    return _table(summary, [*ranked, *sorted(front - set(ranked))])


def _table(summary: SweepSummary, poses: Sequence[int]) -> RankingTable:
    ranks = {pose: str(rank) for rank, pose in enumerate(summary.plan.order.tolist(), start=1)}
    flags = _flags_met(np.asarray(summary.warned[list(poses)].any(axis=0)))
    scores = [f"{summary.score.values[pose]:.3f}" if pose in ranks else "" for pose in poses]
    short = (ranked_error(summary.plan.criteria).short, "cover", "axial", "lat.")
    columns = [
        ("rank", "rank", [ranks.get(pose, "") for pose in poses]),
        ("pose", "pose", [str(pose) for pose in poses]),
        ("azimuth (°)", "az. °", [f"{summary.azimuth[pose]:.1f}" for pose in poses]),
        ("elevation (°)", "el. °", [f"{summary.elevation[pose]:.1f}" for pose in poses]),
        *((v.name, v.short_name, [v.values[pose] for pose in poses]) for v in summary.varied),
        ("score", "score", scores),
    ]
    for name, metric in zip(short, summary.metrics, strict=True):
        values = [summary.value_text(metric, pose) for pose in poses]
        columns.append((metric.label, f"{name} {metric.unit}", values))
    notes = []
    if any(map(summary.sees_frontally, poses)):
        notes.append(f"Axial resolution 0: {FRONTAL}.")
    if flags:
        met = [_flags_met(summary.warned[pose]) for pose in poses]
        columns.append(("warned", "warn", ["".join(flag.letter for flag in each) for each in met]))
        notes.append(f"Warned of: {', '.join(f'{flag.letter} {flag.text}' for flag in flags)}.")
    headings, short_headings, cells = zip(*columns, strict=True)
    return RankingTable(headings, short_headings, tuple(zip(*cells, strict=True)), " ".join(notes))


def _flags_met(given: BoolArray) -> list[Flag]:
    return [flag for flag, met in zip(FLAGS, given.tolist(), strict=True) if met]


def ranked_by(summary: SweepSummary) -> str:
    """Names of the metrics that have a weight, for sentences."""
    needed = summary.plan.criteria.needed
    return ", ".join(in_words(metric) for metric in summary.metrics if metric.key in needed)


def in_words(metric: PoseQuantity) -> str:
    """Name of a metric for the middle of a sentence."""
    return f"{metric.title[0].lower()}{metric.title[1:]}"


def of_means(summary: SweepSummary) -> str:
    """What the limits of the normalisation are of where a scatter is added; empty elsewhere."""
    return " of the means over the members" if summary.plan.criteria.robust else ""


def percentile_text(summary: SweepSummary) -> str:
    """The upper limit of the normalisation, in words."""
    return f"{summary.plan.criteria.percentile:g}th percentile{of_means(summary)}"


def least_error_text(summary: SweepSummary) -> str | None:
    """The pose of the least error if another is the best, one sentence; None if it is."""
    plan = summary.plan
    least = int(plan.order[np.argmin(plan.metrics["displacement"][plan.order])])
    if least == plan.best:
        return None
    error, seen = (
        [quantity.values[pose] for pose in (least, plan.best)]
        for quantity in (summary.displacement, summary.coverage)
    )
    return (
        f"Pose {least} has the least {in_words(summary.displacement)}, {error[0]:.4g} "
        f"{summary.displacement.unit} instead of {error[1]:.4g}, and sees {seen[0]:.3g} % of "
        f"{_region(summary)} instead of {seen[1]:.3g} % (the criterion "
        f"{plan.criteria.criterion} ranks by the error alone)."
    )


def stability_text(summary: SweepSummary) -> str | None:
    """Ranks of the best pose with other weights, one sentence; None for a single weight."""
    if len(summary.plan.criteria.needed) == 1:
        return None
    varied = stability(summary.plan)
    rivals = len(varied.rivals)
    return (
        f"When one weight varies by +-50 %, the best pose ranks {varied.worst_rank} at worst; "
        f"when all do, {counted(rivals, 'other pose')} can beat it."
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
        f"{summary.plan.best} is the best, {' and '.join(others)}."
    )


def robust_text(summary: SweepSummary) -> str | None:
    """Poses with the least and the most scatter, one sentence; None for one field."""
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
        f"{added}."
    )


def indistinct_text(summary: SweepSummary, inputs: Inputs = NOTHING_STATED) -> str | None:
    """Ranked poses that do not differ from the best by more than its U, one sentence.

    U is twice the root of the sum of squares of the members' scatter and of the stated fractions of
    the ranked error. None where neither is known. Raises InputError for other inputs, whose effect
    a sweep does not have.
    """
    if others := set(inputs.stated()) - {"air", "mesh", "numerics"}:
        raise InputError(
            f"A sweep does not have the effect of {', '.join(sorted(others))}; state air, mesh and "
            "numerics, which scale the whole error, and make a budget of the best pose for the "
            "rest.",
            code="uncertainty.not_in_plans",
            argument="uncertainty",
        )
    plan, best = summary.plan, summary.plan.best
    error = plan.metrics["displacement"]
    scatter = np.zeros(len(error))
    if summary.scatter is not None:
        scatter = 1e-3 * np.nan_to_num(summary.scatter.values)
        error = error - (plan.criteria.robust or 0.0) * scatter
    expanded = 2.0 * math.hypot(scatter[best], inputs.relative * error[best])
    if not expanded > 0.0:
        return None
    alike = [pose for pose in plan.order[1:] if abs(error[pose] - error[best]) <= expanded]
    u = f"U of its {ranked_error(plan.criteria).name} ({1e3 * expanded:.2g} um, k = 2)"
    if not alike:
        return f"Every other ranked pose differs from pose {best} by more than the {u}."
    named = [str(pose) for pose in alike[:SHOWN]]
    if len(alike) > SHOWN:
        named.append(f"{len(alike) - SHOWN} more")
    if len(named) == 1:
        return f"Pose {named[0]} does not differ from pose {best} by more than the {u}."
    listed = f"{', '.join(named[:-1])} and {named[-1]}"
    return f"Poses {listed} do not differ from pose {best} by more than the {u}."


def warned_text(summary: SweepSummary) -> str | None:
    """Warnings of the best pose, one sentence; None if there are none."""
    found = [flag.text for flag in _flags_met(summary.warned[summary.plan.best])]
    return f"The sweep warns of the best pose: {'; '.join(found)}." if found else None


def alternative_text(summary: SweepSummary) -> str | None:
    """Sentence if the winner is not clear, or sees little; None if neither."""
    plan = summary.plan
    pose, best = close_alternative(plan), plan.best
    coverage = plan.metrics["coverage"]
    if pose is not None:
        return (
            f"The winner is not clear: pose {pose} scores only "
            f"{plan.score[pose] - plan.score[best]:.3f} more and sees {100 * coverage[pose]:.1f} % "
            f"of {_region(summary)} instead of {100 * coverage[best]:.1f} %; choose by what has to "
            "be measured, change the weights or require more coverage."
        )
    most = coverage[plan.order].max()
    if not far_apart(coverage[best], most):
        return None
    return (
        f"The best pose sees {100 * coverage[best]:.1f} % of {_region(summary)}, another one "
        f"{100 * most:.1f} %; require more coverage if that has to be seen."
    )


def views_table(summary: SweepSummary, views: ViewSet) -> RankingTable:
    """Build the table of poses that together see the most, with the addition of each."""
    fractions = 100.0 * np.column_stack((views.added, np.cumsum(views.added)))
    rows = tuple(
        (
            str(number),
            str(pose),
            f"{summary.azimuth[pose]:.1f}",
            f"{summary.elevation[pose]:.1f}",
            *(f"{fraction:.2f}" for fraction in fractions[number - 1]),
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
    they = "they see" if summary.devices is None else "their cameras (not both devices) see"
    return (
        f"Together {they} {100 * views.covered:.2f} % of the area of {_region(summary)}, of "
        f"{100 * views.coverable:.2f} % that all poses together see; {proof}"
    )


def views_title(summary: SweepSummary, views: Views) -> str:
    """Title of `views_table`, half a sentence."""
    return f"Poses that together see the most of {_region(summary)}{views.text}"


def front_text(summary: SweepSummary) -> str:
    """The poses on the Pareto front, one sentence."""
    error = "displacement" if summary.of_camera else "error"
    return (
        f"Not beaten in {error}, coverage and resolution at once (Pareto front): poses "
        f"{', '.join(map(str, summary.front.tolist()))}."
    )


def _region(summary: SweepSummary) -> str:
    """Name of the ranked region, for sentences."""
    region = summary.plan.criteria.region
    return "the part" if region == WHOLE_PART else f"region {region}"
