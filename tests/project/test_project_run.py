"""Steps of a project: what is done, what is left, and what they find, at a small scale."""

import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from project_file import FILE, plan, reasons, replaced, simulate, with_fields

import iriftrace
from iriftrace.camera.pose import look_at
from iriftrace.camera.pose_set import PoseSet
from iriftrace.cli import main
from iriftrace.cli.program import app
from iriftrace.cli.project_file import read_project_file
from iriftrace.io.poses import write_poses
from iriftrace.project import stamps
from iriftrace.project.run import chosen_states, do_steps
from iriftrace.project.stamps import states_of
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from validation.oracles.html_page import read_page

Printed = pytest.CaptureFixture[str]
DRAUGHTS = 'draughts = "0:0.1:0.1"\ndraught_from = "270"\n'


def test_the_file_of_a_part_has_every_key_in_place(project: Path) -> None:
    file = read_project_file(FILE, app)
    assert file.get("part", "mesh") == "part.stl"
    assert file.features[0]["nominal"] == "27.0000 mm"
    assert set(reasons()) == {"field", "scene", "measure", "budget", "report"}
    assert main(["new", ".", "--part", "part.stl"]) == 2
    named = Path("his \"part\" 'b'.stl")
    shutil.copy("part.stl", named)
    assert main(["new", "other", "--part", str(named)]) == 0
    assert read_project_file(Path("other") / FILE, app).get("part", "mesh") == f"../{named}"
    assert main(["run", "scenes"]) == 2
    # Of a picture alone nothing is known without a stated uncertainty.
    start, end = "[uncertainty]", 'sensor = "8 um"'
    text = FILE.read_text()
    FILE.write_text(text[: text.index(start)] + text[text.index(end) + len(end) :])
    replaced(', "uncertainty"', "")
    assert set(reasons()) == {"field", "scene", "measure", "report"}


@pytest.mark.usefixtures("variant")
def test_an_example_runs_at_once_and_decides_nothing(
    project: Path, capsys: Printed, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["run"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "Example air: from formulas, not of your hall" in said
    assert "accepted" not in said
    assert reasons() == {}
    page = Path("build/report/report.html")
    written = read_page(page).text
    assert "Example air: from formulas, not of your hall, so nothing is decided." in written
    assert "accepted" not in written

    def read(path: Path) -> str:
        raise AssertionError(f"{path} was read again")

    with monkeypatch.context() as patched:
        patched.setattr(stamps, "sha256_of", read)
        assert main(["run"]) == 0
    assert "All is up to date." in capsys.readouterr().out
    # The content counts, not the time.
    part = Path("part.stl")
    part.touch()
    assert reasons() == {}
    replaced('"1050 degC"  # EXAMPLE', '"950 degC"  # EXAMPLE')
    assert reasons()["field"] == "[air.synthetic] wall_temperature changed"
    assert reasons()["scene"] == "after field"
    replaced('"950 degC"', '"1050 degC"')
    replaced("-0.02 0.02", "-0.03 0.03")
    assert reasons() == {}  # as examples decide nothing
    replaced('sensor = "8 um"', 'sensor = "9 um"')
    assert reasons() == {"budget": "[uncertainty] uncertainty changed"}
    assert main(["run", "--dry-run"]) == 0
    assert "[uncertainty] uncertainty changed" in capsys.readouterr().out
    stamp = Path("build/scene/step.json")
    values = json.loads(stamp.read_text())
    stamp.write_text(json.dumps({**values, "done": False}))
    assert reasons()["scene"] == "interrupted"
    stamp.write_text(json.dumps(values))
    page.unlink()
    assert reasons()["report"] == f"{page} is missing"
    part.write_bytes(part.read_bytes()[:-1] + b"1")
    assert reasons()["field"] == "part.stl changed"
    stamp.unlink()
    assert main(["run", "scene"]) == 2
    assert "holds files that no step has made" in capsys.readouterr().err


@pytest.mark.usefixtures("variant")
def test_a_region_that_the_part_lacks_is_refused_before_anything_is_done(
    project: Path, capsys: Printed
) -> None:
    """With a flow it would else be told after the minutes of the solver."""
    replaced('region = "lateral"', 'region = "laterl"')
    for words in (["run", "--dry-run"], ["run"]):
        assert main(words) == 2
        assert "no region 'laterl'; use one of" in " ".join(capsys.readouterr().err.split())
    assert not (project / "build").exists()


def test_features_of_a_part_that_expands_as_the_field_states_are_found(project: Path) -> None:
    Path("field.vtu").touch()
    with_fields("field.vtu")
    replaced("# expansion", "expansion")
    text = FILE.read_text()
    old = next(line for line in text.splitlines() if line.startswith("# hot_temperature"))
    replaced(old, 'hot_temperature = "field"')
    assert "scene" in chosen_states(read_project_file(FILE, app), ())


def test_a_scan_is_corrected_and_decided(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Printed
) -> None:
    """A changed tolerance is decided without correcting again, as `correct` decides."""
    monkeypatch.chdir(tmp_path)
    bundled = folder_of("cylinder")
    field, part = bundled / "field.vtu", bundled / "part.ply"
    assert main(["new", ".", "--part", str(part), "--field", str(field)]) == 0
    replaced("scale = 0.25", "scale = 0.06")
    replaced("[camera]", "[shells]\nlayers = 3\n[camera]")
    replaced('wall = "10 K"', 'air = "5 %"')
    assert main(["run", "measure"]) == 0
    shutil.copy("build/measure/scan.vtp", "scan.vtp")
    # The report takes no notice of how poses are ranked.
    ranking = '[plan]\nstatistic = "mean"\n'
    FILE.write_text(FILE.read_text() + f'\n[scan]\ncloud = "scan.vtp"\n{ranking}')
    capsys.readouterr()
    assert main(["run"]) == 0
    said = capsys.readouterr().out
    assert "Tolerance" not in said
    assert "Example values, with which nothing is decided: air.ambient" in said
    examples = next(line for line in FILE.read_text().splitlines() if line.startswith("example"))
    replaced(examples, "")
    replaced("-0.02 0.02", "-0.05 0.05")
    assert reasons() == {"report": "[feature] tolerance changed"}
    assert main(["run"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "accepted, risk of a wrong verdict below 0.01 %" in said
    replaced("-0.05 0.05", "0.05 0.06")
    assert main(["run"]) == 0
    assert "rejected" in capsys.readouterr().out
    found = iriftrace.Project.read()
    assert any("rejected" in sentence for sentence in found.sentences)
    assert "of U" in found.correction._repr_html_()
    (row,) = json.loads(Path("build/correct/corrected.json").read_text())["features"]
    (feature,) = found.correction.features(found.scene.part, ["cylinder:lateral"])
    assert feature.size.answer == pytest.approx(row["size_mm"]["corrected"], abs=1e-9)
    words = ["correct", "scan.vtp", "build/scene/scene.xml", "-o", "again.vtp", "--no-figures"]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "[uncertainty] uncertainty" in said
    assert "rejected" in said


@pytest.mark.slow
@pytest.mark.usefixtures("variant")
def test_the_pose_of_a_plan_is_that_of_the_scene(project: Path) -> None:
    plan("fibonacci = 4")
    assert main(["run", "scene"]) == 0
    assert reasons().keys() == {"measure", "budget", "report"}
    poses = json.loads(Path("build/plan/poses.json").read_text())
    scene = load_scene(Path("build/scene/scene.xml"))
    np.testing.assert_allclose(scene.camera.matrix, poses["matrices"][0], atol=1e-9)
    FILE.write_text(FILE.read_text().replace("pose =", 'origin = "1,2,300"\npose ='))
    assert main(["run"]) == 2


@pytest.mark.slow
@pytest.mark.usefixtures("variant")
def test_a_second_device_moves_with_the_pose(project: Path) -> None:
    """As on a rigid frame: the pose of one in the other's frame stays."""
    FILE.unlink()
    pose = look_at((0.0, -300.0, 150.0), (0.0, 0.0, 0.0))
    write_poses("pose.json", PoseSet([pose]), "opencv")
    assert main(["field", "synthetic", "part.stl", "-o", "field.vtu", "--cell-size=4 mm"]) == 0
    words = ["scene", "field.vtu", "part.stl", "--second=300,-100,100", "--focus=50:600"]
    words += ["--layers=2", "--scale=0.05"]
    between = []
    for name, more in (("usual", []), ("posed", ["--pose=pose.json"])):
        assert main([*words, *more, "-o", f"{name}/scene.xml"]) == 0
        scene = load_scene(Path(name) / "scene.xml")
        assert scene.second is not None
        between.append(np.linalg.inv(scene.camera.matrix) @ scene.second.matrix)
    np.testing.assert_allclose(scene.camera.matrix, pose, atol=1e-9)
    np.testing.assert_allclose(between[1], between[0], atol=1e-9)
    assert main([*words, "--pose=pose.json", "--origin=1,2,300", "-o", "c/scene.xml"]) == 2


@pytest.mark.parametrize("more", ["", DRAUGHTS])
def test_a_flow_has_a_folder_without_other_files_and_is_continued(
    project: Path, monkeypatch: pytest.MonkeyPatch, more: str
) -> None:
    """The solver's command refuses a folder in which there are others, such as a stamp."""
    simulate(more)
    solved, before = Path("build/field/solved"), []

    def killed() -> None:
        before.append([path.name for path in solved.glob("*")])
        solved.mkdir(exist_ok=True)
        (solved / "case.json").write_text("{}")
        raise KeyboardInterrupt

    bound = SimpleNamespace(args=(), kwargs={}, arguments={})
    monkeypatch.setattr(type(app), "parse_args", lambda *_, **__: (killed, bound, None))
    for wall in (1050, 1050, 1040):
        FILE.write_text(FILE.read_text().replace('ure = "1050', f'ure = "{wall}'))
        with pytest.raises(KeyboardInterrupt):
            do_steps(read_project_file(FILE, app), ["field"], print)
    assert before == [[], ["case.json"], []]
    assert reasons()["field"] == "interrupted"


def test_example_air_in_place_of_a_family_is_used(project: Path) -> None:
    simulate(DRAUGHTS)
    (solved := Path("build/field/solved")).mkdir(parents=True)
    family = {"members": [{"field": "at_0.00.vtu"}, {"field": "at_0.10_from_270.vtu"}]}
    (solved / "family.json").write_text(json.dumps(family))
    words = states_of(read_project_file(FILE, app))["scene"].step.words()
    assert words[0] == "build/field/solved/at_0.00.vtu"
    assert words[3:] == ["--member=build/field/solved/at_0.10_from_270.vtu"]
    replaced("[air.simulate]", "[air.synthetic]")
    replaced(DRAUGHTS, "")
    words = states_of(read_project_file(FILE, app))["scene"].step.words()
    assert words == ["build/field/field.vtu", "part.stl", "--output=build/scene/scene.xml"]


def test_a_flow_is_solved_again_for_another_wall_and_for_nothing_else(project: Path) -> None:
    simulate("")
    file = read_project_file(FILE, app)
    field = states_of(file)["field"]
    assert field.step.command == "field simulate"
    assert field.step.words() == ["part.stl", "--output=build/field/solved"]
    field.step.product.parent.mkdir(parents=True)
    field.step.product.write_text("solved")
    field.write(done=True)
    assert "field" not in reasons()
    replaced("-0.02 0.02", "-0.03 0.03")
    replaced("scale = 0.06", "scale = 0.07")
    replaced("layers = 3", "layers = 4")
    assert "field" not in reasons()
    replaced('wall_temperature = "1050 degC"\n', 'wall_temperature = "1040 degC"\n')
    assert reasons()["field"] == "[air.simulate] wall_temperature changed"
    replaced('"1040 degC"', '"1050 degC"')
    replaced('ambient = "20 degC"', 'ambient = "21 degC"')
    assert reasons()["field"] == "[air] ambient changed"


@pytest.mark.usefixtures("variant")
def test_a_project_in_python_has_the_values_of_its_products(
    project: Path, monkeypatch: pytest.MonkeyPatch, capsys: Printed
) -> None:
    monkeypatch.chdir(project.parent)
    found = iriftrace.Project.read(project / FILE)
    assert found.status["scene"] == "not done yet"
    assert found.scan.points.shape[1] == 3
    assert found.status["scene"] == ""
    assert found.temperatures == {}
    assert found.report() == project / "build" / "report" / "report.html"
    assert capsys.readouterr().out == ""
    assert Path.cwd() == project.parent
    values = json.loads((project / "build" / "measure" / "scan.json").read_text())
    assert values["points"]["measured"] == len(found.scan.points)
    (first, *_) = found.sentences
    assert first.startswith(f"Error of {len(found.scan.points):,} points")
    assert [one.name for one in found.budget.features] == ["cylinder:lateral"]
    assert found.budget.features[0].size.decision is None
    assert found.figure().axes
    for value in (found, found.scene, found.scan):
        shown = value._repr_html_()
        assert shown.startswith("<table><caption>")
        assert "<iframe srcdoc=" in shown
    with pytest.raises(iriftrace.InputError, match=r"\[scan\] cloud: it is missing"):
        _ = found.correction
