"""Run the solver of a meshed case to its end; interrupted runs can be continued."""

from __future__ import annotations

import json
import math
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from attrs import evolve, frozen
from scipy.constants import g

from iriftrace.core.errors import InputError, warn
from iriftrace.core.files import write_whole
from iriftrace.flow.simulate.case import Case, read_record
from iriftrace.flow.simulate.case_files import (
    AVERAGED,
    COURANT,
    START_FILES,
    write_control,
    write_decomposition,
)
from iriftrace.flow.simulate.domain import coarsest_useful
from iriftrace.flow.simulate.programs import (
    SOLVER,
    Installation,
    OpenFoamError,
    read_heat,
    read_plume,
    run_program,
    step_times,
    tail,
)
from iriftrace.io.openfoam import processor_folders, time_folders

STEADY_HEAT, STEADY_PLUME = 0.02, 0.01
"""Largest relative variation of the heat flow, and of the plume over the heating, if steady."""
SECONDS_A_STEP = 8e-6
"""Seconds of a core for a step of one cell."""
LONG, AIM = 900.0, 600.0
"""Clock time, s, above which a coarser mesh is proposed, and what that takes."""
_LEAST_GROWTH = 1.1
"""Growth of cells that saves a quarter of the time."""

_AVERAGED = "averaging.json"
_OF_MEANS = "uniform/functionObjects"


@frozen
class Steadiness:
    """Mean heat flow from the whole part, its range over the mean, and that of the plume.

    The plume's swing is at the point where it varies most. The flow is steady if both are small.
    """

    heat_w: float
    heat_variation: float
    plume_swing_k: float
    steady: bool

    @property
    def text(self) -> str:
        """Description for results and for the field's origin."""
        state = "steady" if self.steady else "NOT STEADY"
        return (
            f"{state} (heat flow varies by {self.heat_variation:.1%}, plume by "
            f"{self.plume_swing_k:.0f} K)"
        )


def judge_steadiness(case: Case, folder: Path, window: tuple[float, float]) -> Steadiness | None:
    """Evaluate heat flow and plume between two times; None if there are too few steps."""
    start, end = window[0], window[1] * (1.0 + 1e-9)
    series = (read_heat(folder), read_plume(folder))
    heat, plume = (rows[(rows[:, 0] >= start) & (rows[:, 0] <= end)] for rows in series)
    if len(heat) < 3 or len(plume) < 3:
        return None
    watts = heat[:, 1] * 2 ** len(case.mirrors)
    mean = float(watts.mean())
    variation = float(np.ptp(watts)) / abs(mean) if mean else np.inf
    swing = float(np.ptp(plume[:, 1:], axis=0).max())
    heating = case.wall.hottest - case.options.ambient
    return Steadiness(
        heat_w=mean,
        heat_variation=variation,
        plume_swing_k=swing,
        steady=variation <= STEADY_HEAT and swing <= STEADY_PLUME * heating,
    )


@frozen
class State:
    """Progress of a run, for a display."""

    time: float  # physical time, s
    end: float
    left: float | None  # seconds of clock time; None if not known yet
    steadiness: Steadiness | None  # of heat and plume lately; None at the beginning
    stored: float  # physical time from which a later call continues, s


@frozen
class Cost:
    """Size of a mesh, and the estimated clock time, s, of all solvers that use it."""

    background: float  # edge of the largest cells, mm
    cells: int
    seconds: float
    coarser: Cost | None = None  # of the mesh that takes `AIM`, or of the coarsest useful one


def cost_of(case: Case, cells: int, seconds: float, *, continued: bool = False) -> Cost:
    """Cost of a mesh, and of a coarser one if it takes `LONG`, unless the run is `continued`.

    The cells are taken to lie on surfaces, so that their number falls with the square of their
    size, and the number of steps with the size. Those in the volume fall faster: with background
    cells of 32, 36 and 45 mm a ring with a draught, a body and a floor has 95,112, 72,079 and
    46,958 cells.
    """
    own = case.size.background
    cost = Cost(own, cells, seconds)
    if seconds <= LONG or continued:
        return cost
    useful = coarsest_useful(np.ptp(case.part.bounds, axis=0))
    background = float(math.floor(min(own * (AIM / seconds) ** (-1.0 / 3.0), useful)))
    growth = background / own
    if growth < _LEAST_GROWTH:
        return cost
    return evolve(cost, coarser=Cost(background, round(cells / growth**2), seconds / growth**3))


def expected_seconds(case: Case, cells: int, since: float = 0.0) -> float:
    """Estimated clock time, s, of the solver from the physical time `since`, s.

    A step lasts until the fastest air has crossed `COURANT` of the wall's cells. Air that is
    lighter by dT / T rises a height L at sqrt(g L dT / T); L is that of the air that the field
    keeps above the part. A draught blows across that. On one core a cell's step took 4 us on a mesh
    of 29,000 cells and 9 us on one of 93,000; with these speeds the estimate is accurate to a
    factor of 1.7.
    """
    height = 1e-3 * (case.domain.kept_upper[2] - float(case.part.bounds[1][2]))
    lighter = 1.0 - case.options.ambient / case.wall.hottest
    across = 0.0 if case.draught is None else case.draught.speed
    speed = math.hypot(math.sqrt(g * height * lighter), across)
    steps = (case.times.end - since) * speed / (COURANT * 1e-3 * case.size.wall)
    return SECONDS_A_STEP * cells * steps / case.options.processes


def solve(
    case: Case, folder: Path, installation: Installation, watch: Callable[[State], None]
) -> float:
    """Run until the flow has settled, then average the density to the end; returns the seconds.

    Raises OpenFoamError if the solver stopped; InputError if an earlier run does not fit. Warns of
    an average that is shorter than requested, as an earlier run came past its beginning.
    """
    times = case.times
    pieces = _prepared(case, folder, installation)
    started = last_time(folder)
    if started < times.settled * (1.0 - 1e-9):
        (folder / _AVERAGED).unlink(missing_ok=True)
        write_control(case, folder, averaging=False, start=started)
        _run_solver(case, folder, installation, watch, times.settled)
        started = last_time(folder)
    since = _averaging_since(folder, pieces, started, case)
    if _late(case, since):
        warn(
            f"The run in {folder} had already come to {since:g} s, so the density is averaged over "
            f"the last {times.end - since:.3g} s, not {times.averaging:g} s; {_later(case, since)}."
        )
    if started < times.end * (1.0 - 1e-9):
        lately = judge_steadiness(case, folder, (started - times.averaging, started))
        steady = lately is not None and lately.steady
        write_control(case, folder, averaging=True, start=started, steady=steady)
        _run_solver(case, folder, installation, watch, times.end)
    return times.end - since if _late(case, since) else times.averaging


def last_time(folder: Path) -> float:
    """Last time that is complete on disk for all pieces of a case; 0 at the beginning."""
    record = folder / _AVERAGED
    since = float(read_record(record)["since"]) if record.is_file() else math.inf
    whole = [
        {t for t, f in time_folders(piece).items() if _whole(f, averaged=t > since)}
        for piece in pieces_of(folder)
    ]
    return max(set.intersection(*whole), default=0.0)


def pieces_of(folder: Path) -> list[Path]:
    """The folders of the processors, or the case's own if it was not decomposed."""
    return processor_folders(folder) or [folder]


def _prepared(case: Case, folder: Path, installation: Installation) -> list[Path]:
    pieces = pieces_of(folder)
    apart = pieces != [folder]
    if case.options.processes > 1 and not apart:
        if last_time(folder) > 0.0:
            raise InputError(
                f"the run in {folder} was started with one process; continue with one, or delete "
                "the folder.",
                code="case.other_processes",
                argument="processes",
            )
        write_decomposition(folder, case.options.processes)
        run_program(installation, folder, "decomposePar", "-force")
        return pieces_of(folder)
    if apart and len(pieces) != case.options.processes:
        raise InputError(
            f"the run in {folder} was started with {len(pieces)} processes; continue with as "
            "many, or delete the folder.",
            code="case.other_processes",
            argument="processes",
        )
    return pieces


def _run_solver(
    case: Case, folder: Path, installation: Installation, watch: Callable[[State], None], end: float
) -> None:
    log = folder / f"log.{SOLVER}"
    begun, first = time.monotonic(), last_time(folder)

    def look() -> None:
        times = step_times(tail(log)).tolist()
        if not times:
            return
        now = times[-1]
        clock = time.monotonic() - begun
        # The first steps are tiny and would give a far too long estimate.
        known = now - first > 0.02 * case.times.end
        left = clock / (now - first) * (case.times.end - now) if known else None
        lately = judge_steadiness(case, folder, (now - case.times.averaging, now))
        watch(State(now, case.times.end, left, lately, last_time(folder)))

    run_program(installation, folder, SOLVER, processes=case.options.processes, watch=look)
    if last_time(folder) < end * (1.0 - 1e-6):
        raise OpenFoamError(
            f"the solver in {folder} ended before {end:g} s without an error; run the same "
            "command again to continue.",
            code="openfoam.ended_early",
        )


def _averaging_since(folder: Path, pieces: list[Path], started: float, case: Case) -> float:
    """Time at which averaging began; a mean of another interval is dropped."""
    file = folder / _AVERAGED
    requested = {"end": case.times.end, "averaging": case.times.averaging}
    if file.is_file():
        stored = read_record(file)
        if {key: stored[key] for key in requested} == requested and started >= stored["since"]:
            if case.times.snapshots not in (0, stored["snapshots"]):
                raise InputError(
                    f"the run in {folder} keeps {stored['snapshots']} snapshots, not "
                    f"{case.times.snapshots}; give that number, or a later end "
                    "time, or delete the folder.",
                    code="case.other_snapshots",
                    argument="snapshots",
                )
            return float(stored["since"])
    if started >= case.times.end * (1.0 - 1e-9):
        raise InputError(
            f"the run in {folder} has already come to {started:g} s, so it cannot be averaged "
            f"over the last {case.times.averaging:g} s before {case.times.end:g} s; give a later "
            "end time, or delete the folder to begin anew.",
            code="case.already_later",
            argument="end_time",
        )
    if case.times.snapshots and _late(case, started):
        raise InputError(
            f"the run in {folder} has already come to {started:g} s, so {case.times.snapshots} "
            f"snapshots cannot be spread over the last {case.times.averaging:g} s before "
            f"{case.times.end:g} s; {_later(case, started)}.",
            code="case.snapshots_too_late",
            argument="end_time",
        )
    # Without it, states are whole that have no means.
    file.unlink(missing_ok=True)
    for piece in pieces:
        for entry in time_folders(piece).values():
            shutil.rmtree(entry / _OF_MEANS, ignore_errors=True)
            for name in AVERAGED:
                (entry / f"{name}Mean").unlink(missing_ok=True)
    kept = {**requested, "snapshots": case.times.snapshots, "since": started}
    write_whole(file, json.dumps(kept))
    return started


def _late(case: Case, since: float) -> bool:
    """True if averaging begins at a time, s, that is later than requested by more than rounding."""
    return since > case.times.settled + 1e-6 * case.times.end


def _later(case: Case, since: float) -> str:
    whole = case.times.averaging
    return f"give an average time of {whole:g} s and an end time of {since + whole:g} s or more"


def _whole(folder: Path, *, averaged: bool) -> bool:
    """True if a time's fields, and means if they are `averaged`, are all present and complete."""
    names = [Path(name).name for name in START_FILES]
    if averaged:
        # Written after the means; without it the solver would begin another average.
        names.append(f"{_OF_MEANS}/functionObjectProperties")
    needed = [folder / name for name in (*names, "phi", "uniform/time")]
    # OpenFOAM ends every complete file with this.
    return all("// ****" in tail(file, 200) for file in needed)
