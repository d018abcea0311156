"""A running simulation as a bar: physical time, heat flow, steadiness, time left."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import TYPE_CHECKING

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from iriftrace.cli.console import notes

if TYPE_CHECKING:
    from iriftrace.openfoam.run import State
    from iriftrace.openfoam.simulate import Display


@contextmanager
def simulation_progress() -> Iterator[Display]:
    """Show what is being done and, while the solver runs, how far the flow is.

    Yields
    ------
    Display
        To hand to `iriftrace.openfoam.simulate.simulate`.
    """
    from iriftrace.openfoam.simulate import Display

    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=20),
        TextColumn("{task.fields[flow]}"),
        TimeElapsedColumn(),
    )
    # Finished bars would stay on a terminal that only logs.
    with Progress(*columns, console=notes, transient=True) as bar:
        task = bar.add_task("Case", total=None, flow="")

        def say(text: str) -> None:
            bar.update(task, description=text)

        def watch(state: State) -> None:
            bar.update(task, total=state.end, completed=state.time, flow=flow_text(state))

        yield Display(say, watch)


def flow_text(state: State) -> str:
    """The state of the flow in a few words."""
    words = [f"{state.time:.3f} of {state.end:g} s"]
    if state.steadiness is not None:
        words.append(f"{state.steadiness.heat_w:.1f} W")
        words.append(
            "steady"
            if state.steadiness.steady
            else f"heat varies {state.steadiness.heat_variation:.1%}, "
            f"plume {state.steadiness.plume_swing_k:.0f} K"
        )
    if state.left is not None:
        words.append(f"{timedelta(seconds=round(state.left))} left")
    return ", ".join(words)
