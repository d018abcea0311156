"""Ctrl-C, which must end the program whatever it is doing: not even an import may swallow it.

SIGTERM, by which batch systems end programs, does the same. Imports nothing heavy, as it comes
before everything else.
"""

from __future__ import annotations

import _thread
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

PAUSE_S = 0.02

_watching = threading.Event()
_noticed = threading.Event()
_pending = threading.Event()
_first_signal = [signal.SIGINT]


@contextmanager
def watching() -> Iterator[None]:
    """Notice every Ctrl-C and SIGTERM inside the block, and raise it where it arrives intact.

    Where Ctrl-C is ignored or somebody else's, as in a thread, nothing changes.
    """
    former, former_hook = signal.getsignal(signal.SIGINT), sys.unraisablehook
    if (
        former is not signal.default_int_handler
        or threading.current_thread() is not threading.main_thread()
    ):
        yield
        return

    def hook(unraisable: Any) -> None:
        if not issubclass(unraisable.exc_type, KeyboardInterrupt):
            former_hook(unraisable)
        elif _watching.is_set():
            # It arrived in a destructor, say, which cannot raise anything.
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
    """Let Ctrl-C do nothing any more, as the program is ending already."""
    _watching.clear()
    _pending.clear()


def noticed() -> bool:
    """Whether there was a Ctrl-C: any exception that follows may be what became of it."""
    return _noticed.is_set()


def exit_status() -> int:
    """What a shell calls the end by the signal that came first: 130 Ctrl-C, 143 SIGTERM."""
    return 128 + _first_signal[0]


def raise_if_noticed() -> None:
    """Raise again what was swallowed on its way.

    Raises
    ------
    KeyboardInterrupt
    """
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
        # Extension modules that are being imported swallow exceptions, or make others of them.
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
    time.sleep(PAUSE_S)
    if not _pending.is_set():
        return
    if sys.platform == "win32":
        _thread.interrupt_main()
    else:
        # Unlike the other, this ends waiting and sleeping too.
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
