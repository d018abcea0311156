"""A board in a project: its scene next to the part's, and the fit before a scan is corrected."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from project_file import FILE, reasons, replaced

import iriftrace
from iriftrace.cli import main
from iriftrace.cli.program import app
from iriftrace.cli.project_file import read_project_file
from iriftrace.project.run import options_of
from iriftrace.project.stamps import states_of
from iriftrace.tracing.load import load_scene
from validation.inputs.stereo_files import opencv

Printed = pytest.CaptureFixture[str]


def with_board(*files: str) -> None:
    """Uncomment board and scan in the file, and make empty files."""
    text = FILE.read_text().replace("# [board]", "[board]").replace("# [scan]", "[scan]")
    for key in ('mesh = "board', "transform", "shifts", 'cloud = "scan'):
        text = text.replace(f"# {key}", key)
    FILE.write_text(text)
    for name in files:
        Path(name).touch()


def test_a_board_is_fitted_before_a_scan_is_corrected(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The steps and their words; the page of the project runs them."""
    with_board("board.stl", "shifts.csv", "scan.ply")
    states = states_of(read_project_file(FILE, app))
    assert [*states] == [
        *("field", "scene", "measure", "board", "fit", "correct", "budget", "report")
    ]
    words = states["fit"].step.words()
    assert words[:2] == ["build/board/scene.xml", "shifts.csv"]
    assert words[3] == "--scene=build/scene/scene.xml"
    words = states["board"].step.words()
    assert words[:2] == ["build/field/field.vtu", "board.stl"]
    assert words[-2:] == ["--part-transform=board_pose.txt", "--blocker=build/scene/part.ply"]
    assert states["correct"].step.words()[1] == "build/fit/scene.xml"
    assert "[feature] tolerance" not in states["correct"].inputs
    # Of a chain of steps, each stamp has its own inputs alone.
    assert len(json.dumps(states["report"].inputs)) < 1000
    # In Python, too, devices measure in the air before the fit.
    monkeypatch.setattr(iriftrace.Project, "_product", lambda self, step: step)
    monkeypatch.setattr("iriftrace.tracing.load.load_scene", lambda product, *_, **__: product)
    monkeypatch.setattr("iriftrace.measuring.two_devices.measure.measure", lambda scene, **_: scene)
    found = iriftrace.Project.read()
    assert (found.scan, found.scene) == ("scene", "fit")


def test_thermocouples_are_fitted_without_a_board(project: Path) -> None:
    """Or marks on the part itself, in its own scene."""
    with_board()
    replaced('mesh = "board.stl"\n', "")
    replaced('transform = "board_pose.txt"\n', "")
    replaced('"shifts.csv"', '"temperatures.csv"')
    states = states_of(read_project_file(FILE, app))
    assert [*states] == ["field", "scene", "measure", "fit", "correct", "budget", "report"]
    assert states["fit"].step.after == ("scene",)
    words = states["fit"].step.words()
    assert words[:2] == ["build/scene/scene.xml", "temperatures.csv"]
    for name in ("correct", "budget"):
        assert "build/fit/scene.xml" in states[name].step.words()


def test_a_board_in_another_place_has_another_scene(project: Path) -> None:
    with_board("board.stl", "board_pose.txt", "shifts.csv", "scan.ply")
    board = states_of(read_project_file(FILE, app))["board"]
    board.step.folder.mkdir(parents=True)
    board.step.product.touch()
    board.write(done=True)
    assert reasons()["board"] == "after field"
    Path("board_pose.txt").write_text("1 0 0 0")
    assert reasons()["board"] == "board_pose.txt changed"
    Path("board_pose.txt").write_text("")
    replaced('mesh = "board.stl"', 'mesh = "board.stl"\nlength_unit = "m"')
    assert reasons()["board"] == "[board] length_unit changed"


def test_steps_before_a_missing_file_are_done(project: Path, capsys: Printed) -> None:
    """Pictures and scan are taken after the scenes that say where to put the board."""
    with_board("board.stl")
    assert reasons()["fit"] == "shifts.csv is missing"
    assert reasons()["correct"] == "scan.ply is missing"
    assert main(["run", "--dry-run", "scene", "board"]) == 0
    assert main(["run"]) == 2
    assert "there is no shifts.csv, which the step fit reads" in capsys.readouterr().err
    assert not Path("build").exists()


@pytest.mark.usefixtures("variant")
@pytest.mark.parametrize("given", ["origin", "stereo", ""])
def test_a_board_is_seen_by_the_camera_of_the_part(project: Path, given: str) -> None:
    """Without a target or a place it looks at the part; two calibrated cameras, too."""
    with_board()
    assert main(["part", "board", "-o", "board.stl", "--size=200x200", "--pitch=10"]) == 0
    place = np.eye(4)
    place[:3, 3] = (-150.0, 150.0, -80.0)
    np.savetxt("board_pose.txt", place)
    text = FILE.read_text()
    camera, second = text.index("[camera]"), text.index("[board]")
    opencv(Path("stereo.yaml"))
    devices = f"""[camera]
    {"origin = [250, -300, 150]" if given else ""}
    scale = 0.06
    """
    rig = """pixel_size = "3.45 um"
    [second]
    stereo_calibration = ["stereo.yaml"]
    """
    FILE.write_text(text[:camera] + devices + (rig if given == "stereo" else "") + text[second:])
    replaced(', "second"', "")
    assert main(["run", "board"]) == 0
    found = [load_scene(f"build/{name}/scene.xml").camera for name in ("scene", "board")]
    np.testing.assert_allclose(found[1].matrix, found[0].matrix, atol=1e-9)
    assert found[1].resolution == found[0].resolution


def test_a_fixture_blocks_the_view_of_the_part_and_of_the_board(project: Path) -> None:
    board = '[board]\nmesh = "board.stl"\n[part]\nblocker = ["fixture.stl"]'
    FILE.write_text(FILE.read_text().replace("[part]", board))
    for name in ("board.stl", "fixture.stl"):
        shutil.copy(read_project_file(FILE, app).get("part", "mesh") or "", name)
    file = read_project_file(FILE, app)
    states = states_of(file)
    assert "fixture.stl" in states["scene"].files
    blocked = [word for word in states["board"].step.words() if word.startswith("--blocker")]
    assert blocked == ["--blocker=build/scene/part.ply", "--blocker=fixture.stl"]
    scene = options_of(file, "scene", "FIELD", "PART", "--output=scene.xml")
    assert scene["blocker"] == [Path("fixture.stl")]
