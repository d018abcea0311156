"""Errors and the warning of iriftrace.

Every message says what is wrong (with the value), why it matters and what to do, in words of
Python; the command line adds its option from the error's `argument`.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from traceback import walk_stack
from typing import Any, Self

from attrs import fields


class IriftraceError(Exception):
    """Root of all errors raised on purpose; the command line shows the message and exits with 2.

    Parameters
    ----------
    text
        The message, one sentence or two.
    code
        Stable name of the fault, ``room.fact``, such as "field.no_array"; docs/errors.md lists all.
    argument
        Name of the argument or field of a class that is wrong, or with which to mend it.
    """

    def __init__(self, text: str, *, code: str, argument: str | None = None) -> None:
        super().__init__(text)
        self.code = code
        self.argument = argument

    def __reduce__(self) -> tuple[Callable[..., Self], tuple[Any, ...]]:
        # Errors travel between processes, which keep the positional arguments alone.
        return partial(type(self), code=self.code, argument=self.argument), self.args


class InputError(IriftraceError, ValueError):
    """A file, an option or an argument is wrong; nothing was written."""


class SetupError(IriftraceError, RuntimeError):
    """Something that iriftrace needs is missing on this machine, such as an LLVM library."""


class IriftraceWarning(UserWarning):
    """The result is valid, but the user should know its limits.

    `argument` is the name of the argument, or field of a class, with which to change it.
    """

    def __init__(self, text: str, *, argument: str | None = None) -> None:
        super().__init__(text)
        self.argument = argument


def refuse_given(values: Mapping[str, object], reason: str, code: str) -> None:
    """Refuse values by their names unless all are None; the reason follows a name."""
    for name, value in values.items():
        if value is not None:
            raise InputError(f"`{name}` {reason}", code=code, argument=name)


def changed(options: Any, names: Collection[str]) -> dict[str, object]:
    """Fields of an attrs class, among `names`, that differ from their defaults."""
    values = {one.name: (getattr(options, one.name), one.default) for one in fields(type(options))}
    return {name: values[name][0] for name in names if values[name][0] != values[name][1]}


def warn(text: str, *, argument: str | None = None) -> None:
    """Issue an `IriftraceWarning` at the line of the user's program that called the package."""
    package = __name__.partition(".")[0]
    # What attrs generates has no module's name, and other packages may be in between.
    modules = [frame.f_globals.get("__name__", package) for frame, _ in walk_stack(sys._getframe())]
    ours = [n for n, name in enumerate(modules) if name.partition(".")[0] == package]
    warnings.warn(IriftraceWarning(text, argument=argument), stacklevel=ours[-1] + 2)


@contextmanager
def without_warnings() -> Iterator[None]:
    """Ignore every `IriftraceWarning` inside the block: what it says has been said, or is known."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IriftraceWarning)
        yield
