"""``iriftrace plan --pairs``: pairs of poses for two devices."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from iriftrace.cli.console import late_bar, say, working
from iriftrace.cli.plan_tables import print_pose, print_table
from iriftrace.planning.criteria import Criteria

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.core.arrays import FloatArray
    from iriftrace.planning.pairs import PairPlan
    from iriftrace.triangulation.devices import System


def print_pairs(
    dataset: xr.Dataset,
    criteria: Criteria,
    system: Literal["fringe", "stereo", "laser"],
    angles_deg: tuple[float, float] | None,
    feature: str | None,
    confirm: bool,
    top: int,
) -> PairPlan:
    """Rank pairs of poses and print them."""
    from iriftrace.planning.pairs import ANGLES_DEG, plan_pairs

    with working("Ranking pairs of poses"):
        found = plan_pairs(
            dataset,
            criteria,
            system=system,
            angles_deg=angles_deg or ANGLES_DEG,
            feature=feature,
            confirm=confirm,
        )
    error, bias = f"|e| {criteria.statistic}", "diameter" if feature else "median e"
    exact = [f"{1e3 * value:.3g}" for value in found.exact_mm]
    print_table(
        f"Best of {len(found.pairs)} pairs ({system}) for {feature or criteria.region}: errors in "
        "um, e along the normal",
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
        what = "the diameter" if feature else error
        through = "the field data" if found.exact_engine == "cells" else "the shells"
        say(f"Measured is {what} by the exact solver, through {through}.")
    names = [f"{what}, pose {pose}" for what, pose in zip(_DEVICES, found.pairs[0], strict=True)]
    chosen = dataset.isel(pose=found.pairs[0])
    _print_pair(names, chosen["matrix"].values, chosen["distance"].values, system)
    return found


_DEVICES = ("Camera", "Second device")


def _print_pair(
    names: Iterable[str], matrices: FloatArray, distances_mm: FloatArray, system: System
) -> None:
    """Print both poses of a pair, and how to simulate their measurement."""
    from iriftrace.triangulation.devices import DEVICE_OF_SYSTEM

    sensors = ("the first sensor", f'the second sensor (id="{DEVICE_OF_SYSTEM[system]}")')
    for name, matrix, distance, sensor in zip(names, matrices, distances_mm, sensors, strict=True):
        print_pose(name, matrix, float(distance), sensor)
    say("With both sensors in the scene file, iriftrace measure simulates their measurement.")


def print_refined_pair(
    dataset: xr.Dataset, plan: PairPlan, evaluations: int, output: Path | None
) -> None:
    """Search around the best pair and print the result."""
    from iriftrace.planning.refine_pair import refine_pair, write_refined_pair

    with search_progress(evaluations) as progress:
        found = refine_pair(dataset, plan, evaluations=evaluations, progress=progress)
    one, other = plan.pairs[0].tolist()
    end = "ended by itself" if found.converged else "ended with the evaluations"
    say(
        f"The search around poses {one} and {other} ({found.evaluations} pairs measured, {end}): "
        f"score {found.best.score:.4f} instead of {found.start.score:.4f}."
    )
    values = (found.start, found.best)
    statistic = f"|e| {plan.criteria.statistic} (um)"
    bias = "diameter (um)" if plan.feature else "median e (um)"
    print_table(
        "What they measure",
        ("", "swept pair", "refined pair"),
        (
            (statistic, *(f"{1e3 * value.error_mm:.3g}" for value in values)),
            (bias, *(f"{1e3 * value.bias_mm:.3g}" for value in values)),
            ("both see", *(f"{100 * value.coverage:.1f} %" for value in values)),
            ("angle", *(f"{value.angle_deg:.1f} deg" for value in values)),
        ),
    )
    names = [f"Refined {what.lower()}" for what in _DEVICES]
    _print_pair(names, found.best.matrices, found.best.distances_mm, plan.system)
    if output is not None:
        write_refined_pair(output, found, plan, dataset)
        say(f"Refined pair in {output}")


@contextmanager
def search_progress(evaluations: int) -> Iterator[Callable[[int, float], None]]:
    """Progress of a search, for the terminal."""
    from rich.progress import BarColumn, MofNCompleteColumn

    columns = "Refining, best score {task.fields[score]:.4f}", BarColumn(), MofNCompleteColumn()
    with late_bar(*columns, transient=True) as show:
        yield lambda done, score: show(done, evaluations, score=score)
