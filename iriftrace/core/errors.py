"""Errors and the warning of iriftrace.

Every message says what is wrong (with the value), why it matters and what to do.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager


class IriftraceError(Exception):
    """Root of all errors raised on purpose; the command line shows the message and exits with 2."""


class InputError(IriftraceError, ValueError):
    """A file, an option or an argument is wrong; nothing was written."""


class SetupError(IriftraceError, RuntimeError):
    """Something that iriftrace needs is missing on this machine, such as an LLVM library."""


class IriftraceWarning(UserWarning):
    """The result is valid, but the user should know its limits."""


def warn(text: str, *, stacklevel: int = 3) -> None:
    """Issue an `IriftraceWarning`; the level is that of `warnings.warn` where this is called."""
    warnings.warn(text, IriftraceWarning, stacklevel=stacklevel + 1)


@contextmanager
def without_warnings() -> Iterator[None]:
    """Ignore every `IriftraceWarning` inside the block: what it says has been said, or is known."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IriftraceWarning)
        yield
