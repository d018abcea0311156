"""Progress of a simulation in the terminal, and its expected time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import TYPE_CHECKING

from rich.progress import BarColumn, Progress, TimeElapsedColumn

from iriftrace.cli.console import notes, say, stating_kept

if TYPE_CHECKING:
    from iriftrace.flow.simulate.run import Cost, State
    from iriftrace.flow.simulate.simulate import Display


@contextmanager
def simulation_progress() -> Iterator[Display]:
    """Show the current step and, while the solver runs, the state of the flow."""
    from iriftrace.flow.simulate.simulate import Display

    bar_column = BarColumn(bar_width=20)
    columns = "{task.description}", bar_column, "{task.fields[flow]}", TimeElapsedColumn()
    # Finished bars would remain on a terminal that only logs.
    with Progress(*columns, console=notes, transient=True) as bar, stating_kept() as keep:
        task = bar.add_task("Case", total=None, flow="")
        keep("finished steps are kept; give the same command again to continue")

        def watch(state: State) -> None:
            keep(
                f"the flow is at {state.time:.3g} of {state.end:g} s; give the same command again "
                f"to continue from {state.stored:.3g} s"
            )
            bar.update(task, total=state.end, completed=state.time, flow=flow_text(state))

        yield Display(lambda text: bar.update(task, description=text), say_cost, watch)


def say_cost(cost: Cost, takes: str = "the solver takes") -> None:
    """Print the size of the mesh, the expected time, and what shortens a long one."""
    if cost.seconds <= 0.0:
        return
    say(f"{cost.cells:,} cells; {takes} {_duration(cost.seconds)} (right to a factor of two).")
    if (coarser := cost.coarser) is not None:
        say(
            f'In another folder, --background-cell "{coarser.background:g} mm" instead of '
            f"{cost.background:.3g} mm takes {_duration(coarser.seconds)} with about "
            f"{round(coarser.cells, -3):,} cells."
        )


def _duration(seconds: float) -> str:
    """Time of the clock in words."""
    minutes = round(seconds / 60.0)
    if minutes > 90:
        return f"{seconds / 3600.0:.2g} hours"
    return f"some {minutes} minutes" if minutes > 1 else "a minute or two"


def flow_text(state: State) -> str:
    """The state of the flow in a few words."""
    words = [f"{state.time:.3f} of {state.end:g} s"]
    flow = state.steadiness
    if flow is not None:
        varies = f"heat varies {flow.heat_variation:.1%}, plume {flow.plume_swing_k:.0f} K"
        words += [f"{flow.heat_w:.1f} W", "steady" if flow.steady else varies]
    if state.left is not None:
        words.append(f"{timedelta(seconds=round(state.left))} left")
    return ", ".join(words)
