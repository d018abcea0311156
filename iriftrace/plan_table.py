"""The ranking of a sweep's poses as rows of text: the same in the terminal and in the report."""

from __future__ import annotations

from collections.abc import Sequence

from attrs import frozen

from iriftrace.errors import InputError
from iriftrace.resolution import FRONTAL
from iriftrace.sweep_summary import SweepSummary


@frozen
class RankingTable:
    """The best poses and their numbers.

    Attributes
    ----------
    headings, short_headings : tuple of str
        With units; the short ones fit into a terminal.
    rows : tuple of tuples of str
        The best pose first.
    note : str
        What a number in them means, a sentence; empty where there is nothing to say.
    """

    headings: tuple[str, ...]
    short_headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


def ranking_table(summary: SweepSummary, top: int) -> RankingTable:
    """Write down the best poses.

    Parameters
    ----------
    summary
        What is known of the sweep.
    top
        Number of rows, at least 1; fewer if fewer poses are ranked.

    Raises
    ------
    InputError
        If no row is wanted.
    """
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
    rows = [
        (
            ranks.get(pose, ""),
            str(pose),
            f"{summary.azimuth[pose]:.1f}",
            f"{summary.elevation[pose]:.1f}",
            *(one.values[pose] for one in summary.varied),
            f"{summary.score.values[pose]:.3f}" if pose in ranks else "",
            *(summary.value_text(quantity, pose) for quantity in summary.metrics),
        )
        for pose in poses
    ]
    short = (summary.plan.statistic, "cover", "axial", "lat.")
    return RankingTable(
        (
            *("rank", "pose", "azimuth (°)", "elevation (°)"),
            *(one.name for one in summary.varied),
            "score",
            *(quantity.label for quantity in summary.metrics),
        ),
        (
            *("rank", "pose", "az. °", "el. °"),
            *(one.short_name for one in summary.varied),
            "score",
            *(f"{name} {metric.unit}" for name, metric in zip(short, summary.metrics, strict=True)),
        ),
        tuple(rows),
        f"Axial resolution 0: {FRONTAL}." if any(map(summary.sees_frontally, poses)) else "",
    )


def stability_text(summary: SweepSummary) -> str:
    """How the best pose fares with other weights, one sentence."""
    from iriftrace.planning import stability

    varied = stability(summary.plan)
    rivals = len(varied.rivals)
    return (
        f"When one weight varies by +-50 %, the best pose ranks {varied.worst_rank} at worst; "
        f"when all do, {rivals} other {'pose' if rivals == 1 else 'poses'} can beat it."
    )


def alternative_text(summary: SweepSummary) -> str | None:
    """That the winner is not clear, one sentence; None if it is."""
    from iriftrace.plan_stability import close_alternative

    found = close_alternative(summary.plan)
    if found is None:
        return None
    return (
        f"The winner is not clear: pose {found.pose} scores only {found.behind:.3f} more and sees "
        f"{100 * found.coverage:.1f} % of the {_what(summary.plan.region)} instead of "
        f"{100 * found.best_coverage:.1f} %; choose by what has to be measured, change the "
        "weights or ask for a --min-coverage."
    )


def front_text(summary: SweepSummary) -> str:
    """The poses on the Pareto front, one sentence."""
    return (
        "Not beaten in displacement, coverage and resolution at once (Pareto front): poses "
        + ", ".join(map(str, summary.front.tolist()))
        + "."
    )


def _what(region: str) -> str:
    return "part" if region == "part" else f"region {region}"
