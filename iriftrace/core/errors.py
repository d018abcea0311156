"""Errors and the warning of iriftrace.

Every message says what is wrong (with the value), why it matters and what to do.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from traceback import walk_stack


class IriftraceError(Exception):
    """Root of all errors raised on purpose; the command line shows the message and exits with 2."""


class InputError(IriftraceError, ValueError):
    """A file, an option or an argument is wrong; nothing was written."""


class SetupError(IriftraceError, RuntimeError):
    """Something that iriftrace needs is missing on this machine, such as an LLVM library."""


class IriftraceWarning(UserWarning):
    """The result is valid, but the user should know its limits."""


def warn(text: str) -> None:
    """Issue an `IriftraceWarning` at the line of the user's program that called the package."""
    package = __name__.partition(".")[0]
    # What attrs generates has no module's name, and other packages may be in between.
    modules = [frame.f_globals.get("__name__", package) for frame, _ in walk_stack(sys._getframe())]
    ours = [n for n, name in enumerate(modules) if name.partition(".")[0] == package]
    warnings.warn(text, IriftraceWarning, stacklevel=ours[-1] + 2)


@contextmanager
def without_warnings() -> Iterator[None]:
    """Ignore every `IriftraceWarning` inside the block: what it says has been said, or is known."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IriftraceWarning)
        yield
