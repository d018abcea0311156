"""Going on with a run, and judging whether it stands still; the solver here only writes files."""

import os
import shutil
import stat
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from attrs import astuple, evolve

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.flow.simulate.case import Case
from iriftrace.flow.simulate.case_files import write_case
from iriftrace.flow.simulate.domain import MeshSize, mesh_size
from iriftrace.flow.simulate.draught import Draught
from iriftrace.flow.simulate.options import SimulationOptions
from iriftrace.flow.simulate.programs import Installation, OpenFoamError, run_program
from iriftrace.flow.simulate.run import (
    cost_of,
    expected_seconds,
    judge_steadiness,
    last_time,
    solve,
)
from iriftrace.flow.simulate.times import Times
from iriftrace.io.part_files import read_part
from iriftrace.part.part import part_of_mesh
from iriftrace.part.wall_temperature import WallTemperatures
from iriftrace.scenes import folder_of

FILES = (
    *("T", "U", "p", "p_rgh", "phi", "uniform/time", "rhoMean", "UMean", "rhoUMean"),
    "uniform/functionObjects/functionObjectProperties",
)
# Notes when it starts and whether it averages, and writes the state at the end time.
SOLVER = """#!/bin/sh
cd case
end=$(sed -n 's/^endTime *\\([^;]*\\);/\\1/p' system/controlDict)
start=$(sed -n 's/^startTime *\\([^;]*\\);/\\1/p' system/controlDict)
grep -q fieldAverage system/controlDict && kind=mean || kind=plain
ls */*Mean >/dev/null 2>&1 && kind="$kind+old"
echo "$start $end $kind" >> runs
mkdir -p "$end/uniform/functionObjects"
for f in {files}; do echo '// **** //' > "$end/$f"; done
"""

TWO = SimulationOptions(processes=2)


def test_the_expected_time_is_that_of_three_runs_to_a_factor_of_two(case: Case) -> None:
    """The solver's clock on one core: a cylinder's quarter, a sphere's, a whole gear."""
    mesh = trimesh.creation.icosphere(4, 25.0)
    sphere = part_of_mesh(mesh.vertices, mesh.faces, name="sphere")
    gear = read_part(folder_of("bevel_gear") / "part.ply")
    sizes = [mesh_size("coarse", np.ptp(part.bounds, axis=0)) for part in (sphere, gear)]
    warm = Case(sphere, WallTemperatures(873.15), sizes[0], Times(0.8, 0.2), mirrors="xy")
    hot = Case(gear, WallTemperatures(1373.15), sizes[1], Times(0.3, 0.1))
    for one, cells, seconds in ((case, 28_556, 110), (warm, 12_636, 22), (hot, 93_108, 114)):
        assert 0.5 < expected_seconds(one, cells) / seconds < 2.0
    # What is known already takes no time, and two processes half of it.
    found = expected_seconds(hot, 93_108)
    assert expected_seconds(hot, 93_108, since=0.2) == pytest.approx(found / 3)
    assert expected_seconds(
        evolve(hot, options=SimulationOptions(processes=2)), 93_108
    ) == pytest.approx(found / 2)


def test_a_draught_takes_time(case: Case) -> None:
    """Of 3 m/s, across air that rises above a wall of 1100 degC."""
    still = evolve(case, mirrors="")
    blown = evolve(still, draught=Draught(3.0, (0.0, 1.0, 0.0)))
    height = still.domain.kept_upper[2] - case.part.bounds[1][2]
    rise = np.sqrt(9.80665e-3 * height * (1.0 - 293.15 / 1373.15))
    expected = np.hypot(rise, 3.0) / rise
    assert expected_seconds(blown, 90_000) == pytest.approx(
        expected * expected_seconds(still, 90_000)
    )
    assert expected > 2.0


def test_a_long_run_has_a_coarser_mesh_of_ten_minutes(case: Case) -> None:
    """Eight times as long as 10 minutes: cells twice as large, a quarter of their number."""
    fine = evolve(case, size=MeshSize("fine", 10.0))
    cost = cost_of(fine, 400_000, 4800.0)
    assert cost.coarser is not None
    assert astuple(cost.coarser) == pytest.approx((20.0, 100_000, 600.0, None))
    assert cost_of(fine, 400_000, 900.0).coarser is None, "short enough"
    assert cost_of(fine, 400_000, 4800.0, continued=True).coarser is None, "it has begun"


def test_a_coarser_mesh_is_still_a_useful_one(case: Case) -> None:
    """Twice the coarse resolution at most, whose cells are 22 mm; then the run takes longer."""
    coarse = evolve(case, size=MeshSize("coarse (A)", 22.0))
    cost = cost_of(coarse, 400_000, 48_000.0)
    assert cost.coarser is not None
    assert astuple(cost.coarser) == pytest.approx((44.0, 100_000, 6000.0, None))
    assert cost_of(evolve(case, size=MeshSize("", 42.0)), 400_000, 48_000.0).coarser is None


@pytest.fixture
def folder(case: Case, tmp_path: Path) -> Path:
    write_case(case, tmp_path / "case")
    return tmp_path / "case"


@pytest.fixture
def foam(tmp_path: Path) -> Installation:
    solver = tmp_path / "solver"
    solver.write_text(SOLVER.replace("{files}", " ".join(FILES)))
    solver.chmod(solver.stat().st_mode | stat.S_IXUSR)
    environment = {"PATH": "/usr/bin:/bin"}
    return Installation("", str(solver), str(solver), environment)


def runs(folder: Path) -> list[str]:
    return (folder / "runs").read_text().splitlines()


def test_programs_see_a_path_that_openfoam_accepts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It refuses blanks and quotation marks in -case, in its folder, and in the shell's PWD."""
    folder = tmp_path / 'Kern\'s "heißer" teil'
    folder.mkdir()
    monkeypatch.setenv("PWD", str(folder))
    program = tmp_path / "blockMesh"
    program.write_text(
        f"#!{sys.executable}\nimport os, sys\n"
        "open('case/written', 'w')\n"
        "print(os.environ['PWD'], os.getcwd(), os.path.abspath(sys.argv[-1]), sep='|')\n"
    )
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    environment = {**os.environ, "PATH": f"{tmp_path}:/usr/bin:/bin"}
    log = run_program(Installation("", "", "", environment), folder, "blockMesh")
    assert log.parent == folder
    assert (folder / "written").is_file()
    assert not set(" '\"ß") & set(log.read_text())
    shell, own, case = log.read_text().strip().split("|")
    assert shell == own == str(Path(case).parent)
    assert not Path(case).exists(), "the link is temporary"


def test_settles_first_and_averages_then(case: Case, folder: Path, foam: Installation) -> None:
    assert solve(case, folder, foam, lambda state: None) == pytest.approx(0.5)
    assert runs(folder) == ["0 1.5 plain", "1.5 2.0 mean"]


def test_flow_that_stands_still_is_solved_once_a_step(
    case: Case, folder: Path, foam: Installation
) -> None:
    """Heat and plume were still for as long as is averaged; before there was more heat."""

    def series(name: str, values: np.ndarray) -> None:
        file = folder / "postProcessing" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        np.savetxt(file, np.column_stack((np.linspace(0.0, 1.5, 151), values)), header="Time")

    solution = folder / "system/fvSolution"
    series("plume/0/T", np.full(151, 600.0))
    series("heat/0/surfaceFieldValue.dat", np.repeat((90.0, 70.0), (95, 56)))
    solve(case, folder, foam, lambda state: None)
    assert "nOuterCorrectors 1;" in solution.read_text()
    series("heat/0/surfaceFieldValue.dat", np.repeat((90.0, 70.0), (105, 46)))
    shutil.rmtree(folder / "2.0")
    (folder / "averaging.json").unlink()
    solve(case, folder, foam, lambda state: None)
    assert "nOuterCorrectors 3;" in solution.read_text()


def test_finished_run_is_not_run_again(case: Case, folder: Path, foam: Installation) -> None:
    for _ in range(2):
        assert solve(case, folder, foam, lambda state: None) == pytest.approx(0.5)
    assert len(runs(folder)) == 2


def test_later_end_goes_on_and_averages_anew(case: Case, folder: Path, foam: Installation) -> None:
    """A mean over another interval must not be mixed into the new one."""
    solve(case, folder, foam, lambda state: None)
    later = evolve(case, times=Times(3.0, 0.25))
    assert solve(later, folder, foam, lambda state: None) == pytest.approx(0.25)
    assert runs(folder)[2:] == ["2 2.75 plain+old", "2.75 3.0 mean"]


def test_killed_while_averaging_goes_on_with_the_mean(
    case: Case, folder: Path, foam: Installation
) -> None:
    """From the last state that is whole: one that breaks off does not count."""
    solve(case, folder, foam, lambda state: None)
    (folder / "2.0").rename(folder / "1.75")
    (folder / "1.875").mkdir()
    (folder / "1.875" / "T").write_text("FoamFile { version 2.0; }")
    assert last_time(folder) == 1.75
    assert solve(case, folder, foam, lambda state: None) == pytest.approx(0.5)
    assert runs(folder)[2:] == ["1.75 2.0 mean+old"]


def test_killed_before_the_means_were_written_goes_on_from_the_state_before(
    case: Case, folder: Path, foam: Installation
) -> None:
    """Where the solver would begin another average; before averaging no state has means."""
    solve(case, folder, foam, lambda state: None)
    shutil.copytree(folder / "2.0", folder / "1.75")
    (folder / "2.0/uniform/functionObjects/functionObjectProperties").unlink()
    assert last_time(folder) == 1.75
    assert solve(case, folder, foam, lambda state: None) == pytest.approx(0.5)
    assert runs(folder)[-1] == "1.75 2.0 mean+old"
    shutil.rmtree(folder / "1.75")
    shutil.rmtree(folder / "2.0")
    assert last_time(folder) == 1.5


def test_what_a_finished_run_cannot_give_is_refused(
    case: Case, folder: Path, foam: Installation
) -> None:
    solve(case, folder, foam, lambda state: None)
    for times, message in (
        (Times(2.0, 1.0), "already come to 2 s"),
        (Times(1.0, 0.5), "already come to 2 s"),
        (Times(2.0, 0.5, 5), "keeps 0 snapshots, not 5"),
    ):
        with pytest.raises(InputError, match=message):
            solve(evolve(case, times=times), folder, foam, lambda state: None)
    with pytest.raises(InputError, match="started with one process"):
        solve(evolve(case, options=TWO), folder, foam, lambda state: None)


def test_solver_that_dies_is_named_with_its_reason(
    case: Case, folder: Path, foam: Installation
) -> None:
    reason = "Maximum number of iterations exceeded"
    Path(foam.solver).write_text(
        f"#!/bin/sh\nprintf -- '--> FOAM FATAL ERROR: \\n{reason}\\n\\n'; exit 1\n"
    )
    with pytest.raises(OpenFoamError, match=f"{reason}.*log.buoyantPimpleFoam"):
        solve(case, folder, foam, lambda state: None)


def test_still_and_moving_flows_are_told_apart(case: Case, tmp_path: Path) -> None:
    """Within 2 % of heat and 1 % of the heating (10.8 K) at all points in the plume; the heat is
    that of all four quarters."""
    time = np.linspace(0.0, 2.0, 201)
    late = time > 0.995

    def judged(heat: np.ndarray, plume: np.ndarray) -> tuple[float, bool]:
        for name, rows in (
            ("heat/0/surfaceFieldValue.dat", np.column_stack((time, heat))),
            ("plume/0/T", np.column_stack((time, np.full_like(time, 293.15), plume))),
        ):
            file = tmp_path / "postProcessing" / name
            file.parent.mkdir(parents=True, exist_ok=True)
            np.savetxt(file, rows, header="Time")
        found = judge_steadiness(case, tmp_path, (1.0, 2.0))
        assert found is not None
        assert ("NOT STEADY" in found.text) is not found.steady
        return found.heat_w, found.steady

    settling = np.where(late, 70.0, 200.0)
    assert judged(settling, np.full_like(time, 600.0)) == (pytest.approx(280.0), True)
    wave = np.sin(20.0 * time)
    assert judged(settling, 600.0 + 5.0 * wave)[1]
    assert not judged(settling, 600.0 + 6.0 * wave)[1]
    assert judged(settling * (1 + 0.009 * wave), np.full_like(time, 600.0))[1]
    assert not judged(settling * (1 + 0.012 * wave), np.full_like(time, 600.0))[1]


def test_too_little_to_judge(case: Case, tmp_path: Path) -> None:
    assert judge_steadiness(case, tmp_path, (0.0, 1.0)) is None


def test_a_run_past_the_beginning_says_what_it_averages(
    case: Case, folder: Path, foam: Installation
) -> None:
    """A finished run of 2 s goes on to 2.2 s: 0.2 s are left of the 0.55 s requested."""
    solve(case, folder, foam, lambda state: None)
    later = evolve(case, times=Times(2.2, 0.55))
    sentence = r"over the last 0\.2 s, not 0\.55 s; give .* of 0\.55 s and an end time of 2\.55 s"
    for _ in range(2):
        with pytest.warns(IriftraceWarning, match=sentence):
            assert solve(later, folder, foam, lambda state: None) == pytest.approx(0.2)
    assert runs(folder)[2:] == ["2 2.2 mean"]


def test_snapshots_of_a_run_past_the_beginning_are_refused(
    case: Case, folder: Path, foam: Installation
) -> None:
    """Before the former average is dropped: with its own times the run is still a finished one."""
    solve(case, folder, foam, lambda state: None)
    later = evolve(case, times=Times(2.2, 0.55, 4))
    with pytest.raises(InputError, match=r"an end time of 2\.55 s or more") as error:
        solve(later, folder, foam, lambda state: None)
    assert error.value.code == "case.snapshots_too_late"
    assert (folder / "2.0/rhoMean").is_file()
    assert solve(case, folder, foam, lambda state: None) == 0.5
    enough = evolve(case, times=Times(2.55, 0.55, 4))
    assert solve(enough, folder, foam, lambda state: None) == pytest.approx(0.55)
