"""Growth of a part by --hot-temperature: one number, regions, or the field's wall."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.io.field import read_field
from iriftrace.io.part_files import read_part, save_part
from iriftrace.io.reading import ReadPart
from iriftrace.part import uneven_growth
from iriftrace.part.standards import cylinder
from iriftrace.part.wall_temperature import WallTemperatures, wall_temperature
from validation.inputs import hot_block

Printed = pytest.CaptureFixture[str]
ALPHA = "1e-5/K"


@pytest.fixture(autouse=True)
def _few_cubes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where every strain is the same, few finite elements are as good as many."""
    monkeypatch.setattr(uneven_growth, "CUBES", uneven_growth.CUBES // 16)


def read(path: Path, *temperatures: str) -> np.ndarray:
    """Extents of a part that has grown."""
    field = path.with_name("air.vtu")
    reading = ReadPart(expansion=1e-5, hot_temperature=list(temperatures))
    hot = read_part(path, reading, field_wall=lambda _: read_field(field).wall_temperature_k)
    return np.ptp(hot.bounds, axis=0)


def test_regions_and_the_field_agree_with_one_number(tmp_path: Path) -> None:
    """A block at 1200 K everywhere, by whatever says so; patterns stand for several regions."""
    _, part = hot_block.save(tmp_path)
    grown = 2 * hot_block.HALF * (1.0 + 1e-5 * (hot_block.WALL - 293.15))
    kelvin = f"{hot_block.WALL} K"
    for words in ((kelvin,), ("300 K", f"plane *={kelvin}"), ("field",)):
        np.testing.assert_allclose(read(part, *words), grown, rtol=1e-6)
    wider = read(part, "293.15 K", f"plane +x={kelvin}")
    assert wider[1] == pytest.approx(wider[2])
    assert 2 * hot_block.HALF < wider[1] < grown


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (("field", "900 degC"), "part.two_temperatures"),
        (("900 degC", "800 degC"), "part.two_temperatures"),
        (("plane +x=900 degC",), "part.two_temperatures"),
        (("900 degC", "rim=900 degC"), "region.unknown_name"),
        (("900 degC", "rim="), "wall.no_region_temperature"),
        (("900",), "units.no_unit"),
        (("900 degC", "plane +x=800"), "units.no_unit"),
    ],
)
def test_what_is_refused(tmp_path: Path, words: tuple[str, ...], code: str) -> None:
    _, part = hot_block.save(tmp_path)
    with pytest.raises(InputError) as refused:
        read(part, *words)
    assert refused.value.code == code


def test_commands_say_what_they_need(tmp_path: Path, capsys: Printed) -> None:
    _, part = hot_block.save(tmp_path)
    words = ["field", "synthetic", str(part), "-o", str(tmp_path / "f.vtu")]
    for more, said in (
        (["--expansion", ALPHA, "--hot-temperature", "field"], "the part is read without a field"),
        (["--hot-temperature", "1000 K", "--hot-temperature", "a=1 K"], "only with its expansion"),
        (["--hot-temperature", "1000 K"], "only with its expansion"),
    ):
        assert main([*words, *more]) == 2
        assert said in " ".join(capsys.readouterr().err.split())


def test_the_wall_is_as_hot_as_the_part(tmp_path: Path, capsys: Printed) -> None:
    """Unless another temperature is given for it, which is warned of."""
    _, part = hot_block.save(tmp_path)
    words = ["field", "synthetic", str(part), "-o", str(tmp_path / "f.vtu"), "--cell-size=3 mm"]
    words += ["--expansion", ALPHA, "--hot-temperature", "900 degC"]
    for more, celsius in ([], 900.0), (["--wall-temperature", "700 degC"], 700.0):
        assert main([*words, *more]) == 0
        hottest = read_field(tmp_path / "f.vtu").temperature_k.max()
        assert hottest == pytest.approx(celsius + 273.15)
        warned = "leave one of them out" in " ".join(capsys.readouterr().err.split())
        assert warned == bool(more)


def test_a_simulated_wall_is_what_the_part_grows_by(tmp_path: Path, capsys: Printed) -> None:
    """The case's part, and the command for the scene, of two temperatures in one command."""
    file = tmp_path / "part.ply"
    save_part(cylinder(length_mm=60.0), file)
    steel = "head -x"
    words = ["field", "simulate", str(file), "-o", str(tmp_path / "case"), "--write-only"]
    words += ["--expansion", ALPHA]
    wall = ["--wall-temperature", "1000 degC", "--region-temperature", f"{steel}=600 degC"]
    assert main([*words, *wall]) == 0
    grown = ["--hot-temperature", "1000 degC", "--hot-temperature", f"{steel}=600 degC"]
    assert main([*words, *grown]) == 0
    assert "Case already exists" in capsys.readouterr().out, "the same case"
    record = json.loads((tmp_path / "case" / "case.json").read_text())
    assert record["wall_k"] == pytest.approx(1273.15)
    temperatures = ["1000 degC", f"{steel}=600 degC"]
    hot = read_part(file, ReadPart(expansion=1e-5, hot_temperature=temperatures))
    import trimesh

    solved = trimesh.load(tmp_path / "case" / "constant" / "triSurface" / "part.stl")
    np.testing.assert_allclose(
        1e3 * np.ptp(solved.bounds, axis=0), np.ptp(hot.bounds, axis=0), rtol=1e-5
    )
    ends = [np.isclose(read_part(file).vertices[:, 0], x) for x in (-30.0, 30.0)]
    length = np.diff([hot.vertices[end, 0].mean() for end in ends])
    assert 60.0 * (1.0 + 1e-5 * 580.0) < length < 60.0 * (1.0 + 1e-5 * 980.0)


def test_a_part_grows_by_the_transition_of_its_wall(tmp_path: Path, capsys: Printed) -> None:
    """From a cool head over the length of a cylinder, whether part or wall has the temperatures.

    A wide transition cools what is near the head, so the part is shorter than with a sharp one.
    """
    import trimesh

    file = tmp_path / "part.ply"
    save_part(cylinder(length_mm=60.0), file)
    temperatures = ["1000 degC", "head -x=600 degC"]
    sharp = read_part(file, ReadPart(expansion=1e-5, hot_temperature=temperatures))
    drawn = read_part(file)
    wall = WallTemperatures(1273.15, {"head -x": 873.15}, 120.0)
    about = ReadPart(expansion=1e-5, hot_temperature="field")
    expected = read_part(file, about, field_wall=lambda _: partial(wall_temperature, wall, drawn))
    shorter = np.ptp(sharp.bounds[:, 0]) - np.ptp(expected.bounds[:, 0])
    assert shorter > 0.01
    words = ["field", "simulate", str(file), "--write-only", "--expansion", ALPHA]
    words += ["--transition=120 mm"]
    by_wall = ["--wall-temperature", temperatures[0], "--region-temperature", temperatures[1]]
    by_part = ["--hot-temperature", temperatures[0], "--hot-temperature", temperatures[1]]
    for name, given in (("wall", by_wall), ("part", by_part)):
        case = tmp_path / name
        assert main([*words, *given, "-o", str(case)]) == 0
        solved = trimesh.load(case / "constant" / "triSurface" / "part.stl")
        length = 1e3 * np.ptp(solved.bounds[:, 0])
        assert length == pytest.approx(np.ptp(expected.bounds[:, 0]), abs=0.01 * shorter)
    assert not capsys.readouterr().err
