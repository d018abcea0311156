"""Runs the solver of a meshed case to its end, and goes on with a run that was interrupted."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable
from pathlib import Path

from attrs import frozen

from iriftrace.errors import InputError
from iriftrace.openfoam.case import Case, read_record
from iriftrace.openfoam.case_files import (
    AVERAGED,
    START_FILES,
    write_control,
    write_decomposition,
)
from iriftrace.openfoam.commands import OpenFoamError, run_program
from iriftrace.openfoam.installation import SOLVER, Installation
from iriftrace.openfoam.log import read_steps, tail
from iriftrace.openfoam.steadiness import Steadiness, judge_steadiness
from iriftrace.readers.openfoam_folders import processor_folders, time_folders
from iriftrace.whole_file import whole_file

_AVERAGED = "averaging.json"
# OpenFOAM ends every complete file with it.
_END_MARK = b"// ****"


@frozen
class State:
    """How far the run has come, for a display.

    Attributes
    ----------
    time, end
        Physical time and its end, s.
    left
        Seconds of the clock that are left; None while that is not known.
    steadiness
        Of heat and plume lately; None at the beginning.
    """

    time: float
    end: float
    left: float | None
    steadiness: Steadiness | None


def solve(
    case: Case,
    folder: Path,
    installation: Installation,
    watch: Callable[[State], None],
) -> float:
    """Run until the flow has settled, then go on to the end and average the density.

    Returns
    -------
    float
        Seconds over which the density was averaged.

    Raises
    ------
    OpenFoamError
        The solver stopped.
    InputError
        The case was begun with another number of processes.
    """
    times = case.times
    pieces = _prepared(case, folder, installation)
    started = last_time(pieces)
    if started < times.settled * (1.0 - 1e-9):
        write_control(case, folder, averaging=False, start=started)
        _run_solver(case, folder, installation, watch, times.settled)
        started = last_time(pieces)
    since = _averaging_since(folder, pieces, started, case)
    if started < times.end * (1.0 - 1e-9):
        lately = judge_steadiness(case, folder, (started - times.averaging, started))
        steady = lately is not None and lately.steady
        write_control(case, folder, averaging=True, start=started, steady=steady)
        _run_solver(case, folder, installation, watch, times.end)
    return times.end - since


def last_time(pieces: list[Path]) -> float:
    """Last time that all pieces of a case have whole on disk; 0 at the beginning."""
    whole = [{t for t, f in time_folders(piece).items() if _whole(f)} for piece in pieces]
    return max(set.intersection(*whole), default=0.0)


def pieces_of(folder: Path) -> list[Path]:
    """The folders of the processors, or the case's own where it was not taken apart."""
    return processor_folders(folder) or [folder]


def _prepared(case: Case, folder: Path, installation: Installation) -> list[Path]:
    pieces = pieces_of(folder)
    apart = pieces != [folder]
    if case.processes > 1 and not apart:
        if last_time(pieces) > 0.0:
            raise InputError(
                f"the run in {folder} was begun with one process; go on with --processes 1."
            )
        write_decomposition(folder, case.processes)
        run_program(installation, folder, "decomposePar", "-force")
        return pieces_of(folder)
    if apart and len(pieces) != case.processes:
        raise InputError(
            f"the run in {folder} was begun with {len(pieces)} processes; go on with --processes "
            f"{len(pieces)}."
        )
    return pieces


def _run_solver(
    case: Case,
    folder: Path,
    installation: Installation,
    watch: Callable[[State], None],
    end: float,
) -> None:
    log = folder / f"log.{SOLVER}"
    begun, first = time.monotonic(), last_time(pieces_of(folder))

    def look() -> None:
        now = read_steps(tail(log)).last
        if now is None:
            return
        clock = time.monotonic() - begun
        # The first steps are tiny and would promise years.
        known = now - first > 0.02 * case.times.end
        left = clock / (now - first) * (case.times.end - now) if known else None
        window = (now - case.times.averaging, now)
        watch(State(now, case.times.end, left, judge_steadiness(case, folder, window)))

    run_program(installation, folder, SOLVER, processes=case.processes, watch=look)
    if last_time(pieces_of(folder)) < end * (1.0 - 1e-6):
        raise OpenFoamError(
            f"the solver in {folder} ended before {end:g} s without an error; run the same "
            "command again to go on."
        )


def _averaging_since(folder: Path, pieces: list[Path], started: float, case: Case) -> float:
    """When averaging began; a mean that was begun for another interval is dropped."""
    file = folder / _AVERAGED
    wanted = {"end": case.times.end, "averaging": case.times.averaging}
    if file.is_file():
        stored = read_record(file)
        if {key: stored[key] for key in wanted} == wanted and started >= stored["since"]:
            if case.times.snapshots not in (0, stored["snapshots"]):
                raise InputError(
                    f"the run in {folder} keeps {stored['snapshots']} snapshots, not "
                    f"{case.times.snapshots}; give that number, or a later end time."
                )
            return float(stored["since"])
    if started >= case.times.end * (1.0 - 1e-9):
        raise InputError(
            f"the run in {folder} has already come to {started:g} s, so it cannot be averaged "
            f"over the last {case.times.averaging:g} s before {case.times.end:g} s; give a later "
            "end time."
        )
    for piece in pieces:
        for entry in time_folders(piece).values():
            shutil.rmtree(entry / "uniform/functionObjects", ignore_errors=True)
            for name in AVERAGED:
                (entry / f"{name}Mean").unlink(missing_ok=True)
    with whole_file(file) as temporary:
        temporary.write_text(
            json.dumps({**wanted, "snapshots": case.times.snapshots, "since": started})
        )
    return started


def _whole(folder: Path) -> bool:
    """Whether a time's fields are all there and none breaks off."""
    names = [Path(name).name for name in START_FILES]
    needed = [folder / name for name in (*names, "phi", "uniform/time")]
    return all(file.is_file() and _ends_well(file) for file in needed)


def _ends_well(file: Path) -> bool:
    with file.open("rb") as stream:
        stream.seek(max(0, file.stat().st_size - 200))
        return _END_MARK in stream.read()
