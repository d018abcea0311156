"""What ``iriftrace plan`` prints: ranking, best pose, sets of views, a refined pose."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from iriftrace.plan_table import RankingTable, alternative_text, front_text, stability_text
from iriftrace.pose_text import pose_text
from iriftrace.sweep_varied import setting_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from iriftrace.refine import Refinement
    from iriftrace.sweep_summary import SweepSummary
    from iriftrace.view_cover import ViewSet
    from iriftrace.view_plan import ViewLimits


def print_plan(console: Console, summary: SweepSummary, ranking: RankingTable) -> None:
    """The ranking, how sure it is, and the best pose."""
    plan = summary.plan
    table = _table(
        f"Best poses for region {plan.region}: displacement, coverage, resolution",
        ranking.short_headings,
    )
    for row in ranking.rows:
        table.add_row(*row)
    console.print(table)
    if ranking.note:
        _say(console, ranking.note)
    if plan.unranked:
        pose, reason = next(iter(plan.unranked.items()))
        count = len(plan.unranked)
        noun = "pose" if count == 1 else "poses, the first of them"
        _say(console, f"Unranked: {count} {noun} {pose}: {reason}")
    _say(console, stability_text(summary))
    unclear = alternative_text(summary)
    if unclear:
        _say(console, unclear)
    _say(console, front_text(summary))
    _print_swept(console, "Best pose", summary, plan.best)


def _print_swept(console: Console, kind: str, summary: SweepSummary, pose: int) -> None:
    setting = setting_of(summary.varied, pose)
    name = f"{kind} {pose}{f' ({setting})' if setting else ''}"
    print_pose(console, name, summary.matrices[pose], summary.distance[pose])


def print_pose(console: Console, name: str, matrix: ArrayLike, distance_mm: float) -> None:
    """A pose as matrix, as look-at and as XML."""
    text = pose_text(matrix, distance_mm)
    _say(console, f"{name}, camera to world (x right, y down, z forward; mm):")
    for row in text.matrix:
        _say(console, f"  {row}")
    _say(console, f"Look-at: {text.look_at}")
    _say(console, "In the scene file, inside the sensor:")
    for line in text.xml:
        _say(console, f"  {line}")


def print_views(
    console: Console, summary: SweepSummary, views: ViewSet, limits: ViewLimits
) -> None:
    """Poses that together see the most, what each adds, and how good the choice is."""
    region = summary.plan.region
    what = "the part" if region == "part" else f"region {region}"
    _say(
        console,
        f"Poses that together see the most of {what}; a face counts that is seen {limits.text}:",
    )
    table = _table(
        None,
        ("view", "pose", "azim. °", "elev. °", "adds %", "together %"),
    )
    together = 0.0
    for number, (pose, added) in enumerate(
        zip(views.poses.tolist(), views.added.tolist(), strict=True), start=1
    ):
        together += added
        table.add_row(
            str(number),
            str(pose),
            f"{summary.azimuth[pose]:.1f}",
            f"{summary.elevation[pose]:.1f}",
            f"{100 * added:.2f}",
            f"{100 * together:.2f}",
        )
    console.print(table)
    proof = (
        "no other choice of as many poses sees more (exact)."
        if views.exact
        else f"another choice might see up to {100 * views.gap:.2f} % of its area more (gap)."
    )
    _say(
        console,
        f"Together they see {100 * views.covered:.2f} % of the area of {what}, of "
        f"{100 * views.coverable:.2f} % that all poses see within the limits; {proof}",
    )
    for pose in views.poses.tolist():
        _print_swept(console, "Pose", summary, pose)


def print_refined(console: Console, summary: SweepSummary, refined: Refinement) -> None:
    """What a search around the best pose gained."""
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
    _say(
        console,
        f"The search around pose {refined.start} ({refined.evaluations} poses, {end}) {found}",
    )
    table = _table("Metrics", ("", "swept pose", "refined pose"))
    for quantity in summary.metrics:
        factor = {"µm": 1e3, "%": 100.0, "mm": 1.0}[quantity.unit]
        values = (refined.start_metrics[quantity.key], refined.metrics[quantity.key])
        table.add_row(quantity.label, *(f"{factor * value:.4g}" for value in values))
    console.print(table)
    setting = setting_of(summary.varied, refined.start)
    name = f"Refined pose ({setting})" if setting else "Refined pose"
    print_pose(console, name, refined.matrix, refined.distance_mm)


def _table(title: str | None, headings: tuple[str, ...]) -> Table:
    # Without rules between the columns, so that numbers are not cut in a terminal 80 wide.
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 0, 0, 1))
    for heading in headings:
        table.add_column(heading, justify="right" if heading else "left")
    return table


def _say(console: Console, text: str) -> None:
    console.print(text, markup=False, soft_wrap=True)
