"""Each command prints the next one, which runs as it is printed; files changed by hand are kept."""

import re
import shlex
from pathlib import Path

import pytest

from iriftrace.cli import main
from iriftrace.cli.simulate import next_scene
from iriftrace.flow.simulate.options import SimulationOptions
from iriftrace.io.reading import AS_DRAWN, ReadPart
from validation.inputs import hot_block

Printed = pytest.CaptureFixture[str]


def next_words(printed: Printed) -> list[str]:
    said = printed.readouterr()
    assert not said.err, said.err
    found = re.search(r"(?:now )?run:  iriftrace (.*)", said.out)
    assert found, said.out
    return shlex.split(found[1])


@pytest.mark.slow
def test_from_the_part_to_the_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Printed
) -> None:
    """In a folder with a space in its name, and with options on how the part's file is read."""
    monkeypatch.chdir(tmp_path)
    Path("my parts").mkdir()
    assert main(["part", "cylinder", "-o", "my parts/part.stl"]) == 0
    words = next_words(capsys)
    assert words == ["field", "synthetic", "my parts/part.stl", "-o", "my parts/field.vtu"]
    options = ["--expansion=14e-6/K", "--hot-temperature=900 degC", "--part-transform=rotate z 90"]
    more = ["--ambient=25 degC", "--wall-temperature=900 degC", "--cell-size=4 mm"]
    assert main([*words, *options, *more]) == 0
    words = next_words(capsys)
    assert words[:5] == ["scene", "my parts/field.vtu", words[2], "-o", "my parts/scene/scene.xml"]
    assert main([*words, "--layers=3", "--scale=0.02"]) == 0
    words = next_words(capsys)
    assert words == ["render", "my parts/scene/scene.xml"]
    assert main([*words, "--no-figures", "--engine=shells"]) == 0
    assert Path("my parts/scene/scene.exr").is_file()


def test_after_a_simulation() -> None:
    """The air is that of the simulation, and a part that has expanded is read as it was there."""
    command = next_scene(
        [Path("case/field.vtu")],
        Path("a part.stl"),
        SimulationOptions(wall_temperature=1373.15, ambient=298.15, pressure=9e4),
        ReadPart(length_unit="m", expansion=14e-6, hot_temperature=["1100 degC"]),
    )
    assert shlex.split(command)[1:] == [
        *("scene", "case/field.vtu", "a part.stl", "-o", "case/scene/scene.xml"),
        *("--ambient", "25 degC", "--pressure", "90000 Pa", "--length-unit", "m"),
        *("--expansion", "1.4e-05/K", "--hot-temperature", "1100 degC"),
    ]


def test_after_a_family() -> None:
    """Its members are one ensemble, in the air of the simulation."""
    simulation = SimulationOptions(ambient=298.15, pressure=9e4)
    files = [Path("family/still.vtu"), Path("family/a.vtu"), Path("family/b.vtu")]
    command = next_scene(files, Path("part.stl"), simulation, AS_DRAWN)
    assert shlex.split(command)[1:] == [
        *("scene", "family/still.vtu", "part.stl", "-o", "family/scene/scene.xml"),
        *("--ambient", "25 degC", "--member", "family/a.vtu", "--member", "family/b.vtu"),
        *("--pressure", "90000 Pa"),
    ]


def test_a_scene_that_was_changed_by_hand_is_kept(tmp_path: Path, capsys: Printed) -> None:
    hot_block.save(tmp_path)
    xml = tmp_path / "scene" / "scene.xml"
    words = ["scene", str(tmp_path / "air.vtu"), str(tmp_path / "block.stl"), "-o", str(xml)]
    for layers in (2, 3):
        assert main([*words, f"--layers={layers}"]) == 0, "unchanged, so replaced"
    text = xml.read_text().replace('name="focus_near" value="0.0"', 'name="focus_near" value="40"')
    assert text != xml.read_text()
    xml.write_text(text)
    assert main([*words, "--layers=4"]) == 2
    assert "was edited by hand" in capsys.readouterr().err
    assert xml.read_text() == text
    assert not (xml.parent / "shells" / "shell_04.ply").exists()


@pytest.mark.usefixtures("no_driver")
def test_a_bundled_scene_that_was_changed_by_hand_is_kept(tmp_path: Path, capsys: Printed) -> None:
    words = ["demo", "-o", str(tmp_path), "--scene", "slab", "-D", "scale=0.02"]
    assert main(words) == 0
    xml = tmp_path / "slab" / "scene.xml"
    text = f"{xml.read_text()}<!-- mine -->\n"
    xml.write_text(text)
    assert main(words) == 2
    assert "was edited by hand" in capsys.readouterr().err
    assert xml.read_text() == text
