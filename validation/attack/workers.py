"""Processes that read damaged files, one after the other; a crash or hang starts a new one."""

from __future__ import annotations

import multiprocessing
import resource
import shutil
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

import numpy as np
from attrs import define, field

from iriftrace.core.errors import IriftraceError
from validation.attack.doors import DOORS, Door, damageable
from validation.attack.mutations import mutated

OUTCOMES = ("valid", "InputError", "traceback", "crash", "hang", "above 4 GB")

HANG_S = 20.0
"""Time limit, s: a file of some kilobytes is read in well under a second."""

MOST_BYTES = 4 << 30
"""Address space that a worker may add to what it has before it reads."""

_START_S = 10.0
"""Time limit, s, for a worker's imports before its first case."""


Task = tuple[int, int]
"""Number of the door and seed of the damage."""


def damaged_files(number: int, seed: int, valid: dict[str, bytes]) -> tuple[str, bytes]:
    """Name and content of the one file that a case damages."""
    random = np.random.default_rng((seed, number))
    names = damageable(DOORS[number], valid)
    name = names[random.integers(len(names))]
    return name, mutated(valid[name], random)


def outcome(door: Door, folder: Path) -> tuple[str, str]:
    """Outcome of reading the files in a folder, one of `OUTCOMES`, and its last message."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            door.read(folder)
    except IriftraceError as error:
        return "InputError", str(error)
    except MemoryError:
        return "above 4 GB", _last_words()
    except Exception:  # what a reader lets through is what is looked for
        return "traceback", _last_words()
    return "valid", ""


def _last_words() -> str:
    """Kind and place of the error that is being handled."""
    kind, error, trace = sys.exc_info()
    place = traceback.extract_tb(trace)[-1]
    own = [f for f in traceback.extract_tb(trace) if "/iriftrace/" in f.filename]
    own = own[-1:] or [place]
    return (
        f"{kind.__name__ if kind else ''} in {Path(own[0].filename).name}:{own[0].lineno}, "
        f"{Path(place.filename).name}:{place.lineno}: {' '.join(str(error).split())[:120]}"
    )


def _work(channel: Connection, room: str, valid: dict[int, dict[str, bytes]]) -> None:
    """Read one case after the other as the parent names them."""
    used = (
        int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[0])
        * resource.getpagesize()
    )
    resource.setrlimit(resource.RLIMIT_AS, (used + MOST_BYTES,) * 2)
    folder = Path(room)
    while True:
        number, seed = channel.recv()
        shutil.rmtree(folder, ignore_errors=True)
        name, content = damaged_files(number, seed, valid[number])
        for file, original in valid[number].items():
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            (folder / file).write_bytes(content if file == name else original)
        channel.send(outcome(DOORS[number], folder))


@define
class _Worker:
    """A process that reads, and what it is reading."""

    process: Any
    channel: Connection
    folder: Path
    task: Task | None = None
    since: float = field(factory=time.monotonic)

    def give(self, task: Task) -> None:
        self.task, self.since = task, time.monotonic()
        self.channel.send(task)


def _start(room: Path, valid: dict[int, dict[str, bytes]]) -> _Worker:
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    folder = Path(tempfile.mkdtemp(dir=room))
    process = context.Process(target=_work, args=(there, str(folder / "case"), valid), daemon=True)
    process.start()
    there.close()
    return _Worker(process, here, folder)


def outcomes(
    tasks: Iterator[Task], workers: int, room: Path, valid: dict[int, dict[str, bytes]]
) -> Iterator[tuple[Task, str, str]]:
    """Every case with its outcome and last message; a worker that crashes or hangs is replaced."""
    team = [_start(room, valid) for _ in range(workers)]
    for worker in team:
        worker.give(next(tasks))
    while team:
        wait([worker.channel for worker in team], timeout=1.0)
        for place in range(len(team) - 1, -1, -1):
            worker = team[place]
            assert worker.task is not None
            ended: tuple[str, str] | None = None
            replaced = True
            try:
                if worker.channel.poll():
                    ended, replaced = worker.channel.recv(), False
                elif time.monotonic() - worker.since > HANG_S + _START_S:
                    ended = ("hang", "")
            except EOFError:
                worker.process.join()
                ended = ("crash", f"exit status {worker.process.exitcode}")
            if ended is None:
                continue
            if not replaced and time.monotonic() - worker.since > HANG_S + _START_S:
                ended = ("hang", "")
            yield worker.task, *ended
            if replaced:
                worker.process.kill()
                worker.process.join()
                team[place] = worker = _start(room, valid)
            try:
                worker.give(next(tasks))
            except StopIteration:
                worker.process.kill()
                del team[place]
