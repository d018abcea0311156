"""The command ``iriftrace part``."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import trimesh

from iriftrace.cli import main
from iriftrace.io.part_files import read_part
from iriftrace.part.part import Part
from iriftrace.part.standards import ball_bar, cylinder, plate, sphere


@pytest.mark.parametrize(
    ("words", "make"),
    [
        ("cylinder", cylinder),
        (
            "cylinder --diameter 2cm --length 40mm --segments 24 --stations 3",
            partial(cylinder, 20.0, 40.0, segments=24, stations=3),
        ),
        ("sphere", sphere),
        ("sphere --diameter 3cm --segments 20", partial(sphere, 30.0, segments=20)),
        ("ball-bar", ball_bar),
        (
            "ball-bar --diameter 2cm --spacing 5cm --segments 20",
            partial(ball_bar, 20.0, 50.0, segments=20),
        ),
        ("plate", plate),
        (
            "plate --length 8cm --width 5cm --thickness 4 --cells 3",
            partial(plate, 80.0, 50.0, 4.0, cells=3),
        ),
    ],
)
def test_a_part_is_what_python_makes_and_read_again_with_its_regions(
    words: str, make: Callable[[], Part], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, made = tmp_path / "part.ply", make()
    assert main(["part", *words.split(), "-o", str(file)]) == 0
    shown = capsys.readouterr().out
    assert f"{len(made.faces):,} triangles" in shown
    assert all(f"{name} (" in shown for name in made.region_names)
    read = read_part(file)
    assert read.region_names == made.region_names
    assert np.array_equal(read.region_of_face, made.region_of_face)
    assert np.array_equal(read.faces, made.faces)
    assert np.allclose(read.vertices, made.vertices, atol=1e-5)


@pytest.mark.parametrize("kind", ["cylinder", "sphere", "ball-bar", "plate"])
def test_an_stl_is_closed(kind: str, tmp_path: Path) -> None:
    file = tmp_path / f"{kind}.stl"
    assert main(["part", kind, "-o", str(file)]) == 0
    mesh = trimesh.load(file)
    assert mesh.is_watertight
    assert mesh.volume > 0.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["cylinder", "-o", "part.obj"], "must end in .ply"),
        (["cylinder", "-o", "nowhere/part.ply"], "does not exist"),
        (["cylinder", "-o", "part.ply", "--diameter", "2 kg"], "--diameter"),
        (["cylinder", "-o", "part.ply", "--segments", "4"], "give 8 to 2000 segments"),
        (["ball-bar", "-o", "part.ply", "--spacing", "2 cm"], "the spheres touch"),
        (["plate", "-o", "part.stl", "--thickness", "0 mm"], "makes no solid"),
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
