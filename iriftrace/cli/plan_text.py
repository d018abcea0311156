"""Everything that ``iriftrace plan`` prints: rankings, poses, pairs of poses, refined ones."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from iriftrace.cli.console import late_bar, print_table, say
from iriftrace.core.units import counted
from iriftrace.figures.describe import devices_at, placed

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.camera.pose import PoseText
    from iriftrace.core.arrays import FloatArray
    from iriftrace.planning.cover import ViewSet
    from iriftrace.planning.criteria import Views
    from iriftrace.planning.pairs import PairPlan
    from iriftrace.planning.refine import PairRefinement, Refinement
    from iriftrace.planning.summary import SweepSummary
    from iriftrace.planning.texts import RankingTable
    from iriftrace.tracing.second_options import System


def print_plan(summary: SweepSummary, ranking: RankingTable, indistinct: str | None = None) -> None:
    """Print the ranking, its stability, which poses are as good, and the best one."""
    from iriftrace.planning import texts

    plan = summary.plan
    title = f"Best poses for region {plan.criteria.region} by {texts.ranked_by(summary)}"
    print_table(title, ranking.short_headings, ranking.rows)
    unranked = None
    if plan.unranked:
        pose, reason = next(iter(plan.unranked.items()))
        count = len(plan.unranked)
        noun = "pose" if count == 1 else "poses, the first of them"
        unranked = f"Unranked: {count} {noun} {pose}: {reason}"
    for sentence in (
        ranking.note,
        summary.devices,
        unranked,
        texts.warned_text(summary),
        texts.least_error_text(summary),
        texts.robust_text(summary),
        indistinct,
        texts.stability_text(summary),
        texts.other_statistics_text(summary),
        texts.alternative_text(summary),
        texts.front_text(summary),
    ):
        if sentence:
            say(sentence)
    _print_swept("Best pose", summary, plan.best)


def _print_swept(kind: str, summary: SweepSummary, pose: int) -> None:
    name = f"{kind} {pose}{summary.setting(pose)}"
    _print_devices(devices_at(summary, name, summary.matrices[pose], summary.distance[pose]))


def _print_devices(devices: Iterable[tuple[PoseText, str, str]]) -> None:
    """Print poses as matrix, as look-at and as XML."""
    for text, title, in_file in devices:
        say(f"{title}:")
        for row in text.matrix:
            say(f"  {row}")
        say(f"Look-at: {text.look_at}")
        say(f"{in_file}:")
        for line in text.xml:
            say(f"  {line}")


def print_views(summary: SweepSummary, views: ViewSet, wanted: Views) -> None:
    """Poses that together see the most, the addition of each, and how good the choice is."""
    from iriftrace.planning.texts import views_table, views_text, views_title

    say(f"{views_title(summary, wanted)}:")
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
    print_table("Metrics", ("", "swept pose", "refined pose"), rows, texts=[""])
    name = f"Refined pose{summary.setting(refined.start)}"
    _print_devices(devices_at(summary, name, refined.matrix, refined.distance_mm))


def print_pairs(dataset: xr.Dataset, found: PairPlan, top: int) -> None:
    """Print the best pairs of poses, and both poses of the best one."""
    pairing, criteria = found.pairing, found.criteria
    error, bias = f"|e| {criteria.statistic}", "diameter" if pairing.feature else "median e"
    exact = [f"{1e3 * value:.3g}" for value in found.exact_mm]
    print_table(
        f"Best of {counted(len(found.pairs), 'pair')} ({pairing.system}) for "
        f"{pairing.feature or criteria.region}: errors in um, e along the normal",
        ("poses", "score", error, bias, "both see", "angle", "measured"),
        (
            (
                f"{one}, {other}",
                f"{found.score[row]:.3f}",
                f"{1e3 * found.error_mm[row]:.3g}",
                f"{1e3 * found.bias_mm[row]:.3g}",
                f"{100 * found.coverage[row]:.1f} %",
                f"{found.angle_deg[row]:.1f} deg",
                *exact[row : row + 1],
            )
            for row, (one, other) in enumerate(found.pairs[:top])
        ),
    )
    if exact:
        what = "the diameter" if pairing.feature else error
        say(f"Measured is {what} by the exact solver, {_THROUGH[found.exact_engine]}.")
    if "scatter_p95" in dataset:
        say(
            "All errors are means over the ensemble's members, without their scatter, which "
            "iriftrace measure states for a pair."
        )
    names = [f"{what}, pose {pose}" for what, pose in zip(_DEVICES, found.pairs[0], strict=True)]
    chosen = dataset.isel(pose=found.pairs[0])
    _print_pair(names, chosen["matrix"].values, chosen["distance"].values, pairing.system)


_DEVICES = ("Camera", "Second device")

_THROUGH = {
    "shells": "through the shells",
    "cells": "through the field data",
    "cells and shells": "through the shells, of pairs for which these are too coarse through the "
    "field data",
}


def _print_pair(
    names: Iterable[str], matrices: FloatArray, distances_mm: FloatArray, system: System
) -> None:
    """Print both poses of a pair, and how to simulate their measurement."""
    from iriftrace.tracing.second_options import DEVICE_OF_SYSTEM

    sensors = ("the first sensor", f'the second sensor (id="{DEVICE_OF_SYSTEM[system]}")')
    _print_devices(map(placed, names, matrices, distances_mm, sensors))
    say("With both sensors in the scene file, iriftrace measure simulates their measurement.")


def print_refined_pair(plan: PairPlan, found: PairRefinement) -> None:
    """Gain of a search around the best pair."""
    one, other = plan.pairs[0].tolist()
    end = "ended by itself" if found.converged else "ended with the evaluations"
    say(
        f"The search around poses {one} and {other} ({found.evaluations} pairs measured, {end}): "
        f"score {found.best.score:.4f} instead of {found.start.score:.4f}."
    )
    values = (found.start, found.best)
    statistic = f"|e| {plan.criteria.statistic} (um)"
    bias = "diameter (um)" if plan.pairing.feature else "median e (um)"
    print_table(
        "What they measure",
        ("", "swept pair", "refined pair"),
        (
            (statistic, *(f"{1e3 * value.error_mm:.3g}" for value in values)),
            (bias, *(f"{1e3 * value.bias_mm:.3g}" for value in values)),
            ("both see", *(f"{100 * value.coverage:.1f} %" for value in values)),
            ("angle", *(f"{value.angle_deg:.1f} deg" for value in values)),
        ),
        texts=[""],
    )
    names = [f"Refined {what.lower()}" for what in _DEVICES]
    _print_pair(names, found.best.matrices, found.best.distances_mm, plan.pairing.system)


@contextmanager
def search_progress(evaluations: int) -> Iterator[Callable[[int, float], None]]:
    """Progress of a search, for the terminal."""
    from rich.progress import BarColumn, MofNCompleteColumn

    columns = "Refining, best score {task.fields[score]:.4f}", BarColumn(), MofNCompleteColumn()
    with late_bar(*columns, transient=True) as show:
        yield lambda done, score: show(done, evaluations, score=score)
