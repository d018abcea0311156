"""A bar for work that goes pose by pose, with rate and time left."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

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


class Rate(ProgressColumn):
    """Poses a second."""

    def render(self, task: Task) -> str:
        """Text of the column."""
        return "" if task.speed is None else f"{task.speed:.1f} a second"


@contextmanager
def pose_progress(what: str = "Poses") -> Iterator[Callable[[int, int], None]]:
    """Show a bar as soon as there is something to show.

    Parameters
    ----------
    what : str
        What is counted.

    Yields
    ------
    callable
        To be called with the number of finished ones and of all.
    """
    columns = (
        TextColumn(what),
        BarColumn(),
        MofNCompleteColumn(),
        Rate(),
        TimeRemainingColumn(),
    )
    bar = Progress(*columns, console=notes)
    task = bar.add_task(what, total=None)

    def report(done: int, total: int) -> None:
        if not bar.live.is_started:
            # What an earlier run has done must not count as speed.
            bar.reset(task, total=total, completed=done)
            bar.start()
        bar.update(task, completed=done)

    try:
        yield report
    finally:
        if bar.live.is_started:
            bar.stop()
