"""``iriftrace field simulate`` and ``doctor`` without running OpenFOAM."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
import trimesh

from iriftrace.cli import main
from iriftrace.cli.simulation_progress import simulation_progress
from iriftrace.flow.simulate import programs as installation
from iriftrace.flow.simulate.run import Cost, State

WALL = "--wall-temperature=1100 degC"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user's folder with a part, on a machine without OpenFOAM."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(installation, "_BASHRCS", ())
    trimesh.creation.box((60.0, 30.0, 20.0)).export(tmp_path / "part.stl")
    open_box = trimesh.creation.box((60.0, 30.0, 20.0))
    open_box.update_faces([True] * 11 + [False])
    open_box.export(tmp_path / "open.stl")
    return tmp_path


def test_case_is_written_without_openfoam(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """And the program says what it will be: air, cells, times, temperatures of the regions."""
    words = ["part.stl", "-o", "case", WALL, "--region-temperature=* +z*=450 degC"]
    assert main(["field", "simulate", *words, "--transition=5mm", "--write-only"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert re.search(r"wall plane \+z \(z [\d.]+ mm\): 723.15 K \(450 degC\)", said)
    assert re.search(r"wall plane -x \(x -[\d.]+ mm\): 1373.15 K", said)
    assert "normal (B)" in said
    assert "--symmetry xy computes 1/4" in said
    assert (folder / "case/system/controlDict").is_file()
    assert main(["field", "simulate", *words, "--transition=5mm", "--write-only"]) == 0
    assert "already exists" in capsys.readouterr().out


def test_the_expected_time_is_said_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    with simulation_progress() as display:
        for seconds in (20.0, 170.0, 90_000.0, 0.0):
            display.expect(Cost(22.0, 12_636, seconds))
    said = capsys.readouterr().out.splitlines()
    assert [line.partition("takes ")[2] for line in said] == [
        f"{time} (right to a factor of two)."
        for time in ("a minute or two", "some 3 minutes", "25 hours")
    ]


def test_a_long_run_names_the_option_that_shortens_it(capsys: pytest.CaptureFixture[str]) -> None:
    with simulation_progress() as display:
        display.expect(Cost(19.0, 323_610, 2400.0, Cost(30.0, 129_804, 610.0)))
    said = " ".join(capsys.readouterr().out.split())
    assert said == (
        "323,610 cells; the solver takes some 40 minutes (right to a factor of two). In another "
        'folder, --background-cell "30 mm" instead of 19 mm takes some 10 minutes with about '
        "130,000 cells."
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ((), "no OpenFOAM on this machine"),
        (("--wall-temperature=1100 mm",), "--wall-temperature"),
        (("--wall-temperature=10 degC",), "hotter than the air"),
        (("--region-temperature=tooth=450 degC",), 'no region "tooth"; its regions are'),
        (("--region-temperature=450 degC",), "NAME=TEMPERATURE"),
        (("--transition=5 K",), "--transition"),
        (("--transition=5 mm",), "two temperatures"),
        (("--resolution=finest",), "finest"),
        (("--background-cell=500 mm",), "lose its shape"),
        (("--end-time=-1 s",), "end time"),
        (("--end-time=1 s", "--average-time=2 s"), "averaged over 2 s of 1 s"),
        (("--snapshots=-2",), "snapshots"),
        (("--snapshots=1.5",), "whole number"),
        (("--processes=0",), "as 0 processes"),
        (("--margin=nan",), "margin of nan"),
        (("--field=field.vtk",), "must end in .vtu"),
        (("--pressure=1 mbar",), "air pressure of 100 Pa"),
        (("--ambient=0 K",), "ambient temperature of 0 K"),
        (("--ambient", "-300 degC"), "below absolute zero"),
        (("--background-cell=0.01 mm",), "background cells of 0.01 mm"),
        (("--background-cell=0.01 mm",), "symmetric (--background-cell)"),
        (("--snapshots=100000",), "100000 snapshots cannot be kept"),
    ],
)
def test_wrong_input_is_one_sentence(
    folder: Path, fails: Callable[..., str], options: tuple[str, ...], message: str
) -> None:
    wall = () if any(o.startswith("--wall-temp") for o in options) else (WALL,)
    write_only = ("--write-only",) if options else ()
    assert message in fails(
        "field", "simulate", "part.stl", "-o", "case", *wall, *options, *write_only
    )


@pytest.mark.parametrize(
    ("part", "message"), [("open.stl", "is not closed"), ("none.stl", "no file none.stl")]
)
def test_open_and_missing_parts_are_refused(
    folder: Path, fails: Callable[..., str], part: str, message: str
) -> None:
    assert message in fails("field", "simulate", part, "-o", "case", WALL, "--write-only")


def test_doctor_says_how_to_get_openfoam(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["field", "doctor"]) == 2
    assert "make openfoam" in capsys.readouterr().err


def test_an_interrupted_run_says_how_far_it_is() -> None:
    def run(*states: State) -> None:
        with simulation_progress() as display:
            for state in states:
                display.watch(state)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match=r"1\.78 of 2\.33 s; give the same .* from 1\.74 s"):
        run(State(0.5, 2.33, None, None, 0.0), State(1.78, 2.33, None, None, 1.74))
    with pytest.raises(KeyboardInterrupt, match="finished steps are kept; give the same command"):
        run()
