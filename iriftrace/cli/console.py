"""Where the program writes: results to standard output, everything else to standard error."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console

from iriftrace.cli.interrupts import raise_if_noticed

out = Console(highlight=False)
notes = Console(stderr=True, highlight=False)


def show_warning(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    notes.print("[bold yellow]warning:[/] ", end="")
    notes.print(str(message), markup=False, soft_wrap=True)


@contextmanager
def working(what: str) -> Iterator[None]:
    """Show what is being done, where somebody watches."""
    raise_if_noticed()
    with notes.status(f"{what} ..."):
        yield
    raise_if_noticed()
