"""Growth of a part by --hot-temperature: one number, regions, or the field's wall."""

import json
import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from iriftrace.cli import main
from iriftrace.cli.field_options import FieldOptions, PartOptions
from iriftrace.core.errors import InputError
from iriftrace.io.field import read_field
from iriftrace.io.part_files import read_part, save_part
from iriftrace.part import uneven_growth
from iriftrace.part.standards import cylinder
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
    wall = partial(FieldOptions().read_wall, field)
    options = PartOptions(expansion=1e-5, hot_temperature=list(temperatures))
    return np.ptp(options.read(path, wall).bounds, axis=0)


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
    ("words", "said"),
    [
        (("field", "900 degC"), 'is "field" and also a temperature'),
        (("900 degC", "800 degC"), "gives 2 temperatures for the whole part"),
        (("plane +x=900 degC",), "gives 0 temperatures for the whole part"),
        (("900 degC", "rim=900 degC"), 'no region "rim"'),
        (("900 degC", "rim="), "write it as NAME=TEMPERATURE"),
        (("900",), "900 K or 900 degC"),
        (("900 degC", "plane +x=800"), "800 K or 800 degC"),
    ],
)
def test_what_is_refused(tmp_path: Path, words: tuple[str, ...], said: str) -> None:
    _, part = hot_block.save(tmp_path)
    with pytest.raises(InputError, match=re.escape(said)):
        read(part, *words)


def test_commands_say_what_they_need(tmp_path: Path, capsys: Printed) -> None:
    _, part = hot_block.save(tmp_path)
    words = ["field", "synthetic", str(part), "-o", str(tmp_path / "f.vtu")]
    for more, said in (
        (["--expansion", ALPHA, "--hot-temperature", "field"], "reads the part without a field"),
        (["--hot-temperature", "1000 K", "--hot-temperature", "a=1 K"], "only with --expansion"),
        (["--hot-temperature", "1000 K"], "only with --expansion"),
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
    options = PartOptions(expansion=1e-5, hot_temperature=["1000 degC", f"{steel}=600 degC"])
    hot = options.read(file)
    import trimesh

    solved = trimesh.load(tmp_path / "case" / "constant" / "triSurface" / "part.stl")
    np.testing.assert_allclose(
        1e3 * np.ptp(solved.bounds, axis=0), np.ptp(hot.bounds, axis=0), rtol=1e-5
    )
    ends = [np.isclose(read_part(file).vertices[:, 0], x) for x in (-30.0, 30.0)]
    length = np.diff([hot.vertices[end, 0].mean() for end in ends])
    assert 60.0 * (1.0 + 1e-5 * 580.0) < length < 60.0 * (1.0 + 1e-5 * 980.0)
