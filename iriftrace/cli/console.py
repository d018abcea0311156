"""The terminal: results to standard output, notes and bars to standard error, Ctrl-C from the user.

Ctrl-C must end the program at any time. An extension module that is being imported, or a
destructor, would swallow its exception. In these the signal is noticed and sent again later.
"""

from __future__ import annotations

import _thread
import shlex
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from subprocess import list2cmdline
from types import FrameType
from typing import TYPE_CHECKING, Any, Literal

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TimeRemainingColumn,
)
from rich.table import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PROJECT_FILE = "iriftrace.toml"
"""Name of a project's file."""

out = Console(highlight=False)
notes = Console(stderr=True, highlight=False)

_watching = threading.Event()
_noticed = threading.Event()
_pending = threading.Event()
_first_signal = [signal.SIGINT]


def say(text: str) -> None:
    """Print a result unchanged, on one line of any length, which only a terminal breaks."""
    out.print(text, markup=False, soft_wrap=True)


def command_line(*words: object) -> str:
    """A command of this program as the user types it into a shell, with any words."""
    texts = ["iriftrace", *map(str, words)]
    return list2cmdline(texts) if sys.platform == "win32" else shlex.join(texts)


def say_finding(state: Literal["ok", "warn", "error"], name: str, text: str) -> None:
    """Print a finding about a part of this machine's installation."""
    colour = {"ok": "green", "warn": "yellow", "error": "red"}[state]
    out.print(f"[{colour}]{state:5}[/] [bold]{name}[/]", end="  ")
    say(text)


def show_warning(message: Warning | str, *_: object, **__: object) -> None:
    notes.print("[bold yellow]warning:[/] ", end="")
    notes.print(str(message), markup=False, soft_wrap=True)


def print_table(
    title: str | None,
    headings: Sequence[str],
    rows: Iterable[Sequence[object]],
    texts: Collection[str] = (),
) -> None:
    """Print a table in the terminal's width, or wider if words and numbers would be cut.

    Columns with one of the headings `texts` are flush left and folded, the others flush right.
    """
    # Rules between the columns would cost width.
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 0, 0, 1))
    for heading in headings:
        if heading in texts:
            table.add_column(heading, overflow="fold")
        else:
            table.add_column(heading, justify="right")
    for row in rows:
        table.add_row(*map(str, row))
    # A measurement ends at the console's width, unless the options have a larger one.
    least = out.measure(table, options=out.options.update(width=1000)).minimum
    if least > out.width:
        table.width = least
    out.print(table, crop=False, soft_wrap=True)


@contextmanager
def working(what: str) -> Iterator[None]:
    """Show the current work in an interactive terminal."""
    raise_if_noticed()
    with notes.status(f"{what} ..."):
        yield
    raise_if_noticed()


def written_figure(figure: Callable[[], Figure], picture: Path) -> Path:
    """Draw a figure into a file; returns the file's name."""
    from iriftrace.figures.style import write_figure

    with working("Drawing"):
        write_figure(figure(), picture)
    return picture


class Rate(ProgressColumn):
    """Poses a second."""

    def render(self, task: Task) -> str:
        """Text of the column."""
        return "" if task.speed is None else f"{task.speed:.1f} a second"


@contextmanager
def late_bar(*columns: str | ProgressColumn, transient: bool) -> Iterator[Callable[..., None]]:
    """Show a bar from the first report on: numbers of finished ones and of all, and more fields."""
    bar = Progress(*columns, console=notes, transient=transient)
    task = bar.add_task("")

    def report(done: int, total: int, **more: Any) -> None:
        raise_if_noticed()
        if not bar.live.is_started:
            # Results of an earlier run must not count as speed.
            bar.reset(task, total=total, completed=done, **more)
            bar.start()
        bar.update(task, completed=done, **more)

    try:
        yield report
    finally:
        if bar.live.is_started:
            bar.stop()


def field_progress() -> AbstractContextManager[Callable[..., None]]:
    """Show a bar of the fields of an ensemble that are finished, and of all."""
    return late_bar("Fields", BarColumn(), MofNCompleteColumn(), transient=True)


@contextmanager
def pose_progress(output: Path, what: str = "Poses") -> Iterator[Callable[[int, int], None]]:
    """Show a bar of finished and all poses or other pieces; at Ctrl-C state what is stored.

    Finished pieces are stored in a journal next to the output.
    """
    from iriftrace.sweep.journal import journal_of

    columns = (what, BarColumn(), MofNCompleteColumn(), Rate(), TimeRemainingColumn())
    with late_bar(*columns, transient=False) as show, stating_kept() as keep:

        def report(done: int, total: int) -> None:
            if done:
                keep(
                    f"{done} of {total} {what.lower()} are kept in {journal_of(output)}, "
                    "give the same command again to continue"
                )
            show(done, total)

        yield report


@contextmanager
def stating_kept() -> Iterator[Callable[[str], None]]:
    """Take a sentence on what is kept; Ctrl-C inside the block ends with the last one."""
    kept = deque[str](maxlen=1)
    try:
        yield kept.append
    except BaseException as error:
        if kept and (noticed() or isinstance(error, KeyboardInterrupt)):
            raise KeyboardInterrupt(kept[0]) from error
        raise


@contextmanager
def watching() -> Iterator[None]:
    """Notice every Ctrl-C and SIGTERM inside the block, and raise it where it arrives intact.

    If Ctrl-C is ignored or handled by others, as in a thread, nothing changes.
    """
    former, former_hook = signal.getsignal(signal.SIGINT), sys.unraisablehook
    if (
        former is not signal.default_int_handler
        or threading.current_thread() is not threading.main_thread()
    ):
        yield
        return

    def hook(unraisable: sys.UnraisableHookArgs) -> None:
        if not issubclass(unraisable.exc_type, KeyboardInterrupt):
            former_hook(unraisable)
        elif _watching.is_set():
            # It arrived in a destructor, for example, which cannot raise anything.
            _raise_later()

    _noticed.clear()
    _watching.set()
    sys.unraisablehook = hook
    watched: dict[signal.Signals, Any] = {signal.SIGINT: former}
    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        watched[signal.SIGTERM] = signal.SIG_DFL
    for number in watched:
        signal.signal(number, _notice)
    try:
        yield
    finally:
        for number, handler in watched.items():
            signal.signal(number, handler)
        sys.unraisablehook = former_hook
        ignore()
        _noticed.clear()


def ignore() -> None:
    """Make Ctrl-C have no effect, as the program is already ending."""
    _watching.clear()
    _pending.clear()


def noticed() -> bool:
    """True after a Ctrl-C: any exception that follows may be caused by it."""
    return _noticed.is_set()


def exit_status() -> int:
    """Exit status after the signal that came first: 130 Ctrl-C, 143 SIGTERM."""
    return 128 + _first_signal[0]


def raise_if_noticed() -> None:
    """Raise a signal again whose exception was swallowed."""
    if noticed():
        _pending.clear()
        raise KeyboardInterrupt


def _notice(number: int, frame: FrameType | None) -> None:
    if not _watching.is_set():
        return
    if not noticed():
        _first_signal[0] = signal.Signals(number)
    _noticed.set()
    if _importing(frame):
        # Extension modules that are being imported swallow exceptions, or convert them to others.
        _raise_later()
        return
    _pending.clear()
    raise KeyboardInterrupt


def _importing(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename == "<frozen importlib._bootstrap>":
            return True
        frame = frame.f_back
    return False


def _raise_later() -> None:
    _pending.set()
    _thread.start_new_thread(_send_again, ())


def _send_again() -> None:
    time.sleep(0.02)
    if not _pending.is_set():
        return
    if sys.platform == "win32":
        _thread.interrupt_main()
    else:
        # Unlike the other function, this also ends waiting and sleeping.
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
