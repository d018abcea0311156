"""A family of draughts of ``iriftrace field simulate``."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from iriftrace.cli.console import notes, out, say
from iriftrace.cli.field import scene_command
from iriftrace.cli.field_options import PartOptions
from iriftrace.cli.simulation_progress import duration, simulation_progress
from iriftrace.core.errors import InputError
from iriftrace.core.plain import JsonObject

if TYPE_CHECKING:
    from iriftrace.cfd.openfoam.case import Case
    from iriftrace.cfd.openfoam.draught import Draught
    from iriftrace.cfd.openfoam.family import Member
    from iriftrace.cfd.openfoam.family_run import Cost, Solve, Task
    from iriftrace.cfd.openfoam.programs import Installation
    from iriftrace.cli.simulation_options import DraughtOptions, SimulationOptions
    from iriftrace.part.part import Part


def family_cases(
    part: Part,
    simulation: SimulationOptions,
    family: tuple[Sequence[float], Sequence[float]],
    processes: int,
) -> tuple[tuple[Member, ...], dict[str, Case]]:
    """Members of a family of speeds, m/s, and directions, degrees, and the case of each by name."""
    from iriftrace.cfd.openfoam.case import symmetric_case
    from iriftrace.cfd.openfoam.family import plan_family

    if simulation.snapshots:
        raise InputError(
            "--snapshots keeps states of one simulation, but --draughts makes a family; leave one "
            "of them out."
        )
    # Refuses planes that the part does not have before leaving out those through which air blows.
    still = simulation.case(part, processes, None)
    members = plan_family(*family, simulation.mirrors, symmetric_case(still))
    sharing: dict[str, list[Draught]] = {}
    for member in members:
        if member.draught is not None and not member.image_of:
            sharing.setdefault(member.planes, []).append(member.draught)
    cases = {
        member.name: simulation.case(
            part, processes, member.draught, member.planes, sharing.get(member.planes, ())
        )
        for member in members
    }
    return members, cases


def simulate_family(
    members: Sequence[Member],
    cases: dict[str, Case],
    folder: Path,
    installation: Installation,
    wind: DraughtOptions,
) -> None:
    """Solve the missing members of a family, here or on workers, and print the progress."""
    from iriftrace.cfd.openfoam.family_run import run_family, solve_elsewhere
    from iriftrace.sweep.workers import run_tasks, scheduler_client

    folder.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        solve: Solve = partial(_solve_here, installation)
        if wind.address is not None:
            client = stack.enter_context(scheduler_client(wind.address, wind.workers))
            solve = partial(run_tasks, client, solve_elsewhere)
        status = stack.enter_context(notes.status("Mesh"))

        def expect(cost: Cost) -> None:
            # The next step has its own display.
            status.stop()
            _say_cost(cost)

        running = run_family(
            members, cases, folder, installation, solve, say=status.update, expect=expect
        )
        for entry in running:
            out.print(_finished(entry))


def family_scene(
    members: Sequence[Member],
    folder: Path,
    part: Path,
    simulation: SimulationOptions,
    part_options: PartOptions,
) -> str:
    """Command that makes a scene of all members."""
    files = [folder / member.file for member in members]
    more = [word for file in files[1:] for word in ("--member", str(file))]
    return scene_command(files[0], part, simulation.ambient, part_options, *more)


def _solve_here(installation: Installation, tasks: Sequence[Task]) -> Iterator[JsonObject]:
    from attrs import evolve

    from iriftrace.cfd.openfoam.family_run import solve_member

    for task in tasks:
        with simulation_progress() as display:
            # Cost and mesh are those of the family, printed before.
            quiet = evolve(display, expect=lambda cells, seconds: None)
            entry = solve_member(task, installation, quiet)
        yield entry


def _say_cost(cost: Cost) -> None:
    """Print the cost of the family before the first solver starts."""
    total = cost.finished + cost.mirrored + cost.solved
    words = [f"{cost.solved} to solve"]
    words += [f"{cost.mirrored} mirror images"] if cost.mirrored else []
    words += [f"{cost.finished} already finished"] if cost.finished else []
    say(f"{total} members: {', '.join(words)}")
    if cost.solved:
        say(
            f"{cost.cells:,} cells; all solvers, one after another, take "
            f"{duration(cost.seconds)} (right to a factor of two)."
        )


def _finished(entry: JsonObject) -> str:
    if entry["image_of"]:
        return f"{entry['name']}: mirror image of {entry['image_of']}"
    state = "" if entry["heat_w"] is None else f", {entry['heat_w']:.1f} W"
    steady = {True: ", steady", False: ", NOT STEADY", None: ""}[entry["steady"]]
    return f"{entry['name']}: {entry['seconds']:.0f} s{state}{steady}"
