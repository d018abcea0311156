"""The commands ``iriftrace field simulate`` and ``iriftrace field doctor``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal
from warnings import warn

from attrs import evolve, frozen
from cyclopts import Group, Parameter
from rich.progress import BarColumn, Progress, TimeElapsedColumn

from iriftrace.cli.console import notes, out, say, say_finding
from iriftrace.cli.draught_options import DraughtOptions
from iriftrace.cli.field import scene_command
from iriftrace.cli.field_options import AirOptions, PartOptions
from iriftrace.cli.options import (
    Duration,
    Length,
    Pressure,
    Temperature,
    Whole,
    check_folder,
    check_input,
    check_output,
    quantity,
    refuse_given,
    region_temperatures,
)
from iriftrace.cli.simulate_family import family_cases, family_scene, simulate_family
from iriftrace.core.errors import InputError, IriftraceWarning, SetupError
from iriftrace.core.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    from iriftrace.cfd.openfoam.bodies import Body
    from iriftrace.cfd.openfoam.case import Case
    from iriftrace.cfd.openfoam.draught import Draught
    from iriftrace.cfd.openfoam.run import State
    from iriftrace.cfd.openfoam.simulate import Display, Simulation
    from iriftrace.cfd.openfoam.wall import WallTemperatures
    from iriftrace.part.part import Part


@Parameter(name="*", group=Group("Simulation", sort_key=1))
@frozen
class SimulationOptions:
    """Physics, mesh and times of a simulation.

    Parameters
    ----------
    wall_temperature
        Temperature of the part's wall, "1100 degC".
    wall_temperature_from
        File with the temperatures of the wall in its place: a table of x, y, z, T (.csv), such as
        points of a thermogram, or a surface with T (.vtp .vtk .vtu) of a finite element solution.
    wall_length_unit
        Unit of that file's coordinates; by default what it states, else mm.
    wall_temperature_unit
        Unit of its temperatures; by default what it states, else K.
    region_temperature
        Another temperature for a named region of the part, NAME=TEMPERATURE; repeatable.
    transition
        Width over which one wall temperature goes over into another (10 % to 90 %), "10 mm"; by
        default they meet in a line.
    ambient
        Temperature of the air far away.
    pressure
        Air pressure.
    resolution
        How fine the mesh is.
    background_cell
        Edge of the mesh's largest cells in place of that of the resolution, "40 mm"; those at the
        wall have a sixteenth.
    symmetry
        Compute a half or a quarter and mirror it at the part's centre; the field is then exactly
        symmetric, which a real plume is not.
    body
        Another closed surface in the air, such as a table or a support; repeatable. Its unit is
        that of the part, and it may touch the part.
    body_temperature
        Temperature of the bodies' walls, "80 degC", or insulated (the default); one for all, or
        one for each in their order; repeatable.
    floor
        Height z of a floor below the part, at the temperature of the air, "-16 mm".
    margin
        Factor on the air around the part.
    end_time
        Physical time to simulate; by default 2 s, longer for large or cool parts.
    average_time
        Interval before the end over which the density is averaged; by default a quarter.
    snapshots
        States from that interval to keep besides the average, as an ensemble.
    """

    wall_temperature: Temperature | None = None
    wall_temperature_from: Path | None = None
    wall_length_unit: str | None = None
    wall_temperature_unit: Literal["K", "degC"] | None = None
    region_temperature: Annotated[list[str] | None, Parameter(negative=())] = None
    transition: Length = 0.0
    ambient: Temperature = 20.0 + ZERO_CELSIUS_K
    pressure: Pressure = 101325.0
    resolution: Literal["coarse", "normal", "fine", "extra-fine"] = "normal"
    background_cell: Length | None = None
    symmetry: Literal["none", "x", "y", "xy"] = "none"
    body: Annotated[list[Path] | None, Parameter(negative=())] = None
    body_temperature: Annotated[list[str] | None, Parameter(negative=())] = None
    floor: Length | None = None
    margin: float = 1.0
    end_time: Duration | None = None
    average_time: Duration | None = None
    snapshots: Whole = 0

    def case(
        self,
        part: Part,
        processes: int,
        draught: Draught | None,
        mirrors: str | None = None,
    ) -> Case:
        """The case these options describe in a draught, mirrored as they say or at `mirrors`."""
        from iriftrace.cfd.openfoam.case import natural_case

        return natural_case(
            part,
            self.wall(),
            resolution=self.resolution,
            background_mm=self.background_cell,
            end=self.end_time,
            averaging=self.average_time,
            snapshots=self.snapshots,
            ambient_k=self.ambient,
            pressure_pa=self.pressure,
            mirrors=self.mirrors if mirrors is None else mirrors,
            margin=self.margin,
            processes=processes,
            draught=draught,
            bodies=self.bodies(part.length_unit),
            floor=self.floor,
        )

    def wall(self) -> WallTemperatures:
        """Temperatures of the part's wall."""
        from iriftrace.cfd.openfoam.measured_wall import read_measured_wall
        from iriftrace.cfd.openfoam.wall import WallTemperatures, measured_wall

        regions = region_temperatures(self.region_temperature)
        file = self.wall_temperature_from
        if file is not None:
            others = {
                "--wall-temperature": self.wall_temperature,
                "--region-temperature": self.region_temperature,
                "--transition": self.transition or None,
            }
            refuse_given(
                others,
                "and --wall-temperature-from cannot both be given, since the file has the "
                "temperatures of the whole wall; leave one out.",
            )
            units = self.wall_length_unit, self.wall_temperature_unit
            return measured_wall(read_measured_wall(file, *units))
        refuse_given(
            {
                "--wall-length-unit": self.wall_length_unit,
                "--wall-temperature-unit": self.wall_temperature_unit,
            },
            "is a unit of the file of --wall-temperature-from, which is not given; leave it out.",
        )
        if self.wall_temperature is None:
            raise InputError(
                'the part has no temperature; give --wall-temperature "1100 degC", or a file with '
                "--wall-temperature-from."
            )
        return WallTemperatures(self.wall_temperature, regions, self.transition)

    def bodies(self, length_unit: str) -> tuple[Body, ...]:
        """Bodies in the air besides the part, read in its unit."""
        from iriftrace.cfd.openfoam.bodies import Body
        from iriftrace.part.part import read_part

        files = self.body or []
        kelvins = [_body_temperature(text) for text in self.body_temperature or ["insulated"]]
        if len(kelvins) == 1:
            kelvins *= len(files)
        if len(kelvins) != len(files) or (self.body_temperature and not files):
            raise InputError(
                f"--body-temperature is given {len(self.body_temperature or ())} times for "
                f"{len(files)} bodies (--body); give it once for all of them, or once for each."
            )
        return tuple(
            Body(read_part(file, length_unit=length_unit), kelvin)
            for file, kelvin in zip(files, kelvins, strict=True)
        )

    @property
    def mirrors(self) -> str:
        """Axes across which the field is mirrored."""
        return "" if self.symmetry == "none" else self.symmetry


def _body_temperature(text: str) -> float | None:
    return None if text == "insulated" else quantity(text, "kelvin", "--body-temperature")


@contextmanager
def simulation_progress() -> Iterator[Display]:
    """Show the step in hand and, while the solver runs, the state of the flow."""
    from iriftrace.cfd.openfoam.simulate import Display

    bar_column = BarColumn(bar_width=20)
    columns = "{task.description}", bar_column, "{task.fields[flow]}", TimeElapsedColumn()
    # Finished bars would stay on a terminal that only logs.
    with Progress(*columns, console=notes, transient=True) as bar:
        task = bar.add_task("Case", total=None, flow="")

        def watch(state: State) -> None:
            bar.update(task, total=state.end, completed=state.time, flow=flow_text(state))

        yield Display(lambda text: bar.update(task, description=text), _say_expected, watch)


def _say_expected(cells: int, seconds: float) -> None:
    """Say how large the mesh is and how long the solver will take."""
    if seconds > 0.0:
        say(f"{cells:,} cells; the solver takes {duration(seconds)} (right to a factor of two).")


def duration(seconds: float) -> str:
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


def simulate(
    part: Path,
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"])],
    simulation: SimulationOptions = SimulationOptions(),
    wind: DraughtOptions = DraughtOptions(),
    part_options: PartOptions = PartOptions(),
    field: Path | None = None,
    processes: Whole = 1,
    write_only: Annotated[bool, Parameter(negative=())] = False,
) -> None:
    """Simulate the hot air around a part with OpenFOAM and write the field.

    Natural convection of air, laminar, gravity along -z, around the part with the given wall
    temperature. The field's temperature is the one that has the time average of the density, which
    the refractive index follows; beside it the file has the mean velocity and what `iriftrace field
    check` needs for a heat balance. A run that was interrupted goes on when the same command is
    given again. `iriftrace field doctor` checks the OpenFOAM of this machine.

    With ``--draughts`` the folder gets a family: a field for each speed and direction, named so
    that they sort, and family.json, which lists them. They share a mesh, mirror images are not
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
        # Before anything is written: a case is of no use where nothing can run it.
        installation = find_openfoam()
        check_solver(installation)
    hot = part_options
    if hot.expansion is not None and hot.hot_temperature is None:
        # It has expanded as far as its wall is hot.
        hot = evolve(hot, hot_temperature=simulation.wall().hottest)
    measured = hot.read(part)
    if wind.draughts is not None and installation is not None:
        members, cases = family_cases(measured, simulation, wind.family(), processes)
        _print_case(cases[members[0].name])
        simulate_family(members, cases, output, installation, wind)
        say(f"Family written; now run:  {family_scene(members, output, part, simulation, hot)}")
        return
    case = simulation.case(measured, processes, wind.single())
    _print_case(case)
    known = prepare(case, output)
    if installation is None:
        state = "is there already" if known else "written"
        say(f"Case {state}: {output}; the same command without --write-only runs it")
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    if known:
        say(f"Going on with the case in {output}")
    with simulation_progress() as display:
        result = run(case, output, target, installation, display)
    _print_simulation(result, part, hot, simulation)


def doctor() -> None:
    """Find the OpenFOAM of this machine, test whether its solver computes right, say what to do.

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
            warn(far, IriftraceWarning, stacklevel=2)
        return
    table = {name: wall.regions.get(name, wall.default) for name in case.part.region_names}
    for region, kelvin in (table if wall.regions else {"all": wall.default}).items():
        say(f"  wall {region}: {kelvin:.2f} K ({kelvin - ZERO_CELSIUS_K:.0f} degC)")


def _print_simulation(
    result: Simulation, part: Path, part_options: PartOptions, simulation: SimulationOptions
) -> None:
    out.print(
        f"{result.cells:,} cells, {result.seconds:.0f} s; field at the wall within "
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
