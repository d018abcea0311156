"""Commands with fields of every kind: what they say and write, and their errors."""

import json
from pathlib import Path

import numpy as np
import pytest

from iriftrace.cli import main
from validation.field_files import comsol
from validation.field_files.openfoam import write_case
from validation.inputs.hot_block import AMBIENT, air, block, patches


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The hot block as an OpenFOAM case with two times and as COMSOL's scattered points."""
    grid = air(12)
    kelvin = np.asarray(grid.point_data["T"], dtype=np.float64)
    points = np.asarray(grid.points, dtype=np.float64)
    states = {f"T (degC) @ t={t}": kelvin - 273.15 + t * (kelvin > 400) for t in (1, 2)}
    comsol.spreadsheet(tmp_path / "points.txt", points / 1e3, states, length_unit="m")
    block().export(tmp_path / "part.stl")
    cells = np.asarray(grid.point_data_to_cell_data().cell_data["T"], dtype=np.float64)
    grid.points = points / 1e3
    fields = {time: {"T": cells} for time in ("1", "2")}
    write_case(tmp_path / "case", grid, fields, patches(outside=AMBIENT))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def field_of(folder: Path) -> dict[str, object]:
    """What the table of the shells says of the field."""
    table = json.loads((folder / "shells" / "shells.json").read_text())
    source: dict[str, object] = table["source"]
    return source


def test_shells_from_a_case_at_a_chosen_time(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["shells", "case", "-o", "shells", "--layers=2", "--part=part.stl", "--time=1"]
    assert main(command) == 0
    said = capsys.readouterr()
    assert said.err == ""
    assert "field read in m" in " ".join(said.out.split())
    assert field_of(folder)["origin"] == "OpenFOAM buoyantPimpleFoam, t = 1 s"


def test_shells_from_scattered_points_with_their_part(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main("shells points.txt -o shells --layers=2 --part part.stl".split()) == 0
    assert "2 states; the last one, t=2, is used" in " ".join(capsys.readouterr().err.split())
    source = field_of(folder)
    assert source["length_unit"] == "m"
    assert source["origin"] == "COMSOL 6.2.0.415, model part.mph, t=2"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("case --time=3", "no state '3': it has t = 1; t = 2 (--time)."),
        ("points.txt --time=1", "(sectionwise format) (--part)."),
        ("points.txt --part part.stl --temperature-unit K", "is in degC, but"),
        ("case --field-length-unit mm", "in mm after all (--field-length-unit)."),
        (". --time=1", "is not an OpenFOAM case"),
        ("part.stl", "not a field file of a known format"),
        ("case --time=1 --isosurfaces", "iso-surfaces is read as a whole"),
    ],
)
def test_wrong_input(
    folder: Path, capsys: pytest.CaptureFixture[str], options: str, words: str
) -> None:
    assert main(["shells", *options.split(), "-o", "shells", "--layers=2"]) == 2
    (line,) = [
        line for line in capsys.readouterr().err.splitlines() if not line.startswith("warning:")
    ]
    assert words in line
    assert not (folder / "shells").exists()


def test_options_that_a_command_does_not_have_are_those_of_another(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["view", "points.txt", "-o", "a.png"]) == 2
    said = capsys.readouterr().err
    assert "choose another if that is not meant (--time of iriftrace scene)." in said
    assert "(sectionwise format) (--part of iriftrace scene)." in said
    assert main(["view", "part.stl", "-o", "a.png", "--length-unit", "um"]) == 0
    assert "check length_unit (--length-unit)." in capsys.readouterr().err
