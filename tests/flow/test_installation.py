"""Finding OpenFOAM, telling a solver that computes wrong, and what the user is told."""

import stat
from pathlib import Path

import pytest

from iriftrace.cli import main
from iriftrace.core.errors import SetupError
from iriftrace.flow.simulate import programs as installation
from iriftrace.flow.simulate.programs import SOLVER, TOOLS, find_openfoam, repaired_solver
from iriftrace.flow.simulate.solver_check import judge, try_solver

STEPS = """\
Courant Number mean: 0 max: {0}
Time = 0.0001

Courant Number mean: 0 max: {1}
Time = 0.0002

Courant Number mean: 0 max: {2}
Time = 0.0003

End
"""


@pytest.fixture
def programs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A search path with programs of our own, and a home of our own."""
    folder = tmp_path / "bin"
    folder.mkdir()
    for name in (*TOOLS, SOLVER):
        program(folder / name, "exit 0")
    monkeypatch.setenv("PATH", f"{folder}:/usr/bin:/bin")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(installation, "_BASHRCS", ())
    return folder


def program(path: Path, script: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)


def test_programs_on_the_search_path_are_found(programs: Path) -> None:
    found = find_openfoam()
    assert found.solver == found.installed == str(programs / SOLVER)
    assert not found.repaired
    assert found.program("blockMesh") == str(programs / "blockMesh")


def test_repaired_solver_takes_the_place_of_the_one_it_was_built_for(programs: Path) -> None:
    """And no longer after an upgrade, when another program is installed."""
    program(repaired_solver(str(programs / SOLVER)), "exit 0")
    assert find_openfoam().repaired
    program(programs / SOLVER, "echo newer")
    assert not find_openfoam().repaired


def test_no_openfoam(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(installation, "_BASHRCS", ())
    with pytest.raises(SetupError, match=r"no OpenFOAM on this machine.*make openfoam"):
        find_openfoam()


def test_missing_program_is_named(programs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (programs / "snappyHexMesh").unlink()
    monkeypatch.setenv("PATH", str(programs))
    with pytest.raises(SetupError, match="has no snappyHexMesh"):
        find_openfoam()


def test_openfoam_beside_the_search_path(
    programs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The packages of openfoam.com have to be sourced; the newest one is taken."""
    for version in ("2306", "2312"):
        bashrc = tmp_path / f"openfoam{version}/etc/bashrc"
        bashrc.parent.mkdir(parents=True)
        bashrc.write_text(
            f"export WM_PROJECT_DIR={tmp_path}/openfoam{version}\nexport PATH={programs}:$PATH\n"
        )
    monkeypatch.setattr(installation, "_BASHRCS", (f"{tmp_path}/openfoam*/etc/bashrc",))
    monkeypatch.setattr(installation, "_which", without(programs))
    found = find_openfoam()
    assert found.folder.endswith("openfoam2312")
    assert found.solver == str(programs / SOLVER)


def without(folder: Path):
    """Find programs as the shell does, but on the inherited search path none of the folder's."""
    plain = installation._which

    def which(name: str, environment: dict[str, str]) -> str | None:
        found = plain(name, environment)
        sourced = environment.get("WM_PROJECT_DIR", "").startswith(str(folder.parent))
        return found if sourced or found is None or folder not in Path(found).parents else None

    return which


def test_garbage_velocities_are_told_from_right_ones() -> None:
    assert judge(STEPS.format(0, 0.006, 0.009)) == ""
    assert "Courant number of 412" in judge(STEPS.format(0, 0.006, 412))
    assert "Courant number of nan" in judge(STEPS.format(0, "nan", "nan"))
    assert "did not finish" in judge(STEPS.format(0, 0, 0).partition("Time = 0.0003")[0])
    assert "did not finish" in judge("")


def test_solver_that_dies_fails_the_trial_each_time(programs: Path) -> None:
    program(programs / SOLVER, "echo sigFpe; exit 136")
    found = find_openfoam()
    for _ in range(2):
        assert "stopped in the first time steps" in try_solver(found)


def test_solver_that_passed_is_not_tried_again(programs: Path) -> None:
    """Known by its content: a changed program is tried anew."""
    good = STEPS.format(0, 0.006, 0.009).replace("\n", "\\n")
    program(programs / SOLVER, f"echo run >> {programs}/runs; printf '{good}'")
    found = find_openfoam()
    assert try_solver(found) == try_solver(found) == ""
    assert (programs / "runs").read_text() == "run\n"
    program(programs / SOLVER, "exit 136")
    assert try_solver(found) != ""


def test_doctor_says_what_repairs_a_wrong_solver(
    programs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    program(programs / SOLVER, "exit 136")
    assert main(["field", "doctor"]) == 2
    said = capsys.readouterr()
    assert "stopped in the first time steps" in said.out
    assert "make openfoam" in said.err


def test_doctor_tries_the_repaired_solver_like_any_other(
    programs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    good = STEPS.format(0, 0.006, 0.009).replace("\n", "\\n")
    program(programs / SOLVER, "exit 136")
    for script, code in (("exit 136", 2), (f"printf '{good}'", 0)):
        program(repaired_solver(str(programs / SOLVER)), script)
        assert main(["field", "doctor"]) == code
        assert "built in place of" in capsys.readouterr().out
