"""A bar for work that goes pose by pose, with rate and time left."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeRemainingColumn,
)

from iriftrace.cli.console import notes
from iriftrace.cli.interrupts import noticed, raise_if_noticed


class Rate(ProgressColumn):
    """Poses a second."""

    def render(self, task: Task) -> str:
        """Text of the column."""
        return "" if task.speed is None else f"{task.speed:.1f} a second"


@contextmanager
def pose_progress(output: Path, what: str = "Poses") -> Iterator[Callable[[int, int], None]]:
    """Show a bar as soon as there is something to show, and at Ctrl-C say what is kept.

    Parameters
    ----------
    output : Path
        The result; what is finished is kept in a journal beside it.
    what : str
        What is counted.

    Yields
    ------
    callable
        To be called with the number of finished ones and of all.
    """
    from iriftrace.sweep_journal import journal_of

    columns = (
        TextColumn(what),
        BarColumn(),
        MofNCompleteColumn(),
        Rate(),
        TimeRemainingColumn(),
    )
    bar = Progress(*columns, console=notes)
    task = bar.add_task(what, total=None)

    kept = ""

    def report(done: int, total: int) -> None:
        nonlocal kept
        if done:
            kept = (
                f"{done} of {total} {what.lower()} are kept in {journal_of(output)}, "
                "give the same command again to go on"
            )
        raise_if_noticed()
        if not bar.live.is_started:
            # What an earlier run has done must not count as speed.
            bar.reset(task, total=total, completed=done)
            bar.start()
        bar.update(task, completed=done)

    try:
        yield report
    except BaseException as error:
        if kept and (noticed() or isinstance(error, KeyboardInterrupt)):
            raise KeyboardInterrupt(kept) from error
        raise
    finally:
        if bar.live.is_started:
            bar.stop()
