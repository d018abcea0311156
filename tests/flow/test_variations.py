"""Cases solved again with one input changed: what they change, their files, and resuming.

A function that writes small files stands in for OpenFOAM.
"""

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
import trimesh
from attrs import evolve

from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.core.files import FileOrigin, sha256_of
from iriftrace.flow.simulate import programs, variations
from iriftrace.flow.simulate import simulate as simulating
from iriftrace.flow.simulate.case import Case
from iriftrace.flow.simulate.draught import Draught
from iriftrace.flow.simulate.programs import Installation
from iriftrace.flow.simulate.result import _write
from iriftrace.flow.simulate.run import Steadiness
from iriftrace.flow.simulate.simulate import Display, Simulation
from iriftrace.flow.simulate.times import Times
from iriftrace.flow.simulate.variations import case_folder, solve_varied, varied_cases
from iriftrace.io.field import read_field
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.origin import origin_of
from iriftrace.medium.source import FieldFacts, FieldKind, Variation
from iriftrace.part.part import Part
from iriftrace.part.wall_temperature import MeasuredWall, WallTemperatures, measured_wall
from validation.inputs.hot_block import WALL, air

NONE = Installation("", "", "", {})
ALL = "wall 10 K, ambient 2 K, pressure 2 hPa"


def test_each_case_changes_one_input(case: Case) -> None:
    """In a fixed order, whatever the text's; mesh and times are the same, without snapshots."""
    case = evolve(case, times=Times(2.0, 0.5, 3))
    found = varied_cases(case, "pressure 2 hPa, ambient 2 K, wall 10 K")
    assert [(one.variation.quantity, one.variation.step) for one in found] == [
        ("wall", 10.0),
        ("ambient", 2.0),
        ("pressure", 200.0),
    ]
    for one, changed in zip(found, ({"wall_k"}, {"ambient_k"}, {"pressure_pa"}), strict=True):
        record, base = one.record(), case.record()
        assert {name for name in base if record[name] != base[name]} == changed
        assert one.domain == case.domain
        assert one.times == Times(2.0, 0.5)
    wall, ambient, pressure = found
    assert wall.wall.hottest == case.wall.hottest + 10.0
    assert ambient.options.ambient == case.options.ambient + 2.0
    assert pressure.options.pressure == case.options.pressure + 200.0


def test_all_temperatures_of_a_wall_rise(cylinder: Part) -> None:
    regions = WallTemperatures(1000.0, {"head +x": 700.0}, 5.0).hotter(10.0)
    assert regions == WallTemperatures(1010.0, {"head +x": 710.0}, 5.0)
    corners = cylinder.vertices[:3]
    scanned = MeasuredWall(FileOrigin("t.csv", ""), corners, np.array((900.0, 950.0, 800.0)))
    hotter = measured_wall(scanned).hotter(10.0)
    assert hotter.hottest == 960.0
    assert hotter.measured.at(corners) == pytest.approx((910.0, 960.0, 810.0))


def test_a_leaning_plume_has_the_same_mesh(case: Case) -> None:
    """Though hotter air rises faster and leans less, by which a mesh is otherwise laid out."""
    blown = evolve(case, mirrors="", draught=Draught(0.1, (0.0, 1.0, 0.0)))
    cold = evolve(blown.options, ambient=250.0)
    hotter = evolve(blown, wall=blown.wall.hotter(200.0), options=cold)
    assert hotter.domain != blown.domain
    for one in varied_cases(blown, "wall 200 K, ambient 40 K"):
        assert one.domain == blown.domain


@pytest.mark.parametrize(
    ("text", "code", "argument"),
    [
        ("wall 10", "case.steps_not_read", "vary"),
        ("wall 10 degC", "case.steps_not_read", "vary"),
        ("pressure 2 K", "case.steps_not_read", "vary"),
        ("humidity 5 %", "case.steps_not_read", "vary"),
        ("wall 1 K, wall 2 K", "case.steps_not_read", "vary"),
        ("wall -10 K", "case.steps_not_read", "vary"),
        ("ambient 0 K", "case.steps_not_read", "vary"),
        ("wall nan K", "case.steps_not_read", "vary"),
        (" , ", "case.steps_not_read", "vary"),
        ("pressure 90 kPa", "case.out_of_range", "pressure"),
        ("wall 5000 K", "wall.unlikely_temperature", None),
    ],
)
def test_what_is_no_variation_is_refused(
    case: Case, text: str, code: str, argument: str | None
) -> None:
    with pytest.raises(InputError) as error:
        varied_cases(case, text)
    assert (error.value.code, error.value.argument) == (code, argument)


class Solver:
    """Stands in for OpenFOAM: writes fields by a formula, and dies after some."""

    def __init__(self, dies_after: int = 99) -> None:
        self.solved: list[tuple[Path, Path | None]] = []
        self.dies_after = dies_after

    def __call__(
        self,
        case: Case,
        folder: Path,
        file: Path,
        installation: Installation,
        display: Display,
        like: Path | None = None,
    ) -> Simulation:
        if len(self.solved) == self.dies_after:
            raise KeyboardInterrupt
        self.solved.append((folder, like))
        grid = air(6)
        shift = case.options.ambient - 293.15
        grid.point_data["T"] = np.asarray(grid.point_data["T"]) + shift
        _write(case, grid, file, "by a formula", FieldFacts(FieldKind.STEADY))
        return Simulation(file, (), 1000, 0.5, Steadiness(9.0, 0.0, 0.0, True), 0.1, 60.0)


def test_fields_say_what_they_vary(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    solver = Solver()
    monkeypatch.setattr(variations, "simulate", solver)
    base = solver(case, tmp_path, tmp_path / "field.vtu", NONE, Display())
    for one in varied_cases(case, ALL):
        name = one.variation.quantity
        written = solve_varied(one, tmp_path, base, NONE, Display()).field
        assert written == tmp_path / f"field_{name}.vtu"
        assert solver.solved[-1] == (tmp_path / "vary" / name, tmp_path)
        assert case_folder(one, tmp_path) == tmp_path / "vary" / name
        source = read_field(written).source
        assert source.facts.variation == Variation(name, one.variation.step, sha256_of(base.field))
        assert source.facts.kind is FieldKind.STEADY
        assert one.variation.text in origin_of(pv.read(written))
    assert "varies pressure by 2 hPa" in source.origin
    assert read_field(base.field).source.facts.variation is None


def test_a_field_is_read_in_the_air_that_it_varies(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At the edge it is that air, and at the wall the index follows its pressure."""
    monkeypatch.setattr(variations, "simulate", Solver())
    base = Solver()(case, tmp_path, tmp_path / "field.vtu", NONE, Display())
    _, ambient, pressure = varied_cases(case, ALL)
    room = Air(relative_humidity=0.4)
    kelvin = read_field(base.field, air=room).temperature_k
    for one, there in (
        (ambient, evolve(room, temperature_k=room.temperature_k + 2.0)),
        (pressure, evolve(room, pressure_pa=room.pressure_pa + 200.0)),
    ):
        field = read_field(solve_varied(one, tmp_path, base, NONE, Display()).field, air=room)
        assert field.air == there
        assert field.refractivity.max() == pytest.approx(there.ambient_refractivity, rel=1e-6)
    assert field.temperature_k == pytest.approx(kelvin, rel=1e-6)
    assert field.refractivity.min() == pytest.approx(float(there.refractivity(WALL)), rel=1e-5)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user's folder with a part, on a machine with some OpenFOAM."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(programs, "find_openfoam", lambda: NONE)
    monkeypatch.setattr(simulating, "check_solver", lambda _: None)
    trimesh.creation.box((60.0, 30.0, 20.0)).export(tmp_path / "part.stl")
    return tmp_path


def solved_by(solver: Solver, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulating, "simulate", solver)
    monkeypatch.setattr(variations, "simulate", solver)


WORDS = ["field", "simulate", "part.stl", "-o", "case", "--wall-temperature=1100 degC"]


def test_a_killed_command_goes_on(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    solved_by(Solver(dies_after=2), monkeypatch)
    assert main([*WORDS, "--vary", ALL]) == 130
    assert "give the same command again to continue" in capsys.readouterr().err
    assert (folder / "case/field_wall.vtu").is_file()
    assert not (folder / "case/field_ambient.vtu").exists()
    again = Solver()
    solved_by(again, monkeypatch)
    capsys.readouterr()
    assert main([*WORDS, "--vary", ALL]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "solved 4 times on one mesh" in said
    assert "field_ambient.vtu varies ambient by 2 K: 60 s; heat flow 9 W, steady" in said
    assert "--member case/field_wall.vtu --member case/field_ambient.vtu --member" in said
    base = sha256_of(folder / "case/field.vtu")
    for name in ("wall", "ambient", "pressure"):
        variation = read_field(folder / f"case/field_{name}.vtu").source.facts.variation
        assert (variation.quantity, variation.of) == (name, base)


def test_cases_are_written_without_a_solver(folder: Path, fails) -> None:
    """And another step is another case, as is another temperature."""
    assert main([*WORDS, "--vary", ALL, "--write-only"]) == 0
    for name in ("wall", "ambient", "pressure"):
        assert (folder / "case/vary" / name / "system/controlDict").is_file()
    assert not (folder / "case/field.vtu").exists()
    assert "differs in wall_k" in fails(*WORDS, "--vary", "wall 20 K", "--write-only")


def test_a_family_is_not_varied(folder: Path, fails) -> None:
    message = fails(*WORDS, "--vary", ALL, "--draughts", "0:0.1:0.1", "--draught-from", "0")
    assert "--vary is for one field" in message


def test_a_variation_is_averaged_over_the_time_of_the_first(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """0.2 s of a continued run, not the 0.5 s that were requested."""
    averaged: list[float] = []

    def solver(case: Case, *rest: object, like: Path) -> None:
        averaged.append(case.times.averaging)

    monkeypatch.setattr(variations, "simulate", solver)
    base = evolve(Solver()(case, tmp_path, tmp_path / "field.vtu", NONE, Display()), averaged=0.2)
    solve_varied(varied_cases(case, "wall 10 K")[0], tmp_path, base, NONE, Display())
    assert averaged == [0.2]
