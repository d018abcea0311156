"""The commands ``iriftrace field simulate`` and ``iriftrace field doctor``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from attrs import evolve
from cyclopts import Parameter

from iriftrace.cli.console import out, say, say_finding
from iriftrace.cli.field import scene_command
from iriftrace.cli.field_options import AirOptions, PartOptions
from iriftrace.cli.hot_temperature import FIELD
from iriftrace.cli.options import Flag, Whole, celsius, check_folder, check_input, check_output
from iriftrace.cli.simulate_family import family_cases, family_scene, simulate_family
from iriftrace.cli.simulation_options import DraughtOptions, SimulationOptions
from iriftrace.cli.simulation_progress import simulation_progress
from iriftrace.core.errors import SetupError, warn
from iriftrace.core.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    from iriftrace.cfd.openfoam.case import Case
    from iriftrace.cfd.openfoam.simulate import Simulation
    from iriftrace.cfd.openfoam.wall import WallTemperatures


def simulate(
    part: Path,
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"])],
    simulation: SimulationOptions = SimulationOptions(),
    wind: DraughtOptions = DraughtOptions(),
    part_options: PartOptions = PartOptions(),
    field: Path | None = None,
    processes: Whole = 1,
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
    solved, and the same command continues an interrupted family.

    Example: ``iriftrace field simulate part.stl -o case --wall-temperature "1100 degC"``

    Parameters
    ----------
    part
        The part's closed surface (.stl .ply .obj .glb ...).
    output
        Folder for the OpenFOAM case, or for a family's fields and cases.
    field
        File for the field, .vtu; by default field.vtu in the case's folder.
    processes
        Processes for the solver.
    write_only
        Write the case and stop; the same command without this option runs it.
    """
    from iriftrace.cfd.openfoam.programs import find_openfoam
    from iriftrace.cfd.openfoam.simulate import check_solver, prepare
    from iriftrace.cfd.openfoam.simulate import simulate as run

    check_input(part)
    check_folder(output)
    target = output / "field.vtu" if field is None else field
    check_output(target, "field.vtu", make=True)
    wind.check(field=field, write_only=write_only)
    installation = None
    if not write_only:
        # Before anything is written: a case cannot be used if no solver is installed.
        installation = find_openfoam()
        check_solver(installation)
    hot = part_options
    wall = simulation.wall()
    if hot.expansion is not None and hot.hot_temperature is None:
        # It has expanded according to the temperature of its wall.
        hot = evolve(hot, hot_temperature=_words(wall))
    known = wall.measured
    measured = hot.read(part, None if known is None else lambda _: known.at)
    if wind.draughts is not None and installation is not None:
        members, cases = family_cases(measured, simulation, wind.family(), processes)
        _print_case(cases[members[0].name])
        simulate_family(members, cases, output, installation, wind)
        say(f"Family written; now run:  {family_scene(members, output, part, simulation, hot)}")
        return
    case = simulation.case(measured, processes, wind.single())
    _print_case(case)
    there = prepare(case, output)
    if installation is None:
        state = "already exists" if there else "written"
        say(f"Case {state}: {output}; the same command without --write-only runs it")
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    if there:
        say(f"Continuing the case in {output}")
    with simulation_progress() as display:
        result = run(case, output, target, installation, display)
    _print_simulation(result, part, hot, simulation)


def _words(wall: WallTemperatures) -> list[str]:
    """The part's hot temperatures as users write them, from the wall that is simulated."""
    if wall.measured is not None:
        return [FIELD]
    return [celsius(wall.default), *(f"{name}={celsius(k)}" for name, k in wall.regions.items())]


def doctor() -> None:
    """Find the OpenFOAM of this machine, test its solver's results, and print what to do.

    The test is three time steps on a tiny mesh with inclined faces. The solver of Debian 12's
    package fails it: it is miscompiled. ``make openfoam`` builds a repaired one.

    Example: ``iriftrace field doctor``
    """
    from iriftrace.cfd.openfoam.programs import REPAIR, find_openfoam
    from iriftrace.cfd.openfoam.solver_check import TRIAL_PASSED, try_solver

    installation = find_openfoam()
    say_finding("ok", "OpenFOAM", installation.folder or "on the search path")
    verdict = try_solver(installation)
    said = verdict or "three steps on a mesh with inclined faces came out right"
    built = f", built in place of {installation.installed}" if installation.repaired else ""
    say_finding("error" if verdict else "ok", "solver", f"{installation.solver}{built}: {said}")
    if verdict != TRIAL_PASSED:
        raise SetupError(
            f"the solver computes wrong, as that of Debian 12's package does; {REPAIR}."
        )


def _print_case(case: Case) -> None:
    from iriftrace.cfd.openfoam.case import symmetric_case

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
        say(f"  wall from {measured.path}: {low} to {high} at {len(measured.points):,} points")
        if far := measured.far_faces(case.part, case.size.wall):
            warn(far, stacklevel=2)
        return
    from iriftrace.part.region_choice import placed_regions

    names = zip(placed_regions(case.part), case.part.region_names, strict=True)
    table = {placed: wall.regions.get(name, wall.default) for placed, name in names}
    for region, kelvin in (table if wall.regions else {"all": wall.default}).items():
        say(f"  wall {region}: {kelvin:.2f} K ({kelvin - ZERO_CELSIUS_K:.0f} degC)")


def _print_simulation(
    result: Simulation, part: Path, part_options: PartOptions, simulation: SimulationOptions
) -> None:
    runs = f" ({result.all_seconds:.0f} s in all its runs)"
    out.print(
        f"{result.cells:,} cells, {result.seconds:.0f} s"
        f"{runs if result.all_seconds > result.seconds + 1.0 else ''}; field at the wall within "
        f"{result.wall_error_k:.2f} K of the set temperature"
    )
    steadiness = result.steadiness
    if steadiness is not None:
        out.print(f"Heat flow {steadiness.heat_w:.1f} W; the flow is {steadiness.text}.")
        if not steadiness.steady:
            say(
                "The field is the average over a plume that moves: a single exposure sees another "
                "one. --snapshots N keeps single states; --end-time runs on."
            )
    if result.snapshots:
        listed = result.field.with_name(f"{result.field.stem}_snapshots.pvd")
        say(f"{len(result.snapshots)} snapshots: {listed}")
    usual = simulation.pressure == AirOptions().pressure
    pressure = () if usual else ("--pressure", f"{simulation.pressure:.10g} Pa")
    command = scene_command(result.field, part, simulation.ambient, part_options, *pressure)
    say(f"Field written; now run:  {command}")
