"""From a case to its field: write, mesh, solve, read; finished steps are skipped."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pyvista as pv
from attrs import frozen

from iriftrace.core.arrays import as_float64
from iriftrace.core.errors import SetupError
from iriftrace.core.files import write_whole
from iriftrace.flow.simulate.case import RECORD, UNFINISHED, Case, is_stored
from iriftrace.flow.simulate.case_files import write_case
from iriftrace.flow.simulate.mesh import make_mesh
from iriftrace.flow.simulate.programs import REPAIR, Installation
from iriftrace.flow.simulate.result import write_mean, write_snapshots
from iriftrace.flow.simulate.run import (
    Cost,
    State,
    Steadiness,
    cost_of,
    expected_seconds,
    judge_steadiness,
    last_time,
    solve,
)
from iriftrace.flow.simulate.solver_check import try_solver
from iriftrace.medium.wall import inner_wall
from iriftrace.part.wall_temperature import wall_temperature


@frozen
class Simulation:
    """Result of a simulation."""

    field: Path  # the file with the mean field
    snapshots: tuple[Path, ...]  # single states; ``<field>_snapshots.pvd`` lists them
    cells: int
    averaged: float  # seconds over which the density was averaged
    steadiness: Steadiness | None  # over that time; None if unknown
    wall_error_k: float  # largest difference of the field at the wall from the requested one
    seconds: float  # clock time of mesh and solver in this call
    all_seconds: float = 0.0  # in all calls for this case, including interrupted ones


@frozen
class Display:
    """Callbacks during a run: `expect` gets the cost of the solver before it starts."""

    say: Callable[[str], None] = lambda text: None
    expect: Callable[[Cost], None] = lambda cost: None
    watch: Callable[[State], None] = lambda state: None


def prepare(case: Case, folder: Path) -> bool:
    """Write the case unless the folder holds it; True if so, InputError if it holds another one."""
    if is_stored(case, folder):
        return True
    folder.mkdir(parents=True, exist_ok=True)
    unfinished = folder / UNFINISHED
    unfinished.touch()
    write_case(case, folder)
    write_whole(folder / RECORD, json.dumps(case.record(), indent=1) + "\n")
    unfinished.unlink()
    return False


def simulate(
    case: Case,
    folder: Path,
    file: Path,
    installation: Installation,
    display: Display,
    like: Path | None = None,
) -> Simulation:
    """Run a case that was `prepare`d in a folder and write its field to a .vtu.

    `like` is the folder of a case whose mesh is reused. Raises SetupError if the solver gives wrong
    results on this machine, or stopped.
    """
    check_solver(installation)
    begun = time.monotonic()
    with _clock(folder) as all_seconds:
        cells = make_mesh(case, folder, installation, display.say, like)
        since = last_time(folder)
        seconds = expected_seconds(case, cells, since)
        display.expect(cost_of(case, cells, seconds, continued=since > 0.0))
        display.say(f"Solver: {cells:,} cells")
        averaged = solve(case, folder, installation, display.watch)
    seconds = time.monotonic() - begun
    display.say("Writing the field")
    end = case.times.end
    steadiness = judge_steadiness(case, folder, (end - averaged, end))
    grid = write_mean(case, folder, file, averaged, steadiness)
    files: list[Path] = []
    if case.times.snapshots:
        listed = file.with_name(f"{file.stem}_snapshots.pvd")
        files = write_snapshots(case, folder, listed, averaged)
    return Simulation(
        field=file,
        snapshots=tuple(files),
        cells=cells,
        averaged=averaged,
        steadiness=steadiness,
        wall_error_k=_wall_error(case, grid),
        seconds=seconds,
        all_seconds=all_seconds(),
    )


@contextmanager
def _clock(folder: Path) -> Iterator[Callable[[], float]]:
    """Sum the clock time of all runs of a case in a file of its folder."""
    file, begun = folder / "seconds", time.monotonic()

    def counted() -> float:
        try:
            return float(file.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return 0.0

    try:
        yield counted
    finally:
        file.write_text(f"{counted() + time.monotonic() - begun:.1f}\n")


def check_solver(installation: Installation) -> None:
    """Refuse a solver that computes wrong results, with a SetupError."""
    if verdict := try_solver(installation):
        raise SetupError(
            f"{installation.solver} computes wrong ({verdict}), as Debian 12's miscompiled package "
            f"does; {REPAIR}.",
            code="openfoam.computes_wrong",
        )


def _wall_error(case: Case, grid: pv.UnstructuredGrid) -> float:
    """Largest difference at the wall, where a transition of less than a cell does not count."""
    wall = inner_wall(grid)
    if not wall.n_points:
        return float("nan")
    points = as_float64(wall.points)
    # Without those of other bodies, whose temperatures mix with the part's where they touch.
    own = case.part.surface.distance(points) < 0.5 * case.size.wall
    for body in case.bodies:
        own &= body.surface.surface.distance(points) > 2.0 * case.size.wall
    if not own.any():
        return float("nan")
    points = points[own]
    requested = wall_temperature(case.wall, case.part, points)
    return float(np.abs(as_float64(wall["T"])[own] - requested).max())
