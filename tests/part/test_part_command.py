"""The command ``iriftrace part``."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from iriftrace.cli import main
from iriftrace.part.part import read_part
from iriftrace.part.shapes.bevel_gear import bevel_gear


def test_a_gear_is_read_again_with_its_regions(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "gear.ply"
    assert main(["part", "gear", "-o", str(file), "--module", "0.3 cm", "--tooth", "2"]) == 0
    shown = capsys.readouterr().out
    assert "30,160 triangles" in shown
    assert "tooth (" in shown
    read, made = read_part(file), bevel_gear(module_mm=3.0, tooth=2)
    assert read.region_names == made.region_names
    assert np.array_equal(read.region_of_face, made.region_of_face)
    assert np.allclose(read.vertices, made.vertices, atol=1e-5)


@pytest.mark.parametrize("kind", ["cylinder", "hybrid", "wishbone", "sphere", "ball-bar", "plate"])
def test_an_stl_is_closed(kind: str, tmp_path: Path) -> None:
    file = tmp_path / f"{kind}.stl"
    finer = ["--spacing", "2.5 mm"] if kind == "wishbone" else []
    assert main(["part", kind, "-o", str(file), *finer]) == 0
    mesh = trimesh.load(file)
    assert mesh.is_watertight
    assert mesh.volume > 0.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["cylinder", "-o", "part.obj"], "must end in .ply"),
        (["cylinder", "-o", "nowhere/part.ply"], "does not exist"),
        (["gear", "-o", "part.ply", "--bore", "2 kg"], "--bore"),
        (["gear", "-o", "part.ply", "--teeth", "4"], "give 8 to 400 teeth"),
        (["ball-bar", "-o", "part.ply", "--spacing", "2 cm"], "the spheres touch"),
        (["hybrid", "-o", "part.stl", "--transition", "1 m"], "is not within its length"),
    ],
)
def test_wrong_input_is_said_in_one_sentence(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["part", *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert len(error.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_the_size_and_unit_of_a_part_are_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An STL states no unit, and field and part may both be read in a wrong one."""
    trimesh.creation.box((4.0, 2.0, 1.0)).export(tmp_path / "a.stl")
    words = ["part", "subdivide", str(tmp_path / "a.stl"), "-o", str(tmp_path / "b.ply")]
    for unit, size in (("mm", "4 x 2 x 1"), ("inch", "101.6 x 50.8 x 25.4")):
        assert main([*words, "--edge", "9 mm", "--length-unit", unit]) == 0
        assert f"a.stl: {size} mm, read in {unit}." in capsys.readouterr().out
