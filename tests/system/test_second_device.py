"""Scenes with two devices: what ``scene --second`` writes measures; wrong ones are refused."""

import json
import math
import shlex
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from iriftrace.cli import main
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from scenes.generators.bundled import FRINGE_SCENE, PAPER_SCENE, write_fringe, write_paper
from validation.inputs import hot_block

pytestmark = pytest.mark.usefixtures("variant")

CAMERA = ["--origin=60,-45,70", "--resolution=120,100", "--scale=0.5", "--sensor=6,5"]
LENS = ["--focal-length=20", "--layers=3"]

LENS_FILE = {
    "camera_matrix": [[4000.0, 0.0, 60.0], [0.0, 4000.0, 50.0], [0.0, 0.0, 1.0]],
    "distortion_coefficients": [0, 0, 0, 0],
    "image_width": 120,
    "image_height": 100,
}
POSE = {"R": [[1, 0, 0], [0, 0, -1], [0, 1, 0]], "T": [0, 0, 90]}
Printed = pytest.CaptureFixture[str]


@pytest.fixture
def words(tmp_path: Path) -> list[str]:
    field, part = hot_block.save(tmp_path)
    scene = str(tmp_path / "scene" / "scene.xml")
    return ["scene", str(field), str(part), "-o", scene, *CAMERA, *LENS]


def test_the_printed_command_measures(words: list[str], capsys: Printed) -> None:
    """The second device looks at the part's centre, as the camera does, through the same lens."""
    assert main([*words, "--second=75,-20,70", "--system=stereo"]) == 0
    said = capsys.readouterr().out
    scene = load_scene(words[4])
    assert scene.second_id == "camera_2"
    assert scene.second.origin == pytest.approx((75, -20, 70))
    towards = -scene.second.origin / np.linalg.norm(scene.second.origin)
    assert scene.second.forward == pytest.approx(towards)
    assert scene.second.focal_length_mm == scene.camera.focal_length_mm
    command = shlex.split(said.split("measure:  iriftrace ")[1].strip())
    assert main(command) == 0
    numbers = json.loads(Path(command[-1]).with_suffix(".json").read_text())
    assert numbers["system"] == "stereo"
    assert numbers["points"]["measured"] > 100


def test_a_stated_focus_holds_for_both_devices(words: list[str], capsys: Printed) -> None:
    """Without one no distance is out of focus, and the command says that none is stated."""
    assert main([*words, "--second=150,-140,240"]) == 0
    scene = load_scene(words[4])
    assert scene.camera.focus_mm == scene.second.focus_mm == (0.0, math.inf)
    assert "in focus at any distance (no focus stated)" in " ".join(capsys.readouterr().out.split())
    Path(words[4]).unlink()
    assert main([*words, "--second=150,-140,240", "--focus=50:260"]) == 0
    assert load_scene(words[4]).second.focus_mm == (50.0, 260.0)


def test_a_calibration_gives_the_projector_its_lens_and_place(
    words: list[str], tmp_path: Path
) -> None:
    """Pixels of 5 um and a focal length of 4000 of them are 20 mm; R and t place it at -R't."""
    calibration = tmp_path / "projector.json"
    calibration.write_text(json.dumps(LENS_FILE | POSE))
    given = [f"--second-calibration={calibration}", "--second-pixel-size=5 um"]
    assert main([*words, *given]) == 0
    scene = load_scene(words[4])
    assert scene.second_id == "projector"
    assert scene.second.origin == pytest.approx((0, -90, 0), abs=1e-9)
    assert scene.second.focal_length_mm == pytest.approx(20.0)


def test_a_camera_without_a_pose_stands_nowhere_beside_the_second_device(
    words: list[str], tmp_path: Path, capsys: Printed
) -> None:
    """Its usual place would be another than that of the projector's calibration."""
    camera, projector = tmp_path / "camera.json", tmp_path / "projector.json"
    camera.write_text(json.dumps(LENS_FILE))
    projector.write_text(json.dumps(LENS_FILE | POSE))
    given = [f"--calibration={camera}", "--pixel-size=5 um", "--scale=0.5"]
    given += [f"--second-calibration={projector}", "--second-pixel-size=5 um"]
    assert main([*words[:5], *given]) == 2
    assert "camera.json has no pose" in " ".join(capsys.readouterr().err.split())
    camera.write_text(json.dumps(LENS_FILE | POSE | {"T": [0, 0, 400]}))
    assert main([*words[:5], *given]) == 0


def test_devices_out_of_focus_are_told_so(words: list[str], capsys: Printed) -> None:
    """They see the same side, so that pointing them there would not help."""
    assert main([*words, "--second=75,-20,70", "--focus=20:40"]) == 0
    assert main(["measure", words[4], "-o", str(Path(words[4]).with_name("scan.vtp"))]) == 2
    assert "out of focus" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    ("write", "name"), [(write_fringe, FRINGE_SCENE), (write_paper, PAPER_SCENE)]
)
def test_the_script_writes_the_bundled_scene(
    tmp_path: Path, write: Callable[[Path, Path], Path], name: str
) -> None:
    written = write(tmp_path, folder_of("cylinder"))
    assert written.read_text() == (folder_of(name) / "scene.xml").read_text()


def test_the_bundled_cylinder_is_whole_in_the_picture_and_in_focus() -> None:
    """Every vertex, with room at each side; the paper's camera cuts its own view off."""
    for name, whole in (("cylinder", True), (PAPER_SCENE, False)):
        scene = load_scene(folder_of(name) / "scene.xml")
        place = scene.camera.project(scene.part.vertices)
        distance = np.linalg.norm(scene.camera.origin - scene.part.vertices, axis=1)
        near, far = scene.camera.focus_mm
        inside = ((place > 0) & (place < scene.camera.resolution)).all()
        sharp = (near < distance).all() and (distance < far).all()
        assert inside == sharp == whole


@pytest.mark.usefixtures("no_driver")
def test_the_demo_ends_with_the_diameter(tmp_path: Path, capsys: Printed) -> None:
    """A hot cylinder measures too small: air of n < n0 near the wall bends lines towards the cold.

    Concentric layers would make it 3.7 um (the closed form); the coarse field's are wider.
    """
    assert main(["demo", "-o", str(tmp_path), "--scene", FRINGE_SCENE, "-D", "scale=0.1"]) == 0
    assert "the air makes it" in capsys.readouterr().out
    numbers = json.loads((tmp_path / f"{FRINGE_SCENE}_scan.json").read_text())
    feature = next(row for row in numbers["features"] if row["kind"] == "cylinder")
    air_um = 1e3 * (feature["size_mm"]["cold"] - feature["size_mm"]["measured"])
    assert 3.0 < air_um < 6.0
    assert (tmp_path / f"{FRINGE_SCENE}_scan.png").stat().st_size > 10_000
