"""The commands ``iriftrace field simulate`` and ``iriftrace field doctor``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from iriftrace.cli.checks import check_folder, check_input, check_output
from iriftrace.cli.console import out, working
from iriftrace.cli.options import Whole
from iriftrace.cli.part_options import PartOptions
from iriftrace.cli.simulate_options import SimulationOptions, hot_part
from iriftrace.cli.simulate_progress import simulation_progress
from iriftrace.errors import SetupError
from iriftrace.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    from iriftrace.openfoam.case import Case
    from iriftrace.openfoam.installation import Installation
    from iriftrace.openfoam.simulate import Simulation
    from iriftrace.part import Part


def simulate(
    part: Path,
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"])],
    simulation: SimulationOptions,
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

    Example: ``iriftrace field simulate part.stl -o case --wall-temperature "1100 degC"``

    Parameters
    ----------
    part
        The part's closed surface (.stl .ply .obj .glb ...).
    output
        Folder for the OpenFOAM case.
    field
        File for the field, .vtu; by default field.vtu in the case's folder.
    processes
        Processes for the solver.
    write_only
        Write the case and stop; the same command without this option runs it.
    """
    from iriftrace.openfoam.installation import find_openfoam
    from iriftrace.openfoam.simulate import check_solver, prepare
    from iriftrace.openfoam.simulate import simulate as run

    check_input(part)
    check_folder(output)
    target = output / "field.vtu" if field is None else field
    check_output(target, ".vtu", "field.vtu")
    installation = None
    if not write_only:
        # Before anything is written: a case is of no use where nothing can run it.
        installation = find_openfoam()
        check_solver(installation)
    measured = hot_part(part_options, simulation).read(part)
    case = simulation.case(measured, processes)
    _print_case(case, simulation)
    known = prepare(case, output)
    if installation is None:
        out.print(f"Case {'is there already' if known else 'written'}: {output}", soft_wrap=True)
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    if known:
        out.print(f"Going on with the case in {output}", markup=False, soft_wrap=True)
    with simulation_progress() as display:
        result = run(case, output, target, installation, display)
    _print_simulation(result, case, part)


def doctor(*, mend: Annotated[bool, Parameter(negative=())] = False) -> None:
    """Find the OpenFOAM of this machine, test whether its solvers compute right, say what to do.

    The test are three time steps on a tiny mesh with inclined faces. The solver of Debian 12's
    package fails it: it is miscompiled.

    Example: ``iriftrace field doctor``

    Parameters
    ----------
    mend
        Where the solver computes wrong, build this one program anew from the source of the
        installed package, into your own data folder; the package and apt's lists stay as they are.
    """
    from iriftrace.openfoam.installation import MEND, find_openfoam, mended_solver
    from iriftrace.openfoam.mend import build_solver
    from iriftrace.openfoam.trial import TRIAL_PASSED, try_solver

    installation = find_openfoam()
    _print_finding(True, "OpenFOAM", installation.folder or "on the search path")
    verdict = try_solver(installation)
    _print_solver(installation, verdict)
    if verdict != TRIAL_PASSED and mend:
        target = mended_solver(installation.installed)
        out.print(f"Building it anew as {target}", markup=False, soft_wrap=True)
        with working("Fetching the source and compiling"):
            build_solver(target)
        installation = find_openfoam()
        verdict = try_solver(installation)
        _print_solver(installation, verdict)
    if verdict != TRIAL_PASSED:
        advice = "nor does one that was built anew; install a newer OpenFOAM from openfoam.com"
        raise SetupError(
            "the solver computes wrong, "
            + (advice if mend else f"as that of Debian 12's package does; to mend it: {MEND}.")
        )


def _print_solver(installation: Installation, verdict: str) -> None:
    said = verdict or "three steps on a mesh with inclined faces came out right"
    built = f", built in place of {installation.installed}" if installation.mended else ""
    _print_finding(not verdict, "solver", f"{installation.solver}{built}: {said}")


def _print_finding(good: bool, name: str, text: str) -> None:
    """One line as those of `iriftrace doctor`."""
    state = "[green]ok   [/]" if good else "[red]error[/]"
    out.print(f"{state} [bold]{name}[/]", end="  ")
    out.print(text, markup=False, soft_wrap=True)


def _print_case(case: Case, options: SimulationOptions) -> None:
    from iriftrace.openfoam.symmetry import symmetric_axes

    low, high = case.domain.lower, case.domain.upper
    box = " x ".join(f"{b - a:.0f}" for a, b in zip(low, high, strict=True))
    out.print(
        f"Air {box} mm, cells of {case.size.background:.3g} mm, at the wall "
        f"{case.size.wall:.2g} mm ({case.size.name}); {case.times.end:g} s, density averaged over "
        f"the last {case.times.averaging:g} s.",
        soft_wrap=True,
    )
    for region, kelvin in wall_table(case.part, options, case).items():
        out.print(
            f"  wall {region}: {kelvin:.2f} K ({kelvin - ZERO_CELSIUS_K:.0f} degC)", markup=False
        )
    found = symmetric_axes(case.part)
    if found and not case.mirrors and not case.wall.regions:
        out.print(
            f"The part is symmetric along {' and '.join(found)}: --symmetry {found} computes 1/"
            f"{2 ** len(found)} of the air, if a plume that cannot sway is good enough.",
            soft_wrap=True,
        )


def wall_table(part: Part, options: SimulationOptions, case: Case) -> dict[str, float]:
    """Temperature of each region, K; one entry where all are equal."""
    if not case.wall.regions:
        return {"all": case.wall.default}
    return {name: case.wall.regions.get(name, case.wall.default) for name in part.region_names}


def _print_simulation(result: Simulation, case: Case, part: Path) -> None:
    out.print(
        f"{result.cells:,} cells, {result.seconds:.0f} s; field at the wall within "
        f"{result.wall_error_k:.2f} K of the set temperature"
    )
    steadiness = result.steadiness
    if steadiness is not None:
        out.print(f"Heat flow {steadiness.heat_w:.1f} W; the flow is {steadiness.text}.")
        if not steadiness.steady:
            out.print(
                "The field is the average over a plume that moves: a single exposure sees another "
                "one. --snapshots N keeps single states; --end-time runs on.",
                soft_wrap=True,
            )
    if result.snapshots:
        listed = result.field.with_name(f"{result.field.stem}_snapshots.pvd")
        out.print(f"{len(result.snapshots)} snapshots: {listed}", markup=False, soft_wrap=True)
    out.print(
        f"Field written; now run:  iriftrace scene {result.field} {part} -o scene/scene.xml",
        markup=False,
        soft_wrap=True,
    )
