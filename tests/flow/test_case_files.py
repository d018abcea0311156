"""Contents of the files of a case, read back as facts and not as text."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
import trimesh
from attrs import evolve

from iriftrace.core.errors import InputError
from iriftrace.flow.simulate.case import RECORD, Case
from iriftrace.flow.simulate.case_files import (
    nonuniform,
    write_case,
    write_control,
    write_decomposition,
    write_start,
)
from iriftrace.flow.simulate.domain import mesh_size
from iriftrace.flow.simulate.options import SimulationOptions
from iriftrace.flow.simulate.simulate import prepare
from iriftrace.flow.simulate.times import Times
from iriftrace.part.part import Part
from iriftrace.part.wall_temperature import WallTemperatures
from validation.field_files.openfoam import entry
from validation.inputs.parts import part_from

WALL = 1373.15
NUMBER = r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?"


@pytest.fixture
def written(case: Case, tmp_path: Path) -> Path:
    write_case(case, tmp_path)
    return tmp_path


def numbers(text: str) -> list[float]:
    return [float(word) for word in re.findall(NUMBER, text)]


def test_braces_and_brackets_are_closed(written: Path) -> None:
    """Otherwise OpenFOAM refuses the file, and no template leaves anything unfilled."""
    files = [p for p in written.rglob("*") if p.is_file() and p.suffix != ".stl"]
    assert len(files) == 15
    for file in files:
        text = file.read_text()
        for opening, closing in ("{}", "()", "[]"):
            assert text.count(opening) == text.count(closing), file
        assert "{{" not in text.replace("{ {", "")
        assert "None" not in text


def test_block_is_the_domain_in_millimetres(case: Case, written: Path) -> None:
    text = (written / "system/blockMeshDict").read_text()
    corners = np.array(numbers(text[text.index("vertices") : text.index("blocks")])).reshape(-1, 3)
    assert corners.min(axis=0) == pytest.approx(case.domain.lower)
    assert corners.max(axis=0) == pytest.approx(case.domain.upper)
    assert entry(written / "system/blockMeshDict", "scale") == "0.001"
    assert re.search(r"xmin \{ type symmetryPlane;", text)
    assert re.search(r"top \{ type patch;", text)


def test_everything_for_the_mesher_is_in_metres(case: Case, written: Path) -> None:
    """The surface is the part, the boxes hold it, and the point in the air is the domain's."""
    surface = pv.read(written / "constant/triSurface/part.stl")
    assert surface.n_cells == len(case.part.faces)
    bounds = np.array(surface.bounds).reshape(3, 2).T
    assert bounds * 1000.0 == pytest.approx(case.part.bounds, abs=1e-4)
    text = (written / "system/snappyHexMeshDict").read_text()
    inside = numbers(re.search(r"locationInMesh \(([^)]*)\)", text)[1])
    assert np.array(inside) * 1000.0 == pytest.approx(case.domain.point_in_air)
    boxes = re.findall(r"searchableBox; min \(([^)]*)\); max \(([^)]*)\)", text)
    assert len(boxes) == len(case.domain.boxes)
    low, high = (np.array(numbers(corner)) * 1000.0 for corner in boxes[0])
    assert (low < case.part.bounds[0]).all()
    assert (high > case.part.bounds[1]).all()


def test_air_and_wall_have_the_temperatures_asked_for(case: Case, tmp_path: Path) -> None:
    write_case(
        evolve(case, options=SimulationOptions(ambient="30 degC", pressure="950 hPa")), tmp_path
    )
    temperature = (tmp_path / "0/T").read_text()
    assert entry(tmp_path / "0/T", "internalField") == "uniform 303.15"
    assert numbers(re.search(r"part \{([^}]*)\}", temperature)[1]) == [WALL]
    assert entry(tmp_path / "0/p_rgh", "internalField") == "uniform 95000.0"
    assert "p0 uniform 95000.0" in (tmp_path / "0/p_rgh").read_text()


def test_gravity_points_down_from_the_outlet(case: Case, written: Path) -> None:
    level = float(entry(written / "constant/hRef", "dimensions .*; value"))
    assert level * 1000.0 == pytest.approx(case.domain.upper[2])
    assert numbers((written / "constant/g").read_text().split("value")[1]) == [0.0, 0.0, -9.81]


def test_temperature_for_each_face_of_the_wall(case: Case, tmp_path: Path) -> None:
    (tmp_path / "0").mkdir()
    kelvins = np.array([723.15, 1000.0, 1373.15])
    write_start(case, tmp_path, nonuniform(kelvins))
    text = (tmp_path / "0/T").read_text()
    found = re.search(
        r"part \{ type fixedValue; value nonuniform List<scalar>\s+3\s+\(([^)]*)\)", text
    )
    assert numbers(found[1]) == kelvins.tolist()


def test_stages_of_the_run(case: Case, tmp_path: Path) -> None:
    """First without averaging to 1.5 s, then with it to 2 s; both leave states to go on from."""
    (tmp_path / "system").mkdir()
    file = tmp_path / "system/controlDict"
    write_control(case, tmp_path, averaging=False)
    assert float(entry(file, "endTime")) == 1.5
    assert "fieldAverage" not in file.read_text()
    assert float(entry(file, "writeInterval")) == 1.5 / 4
    write_control(evolve(case, times=Times(2.0, 0.5, 10)), tmp_path, averaging=True, start=1.5)
    assert float(entry(file, "startTime")) == 1.5
    assert float(entry(file, "endTime")) == 2.0
    assert "rho { mean on" in file.read_text()
    assert float(entry(file, "writeInterval")) == pytest.approx(0.05)
    assert int(entry(file, "purgeWrite")) > 10


@pytest.mark.parametrize(
    ("start", "averaging", "snapshots", "interval"),
    [
        # Of a run that had come to its end, 2 or 3.2 s, before a later one was given.
        (2.0, False, 0, 0.5),
        (3.2, True, 0, 0.2),
        # Of an interrupted one, whose time on disk is rounded.
        (2.25, False, 0, 0.75),
        (3.333333333, True, 6, 1.0 / 6.0),
    ],
)
def test_a_run_that_is_continued_leaves_a_state_at_its_end(
    case: Case, tmp_path: Path, start: float, averaging: bool, snapshots: int, interval: float
) -> None:
    """The solver counts the intervals of its states from where it starts."""
    (tmp_path / "system").mkdir()
    later = evolve(case, times=Times(4.0, 1.0, snapshots))
    write_control(later, tmp_path, averaging=averaging, start=start)
    found = float(entry(tmp_path / "system/controlDict", "writeInterval"))
    assert found == pytest.approx(interval, rel=1e-6)
    left = ((4.0 if averaging else 3.0) - start) / found
    assert left == pytest.approx(round(left), abs=1e-6)


@pytest.mark.parametrize("processes", [1, 2, 6, 7, 12, 64])
def test_mesh_is_cut_into_as_many_pieces_as_there_are_processes(
    tmp_path: Path, processes: int
) -> None:
    (tmp_path / "system").mkdir()
    write_decomposition(tmp_path, processes)
    file = tmp_path / "system/decomposeParDict"
    assert int(entry(file, "numberOfSubdomains")) == processes
    slices = numbers(re.search(r"n \(([^)]*)\)", file.read_text())[1])
    assert np.prod(slices) == processes


def test_same_case_goes_on_and_another_one_is_refused(case: Case, tmp_path: Path) -> None:
    folder = tmp_path / "case"
    assert not prepare(case, folder)
    assert prepare(evolve(case, times=Times(3.0, 1.0)), folder), "a later end is the same case"
    with pytest.raises(InputError, match="differs in wall_k"):
        prepare(evolve(case, wall=WallTemperatures(1000.0)), folder)
    assert json.loads((folder / RECORD).read_text())["wall_k"] == WALL


def test_a_case_whose_writing_was_interrupted_is_written_again(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as interrupted:
        interrupted.setattr("iriftrace.flow.simulate.case_files.write_start", None)
        with pytest.raises(TypeError):
            prepare(case, tmp_path / "case")
    assert not prepare(case, tmp_path / "case")
    assert prepare(case, tmp_path / "case")


@pytest.mark.parametrize("damage", ["", "{", "[1]"])
def test_damaged_record_is_refused(case: Case, tmp_path: Path, damage: str) -> None:
    (tmp_path / RECORD).write_text(damage)
    with pytest.raises(InputError, match=f"{RECORD} cannot be read"):
        prepare(case, tmp_path)


def test_folder_of_somebody_else_is_not_touched(case: Case, tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(InputError, match="not a case of iriftrace"):
        prepare(case, tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]


def test_impossible_cases_are_refused(case: Case, cylinder: Part, halves: Part) -> None:
    tilted = trimesh.transformations.rotation_matrix(0.5, (0, 0, 1))
    for changes, message in (
        ({"part": cylinder.transformed(tilted)}, "not symmetric about x"),
        ({"part": evolve(cylinder, closed=False)}, "is not closed"),
        ({"mirrors": "z"}, 'no symmetry "z"'),
        (
            {"wall": WallTemperatures(WALL, {"head +x": 723.15}), "mirrors": "x"},
            "temperatures are not symmetric about x",
        ),
    ):
        with pytest.raises(InputError, match=message):
            evolve(case, **changes)
    # Mirrored across the line between the heads, the same temperatures are symmetric.
    evolve(case, wall=WallTemperatures(WALL, {"head +x": 723.15}), mirrors="y")


@pytest.mark.parametrize(
    ("options", "code", "argument"),
    [
        ({"ambient": 20.0}, "case.out_of_range", "ambient"),
        ({"pressure": 1013.25}, "case.out_of_range", "pressure"),
        ({"margin": 0.0}, "case.out_of_range", "margin"),
        ({"processes": 0}, "case.processes", "processes"),
        ({"wall_temperature": 900, "wall_temperature_from": "t.csv"}, "wall.two_temperatures", ""),
        ({"wall_above": 400}, "wall.two_temperatures", "wall_above"),
        ({"body_temperature": ["80 degC"]}, "body.temperatures", "body_temperature"),
    ],
)
def test_impossible_options_are_refused(options: dict[str, Any], code: str, argument: str) -> None:
    with pytest.raises(InputError) as error:
        SimulationOptions(**options)
    assert error.value.code == code
    assert error.value.argument == argument or not argument


def test_sphere_is_a_part_too(tmp_path: Path) -> None:
    sphere = part_from(trimesh.creation.icosphere(2, 20.0))
    size = mesh_size("normal", np.ptp(sphere.bounds, axis=0))
    write_case(Case(sphere, WallTemperatures(800.0), size, Times(2.0, 0.5)), tmp_path)
    assert "symmetryPlane" not in (tmp_path / "0/U").read_text()
