"""The commands ``iriftrace field simulate``, for one field or a family, and ``field doctor``."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from attrs import evolve

from iriftrace.cli import checks
from iriftrace.cli.console import notes, say, say_finding
from iriftrace.cli.field import scene_command
from iriftrace.cli.groups import group
from iriftrace.cli.options import Flag, Output, read_as_word
from iriftrace.cli.reading import PartReading, read_part
from iriftrace.cli.simulation_progress import say_cost, simulation_progress
from iriftrace.core.errors import InputError, SetupError, refuse_given, warn
from iriftrace.core.plain import JsonObject
from iriftrace.core.units import ZERO_CELSIUS_K
from iriftrace.flow.simulate.options import DraughtOptions, SimulationOptions, Speeds
from iriftrace.io.reading import AS_DRAWN, ReadPart
from iriftrace.medium.air.refractivity import Air
from iriftrace.part.hot_temperature import FIELD, temperature_words
from iriftrace.sweep.options import NO_WORKERS, Workers

if TYPE_CHECKING:
    from iriftrace.flow.simulate.case import Case
    from iriftrace.flow.simulate.draught import Draught
    from iriftrace.flow.simulate.family import FamilyMember
    from iriftrace.flow.simulate.family_run import Remaining, Solve, Task
    from iriftrace.flow.simulate.programs import Installation
    from iriftrace.flow.simulate.simulate import Simulation
    from iriftrace.part.part import Part
    from iriftrace.part.uneven_growth import Temperatures
    from iriftrace.part.wall_temperature import WallTemperatures


read_as_word(Speeds, "STR")
Simulating = Annotated[SimulationOptions, group(SimulationOptions, "Simulation", 1)]
Wind = Annotated[DraughtOptions, group(DraughtOptions, "Draught", 2)]
WorkersOfFamily = Annotated[Workers, group(Workers, "Draught", 2)]


def simulate(
    part: Path,
    *,
    output: Output,
    simulation: Simulating = SimulationOptions(),
    wind: Wind = DraughtOptions(),
    workers: WorkersOfFamily = NO_WORKERS,
    part_reading: PartReading = AS_DRAWN,
    field: Path | None = None,
    vary: str | None = None,
    write_only: Flag = False,
) -> None:
    """Simulate the hot air around a part with OpenFOAM and write the field.

    Natural convection of air, laminar, gravity along -z, around the part with the given wall
    temperature. The field's temperature is the one with the time average of the density, which
    the refractive index follows. The file also has the mean velocity and the data that `iriftrace
    field check` needs for a heat balance. An interrupted run continues if the same command is
    given again. `iriftrace field doctor` checks the OpenFOAM of this machine.

    With ``--draughts`` the folder gets a family: a field for each speed and direction, named so
    that they sort, and family.json, which lists them. They use one mesh, mirror images are not
    solved, and the same command continues an interrupted family. ``--between`` adds members halfway
    between the solved ones.

    Example: ``iriftrace field simulate part.stl -o case --wall-temperature "1100 degC"``

    Parameters
    ----------
    part
        The part's closed surface (.stl .ply .obj .glb ...).
    output
        Folder for the OpenFOAM case, or for a family's fields and cases.
    field
        File for the field, .vtu; by default field.vtu in the case's folder.
    vary
        Solve the flow again with an input changed, once for each, "wall 10 K, ambient 2 K, pressure
        2 hPa", for its share of an uncertainty. The fields are written beside the first one, as
        field_wall.vtu and so on; in a scene they are members without weight.
    write_only
        Write the case and stop; the same command without this option runs it.
    """
    from iriftrace.flow.simulate.case import natural_case
    from iriftrace.flow.simulate.programs import find_openfoam
    from iriftrace.flow.simulate.simulate import check_solver, prepare
    from iriftrace.flow.simulate.simulate import simulate as run
    from iriftrace.flow.simulate.variations import case_folder, varied_cases
    from iriftrace.part.region_choice import values_by_region
    from iriftrace.part.wall_temperature import wall_temperature

    checks.inputs(part)
    checks.folder(output)
    target = output / "field.vtu" if field is None else field
    checks.output(target, "field.vtu", make=True)
    family = wind.draughts is not None
    if family:
        refuse_given(
            {"field": field, "write_only": write_only or None, "vary": vary},
            "is for one field, but --draughts makes a family; leave one of them out.",
            "options.not_together",
        )
        from iriftrace.sweep.workers import check_scheduler

        check_scheduler(workers.address, workers.workers)
    else:
        refuse_given(
            {"scheduler": workers.scheduler, "workers": workers.workers},
            "is for the members of a family; give --draughts 0:0.2:0.02, or leave it out.",
            "options.not_together",
        )
    installation = None
    if not write_only:
        # Before anything is written: a case cannot be used if no solver is installed.
        installation = find_openfoam()
        check_solver(installation)
    hot = part_reading
    if simulation.wall_temperature_from is None:
        kelvin, regions = hot.hot.wall(simulation.wall_temperature, simulation.region_temperature)
        simulation = evolve(simulation, wall_temperature=kelvin, region_temperature=regions)
    wall = simulation.wall()
    same = (wall.default, wall.regions) == (hot.hot.default, hot.hot.regions)
    if hot.expansion is not None and (
        hot.hot_temperature is None or (same and wall.transition > 0.0)
    ):
        # It has expanded according to the temperature of its wall.
        hot = evolve(hot, hot_temperature=_words(wall))

    def of_wall(cold: Part) -> Temperatures:
        regions = values_by_region(cold, wall.regions)
        return partial(wall_temperature, evolve(wall, regions=regions), cold)

    measured = read_part(part, hot, of_wall)
    if family and installation is not None:
        members, cases = family_cases(measured, simulation, wind)
        _print_case(cases[members[0].name])
        simulate_family(members, cases, output, installation, workers)
        files = [output / member.file for member in members]
        say(f"Family written; now run:  {next_scene(files, part, simulation, hot)}")
        return
    case = natural_case(measured, simulation, draught=wind.single())
    varied = () if vary is None else varied_cases(case, vary)
    _print_case(case)
    there = prepare(case, output)
    for one in varied:
        prepare(one, case_folder(one, output))
    if installation is None:
        state = "already exists" if there else "written"
        say(f"Case {state}: {output}; the same command without --write-only runs it")
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    if there:
        say(f"Continuing the case in {output}")
    if varied:
        say(f"It is solved {len(varied) + 1} times on one mesh, of which this is the first.")
    with simulation_progress() as display:
        result = run(case, output, target, installation, display)
    _print_simulation(result)
    files = [result.field, *_vary(varied, output, result, installation)]
    written = "Fields" if varied else "Field"
    say(f"{written} written; now run:  {next_scene(files, part, simulation, hot)}")


def _vary(
    varied: Sequence[Case], folder: Path, first: Simulation, installation: Installation
) -> list[Path]:
    """Solve each of the cases that vary the first one; returns their fields."""
    from iriftrace.flow.simulate.variations import solve_varied

    results = [first]
    for one in varied:
        with simulation_progress() as display:
            # Mesh and cost are those of the first one.
            quiet = evolve(display, expect=lambda cost: None)
            result = solve_varied(one, folder, first, installation, quiet)
        results.append(result)
        text = "" if one.variation is None else one.variation.text
        flow = result.steadiness
        state = "" if flow is None else f"; heat flow {flow.heat_w:.4g} W, {flow.text}"
        say(f"{result.field.name} {text}: {result.seconds:.0f} s{state}")
    if varied and not all(one.steadiness and one.steadiness.steady for one in results):
        warn(
            "The flow is not steady, so what an input changes contains what time changes, too; "
            "average longer (--average-time, --end-time)."
        )
    return [one.field for one in results[1:]]


def _words(wall: WallTemperatures) -> list[str]:
    """The part's hot temperatures as users write them, from the wall that is simulated.

    Those of a file, and those between regions, are known from the field.
    """
    if wall.measured is not None or wall.transition > 0.0:
        return [FIELD]
    return temperature_words(wall.default, wall.regions)


def doctor() -> None:
    """Find the OpenFOAM of this machine, test its solver's results, and print what to do.

    The test is three time steps on a tiny mesh with inclined faces. The solver of Debian 12's
    package fails it: it is miscompiled. ``make openfoam`` builds a repaired one.

    Example: ``iriftrace field doctor``
    """
    from iriftrace.flow.simulate.programs import REPAIR, find_openfoam
    from iriftrace.flow.simulate.solver_check import try_solver

    installation = find_openfoam()
    say_finding("ok", "OpenFOAM", installation.folder or "on the search path")
    verdict = try_solver(installation)
    said = verdict or "three steps on a mesh with inclined faces came out right"
    built = f", built in place of {installation.installed}" if installation.repaired else ""
    say_finding("error" if verdict else "ok", "solver", f"{installation.solver}{built}: {said}")
    if verdict:
        raise SetupError(
            f"the solver computes wrong, as that of Debian 12's package does; {REPAIR}.",
            code="openfoam.computes_wrong",
        )


def _print_case(case: Case) -> None:
    from iriftrace.flow.simulate.case import symmetric_case

    low, high = case.domain.lower, case.domain.upper
    box = " x ".join(f"{b - a:.0f}" for a, b in zip(low, high, strict=True))
    say(
        f"Air {box} mm, cells of {case.size.background:.3g} mm, at the wall "
        f"{case.size.wall:.2g} mm ({case.size.name}); {case.times.end:g} s, density averaged over "
        f"the last {case.times.averaging:g} s."
    )
    if case.draught is not None:
        say(f"  {case.draught.text}")
    _print_wall(case)
    found = symmetric_case(case)
    if case.draught is not None:
        crossed = case.draught.crossed(found)
        found = "".join(axis for axis in found if axis not in crossed)
    if found and not case.mirrors:
        say(
            f"The case is symmetric along {' and '.join(found)}: --symmetry {found} computes 1/"
            f"{2 ** len(found)} of the air, if a plume that cannot move sideways is good enough."
        )


def _print_wall(case: Case) -> None:
    wall, measured = case.wall, case.wall.measured
    if measured is not None:
        low, high = (f"{kelvin:.2f} K" for kelvin in (measured.kelvins.min(), wall.hottest))
        count = len(measured.points)
        say(f"  wall from {measured.origin.path}: {low} to {high} at {count:,} points")
        if far := measured.far_faces(case.part, case.size.wall):
            warn(far)
        return
    from iriftrace.part.region_choice import placed_regions

    names = zip(placed_regions(case.part), case.part.region_names, strict=True)
    table = {placed: wall.regions.get(name, wall.default) for placed, name in names}
    for region, kelvin in (table if wall.regions else {"all": wall.default}).items():
        say(f"  wall {region}: {kelvin:.2f} K ({kelvin - ZERO_CELSIUS_K:.0f} degC)")


def _print_simulation(result: Simulation) -> None:
    runs = f" ({result.all_seconds:.0f} s in all its runs)"
    say(
        f"{result.cells:,} cells, {result.seconds:.0f} s"
        f"{runs if result.all_seconds > result.seconds + 1.0 else ''}; density averaged over the "
        f"last {result.averaged:.3g} s; field at the wall within "
        f"{result.wall_error_k:.2f} K of the set temperature"
    )
    steadiness = result.steadiness
    if steadiness is not None:
        say(f"Heat flow {steadiness.heat_w:.1f} W; the flow is {steadiness.text}.")
        if not steadiness.steady:
            say(
                "The field is the average over a plume that moves: a single exposure sees another "
                "one. --snapshots N keeps single states; --end-time runs on."
            )
    if result.snapshots:
        listed = result.field.with_name(f"{result.field.stem}_snapshots.pvd")
        say(f"{len(result.snapshots)} snapshots: {listed}")


def next_scene(
    fields: Sequence[Path], part: Path, simulation: SimulationOptions, reading: ReadPart
) -> str:
    """The command that makes a scene of simulated fields, in the air of the simulation."""
    more = [word for file in fields[1:] for word in ("--member", str(file))]
    if simulation.pressure != Air().pressure_pa:
        more += ["--pressure", f"{simulation.pressure:.10g} Pa"]
    return scene_command(fields[0], part, simulation.ambient, reading, *more)


def family_cases(
    part: Part, simulation: SimulationOptions, wind: DraughtOptions
) -> tuple[tuple[FamilyMember, ...], dict[str, Case]]:
    """Members of a family, and the case of each by name."""
    from iriftrace.flow.simulate.case import natural_case, symmetric_case
    from iriftrace.flow.simulate.family import plan_family

    if simulation.snapshots:
        raise InputError(
            "--snapshots keeps states of one simulation, but --draughts makes a family; leave one "
            "of them out.",
            code="options.snapshots_of_family",
        )
    # Refuses planes that the part does not have before leaving out those through which air blows.
    still = natural_case(part, simulation)
    members = plan_family(wind, simulation.mirrors, symmetric_case(still))
    sharing: dict[str, list[Draught]] = {}
    for member in members:
        if member.draught is not None and member.solved:
            sharing.setdefault(member.planes, []).append(member.draught)
    cases = {
        member.name: natural_case(
            part,
            simulation,
            draught=member.draught,
            mirrors=member.planes,
            family=sharing.get(member.planes, ()),
        )
        for member in members
    }
    return members, cases


def simulate_family(
    members: Sequence[FamilyMember],
    cases: dict[str, Case],
    folder: Path,
    installation: Installation,
    workers: Workers,
) -> None:
    """Solve the missing members of a family, here or on workers, and print the progress."""
    from iriftrace.flow.simulate.family_run import run_family, solve_elsewhere
    from iriftrace.sweep.workers import run_tasks, scheduler_client

    folder.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        solve: Solve = partial(_solve_here, installation)
        if workers.address is not None:
            client = stack.enter_context(scheduler_client(workers.address, workers.workers))
            solve = partial(run_tasks, client, solve_elsewhere)
        status = stack.enter_context(notes.status("Mesh"))

        def expect(remaining: Remaining) -> None:
            # The next step has its own display.
            status.stop()
            _say_remaining(remaining)

        running = run_family(
            members, cases, folder, installation, solve, say=status.update, expect=expect
        )
        for entry in running:
            say(_finished(entry))


def _solve_here(installation: Installation, tasks: Sequence[Task]) -> Iterator[JsonObject]:
    from iriftrace.flow.simulate.family_run import solve_member

    for task in tasks:
        with simulation_progress() as display:
            # Cost and mesh are those of the family, printed before.
            quiet = evolve(display, expect=lambda cost: None)
            entry = solve_member(task, installation, quiet)
        yield entry


def _say_remaining(work: Remaining) -> None:
    """Print the cost of the family before the first solver starts."""
    total = work.finished + work.mirrored + work.between + work.solved
    words = [f"{work.solved} to solve"]
    words += [f"{work.mirrored} mirror images"] if work.mirrored else []
    words += [f"{work.between} between others"] if work.between else []
    words += [f"{work.finished} already finished"] if work.finished else []
    say(f"{total} members: {', '.join(words)}")
    if work.cost is not None:
        say_cost(work.cost, "all solvers, one after another, take")


def _finished(entry: JsonObject) -> str:
    if entry["image_of"]:
        return f"{entry['name']}: mirror image of {entry['image_of']}"
    if entry["between"]:
        return f"{entry['name']}: between {', '.join(entry['between'])}"
    state = "" if entry["heat_w"] is None else f", {entry['heat_w']:.1f} W"
    steady = {True: ", steady", False: ", NOT STEADY", None: ""}[entry["steady"]]
    return f"{entry['name']}: {entry['seconds']:.0f} s{state}{steady}"
