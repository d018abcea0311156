"""`iriftrace plan` and `iriftrace report` as a user runs them, and what they refuse."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from failing import NINE_POSES, Failing, Run

import iriftrace
from iriftrace.camera.pose import look_at
from iriftrace.camera.pose_set import PoseSet
from iriftrace.cli import main
from iriftrace.figures import report as report_module
from iriftrace.io.poses import read_poses
from iriftrace.sweep.store import read_sweep
from iriftrace.sweep.sweep import run_sweep
from iriftrace.tracing.load import load_scene
from validation.inputs.hot_block import HotBlock
from validation.oracles.html_page import read_page


def matrix_after(text: str, name: str) -> np.ndarray:
    """The four rows below the line that begins with a name."""
    lines = text.splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith(name)) + 1
    return np.array([[float(v) for v in line.split()] for line in lines[first : first + 4]])


def test_the_best_pose_is_printed_in_three_forms_and_ranked_ones_are_saved(
    sweep: Path, tmp_path: Path, run: Run
) -> None:
    """ROS: x forward, y left, z up; and read back, the poses of the ranking, best first."""
    file = tmp_path / "poses.json"
    text = run("plan", sweep, "--top=3", "--save", file, "--convention", "ros")
    best = int(re.search(r"^Best pose (\d+)", text, re.MULTILINE)[1])
    matrix = matrix_after(text, f"Best pose {best}")
    own = read_sweep(sweep)["matrix"].values[best]
    np.testing.assert_allclose(matrix, own, atol=1e-6)
    xml = re.search(r'<lookat origin="(.*?)" target="(.*?)" up="(.*?)"/>', text)
    vectors = [[float(v) for v in xml[i].split(",")] for i in (1, 2, 3)]
    np.testing.assert_allclose(look_at(*vectors), matrix, atol=1e-5)
    plain = re.search(r"^Look-at: origin \((.*?)\) mm", text, re.MULTILINE)
    assert plain[1] == xml[1]
    written = json.loads(file.read_text())
    first = np.array(written["matrices"][0])
    assert written["focus_mm"][0] == read_sweep(sweep)["distance"].values[best]
    assert "second" not in written, "one camera"
    np.testing.assert_array_equal(first[:3, :3], own[:3, [2, 0, 1]] * (1, -1, -1))
    np.testing.assert_array_equal(first[:3, 3], own[:3, 3])
    back = read_poses(file, "ros")
    assert len(back) == 3
    np.testing.assert_allclose(back.matrices[0], own, atol=1e-12)


def test_python_plans_as_the_command_does(sweep: Path, run: Run) -> None:
    """The same best pose and views; criteria and limits are the options."""
    criteria = iriftrace.Criteria(statistic="median", min_hits=50)
    found = iriftrace.plan(
        read_sweep(sweep), criteria, views=iriftrace.Views(2, max_incidence=80.0)
    )
    options = ["--statistic=median", "--min-hits=50", "--views=2", "--max-incidence=80"]
    text = run("plan", sweep, *options)
    assert int(re.search(r"^Best pose (\d+)", text, re.MULTILINE)[1]) == found.summary.plan.best
    assert found.views is not None
    assert f"Together they see {100 * found.views.covered:.2f} %" in text
    assert found.refined is None


def test_a_complete_sweep_says_so(hot: HotBlock, sweep: Path, run: Run) -> None:
    before = sweep.read_bytes()
    text = run("sweep", hot.scene, "-o", sweep, *NINE_POSES, "--exr")
    assert text.startswith(f"{sweep} was complete already; nothing was traced.")
    assert sweep.read_bytes() == before


@pytest.mark.slow
def test_a_pose_is_named_with_its_lens(
    hot: HotBlock,
    tmp_path: Path,
    run: Run,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its matrix alone would not do: the scene's focal length is another."""
    monkeypatch.setattr(report_module, "sweep_charts", lambda _: {})
    monkeypatch.setattr(report_module, "sweep_pictures", lambda *_: ({}, ()))
    file = tmp_path / "a.nc"
    options = ["--azimuth=0:90:2", "--elevation=30", "--focal-length=25mm,30mm"]
    assert main(["sweep", str(hot.scene), "-o", str(file), *options]) == 0
    text = run("plan", file, "--views=1", warns="do not differ in coverage")
    best = re.search(r"^Best pose (\d+) \(focal length (\d+) mm\), camera", text, re.MULTILINE)
    assert float(best[2]) == float(read_sweep(file)["focal_length"][int(best[1])])
    assert re.search(r"^Pose \d+ \(focal length \d+ mm\), camera", text, re.MULTILINE)
    assert main(["report", str(file), "-o", str(tmp_path / "a.html")]) == 0
    said = read_page(tmp_path / "a.html").text
    assert f"Pose {best[1]} (focal length {best[2]} mm) is the best" in said


@pytest.mark.slow
def test_a_tolerance_is_not_for_a_sweep(sweep: Path, tmp_path: Path, fails: Failing) -> None:
    stated = ["--tolerance", "cylinder:bore=20 -0.02 +0.02 mm"]
    refusal = fails("report", sweep, "-o", tmp_path / "r.html", *stated)
    assert "--tolerance is for a correction" in refusal


def test_another_scene_is_not_taken_for_that_of_the_sweep(scene: Path, fails: Failing) -> None:
    """One of the files that it names, or itself, has changed, or it is no longer there."""
    assert main(["sweep", str(scene), "-o", "a.nc", "--azimuth=0:90:2", "--elevation=30"]) == 0
    first, *_, last = sorted((scene.parent / "shells").glob("*.ply"))
    before = first.read_bytes()
    shutil.copy(last, first)
    assert f"{first} has changed since the sweep" in fails("plan", "a.nc", "--refine")
    first.write_bytes(before)
    scene.write_text(scene.read_text() + "<!-- edited -->")
    assert f"{scene} has changed since the sweep" in fails("plan", "a.nc", "--refine")
    scene.unlink()
    assert "is gone" in fails("plan", "a.nc", "--refine")


def test_views_together_see_what_is_said(sweep: Path, run: Run) -> None:
    """Counted again from the sweep's own rows."""
    options = ["--views=2", "--max-displacement=50 um", "--max-incidence=60"]
    text = run("plan", sweep, *options, "--save", "views.csv")
    data = read_sweep(sweep)
    ends = np.cumsum(data["sightings"].values)
    seen = np.zeros((9, data.sizes["face"]))
    for pose in range(9):
        rows = slice(ends[pose] - data["sightings"].values[pose], ends[pose])
        good = (data["sighting_displacement"].values[rows] <= 0.05) & (
            data["sighting_incidence"].values[rows] <= 60
        )
        faces, fractions = (data[f"sighting_{name}"].values[rows] for name in ("face", "seen"))
        seen[pose, faces[good]] = fractions[good]
    area = data["face_area"].values / data["face_area"].values.sum()
    poses = [int(p) for p in re.findall(r"^Pose (\d+), camera", text, re.MULTILINE)]
    saved = read_poses("views.csv").matrices
    np.testing.assert_array_equal(saved, data["matrix"].values[poses])
    said = re.search(r"see ([\d.]+) % of the area of the part, of ([\d.]+) %", text)
    # Fractions of a face count in quarters.
    seen = np.floor(4 * seen + 0.5 - 1e-9) / 4
    chosen = seen[poses].max(axis=0) @ area
    assert float(said[1]) == pytest.approx(100 * chosen, abs=0.006)
    assert float(said[2]) == pytest.approx(100 * seen.max(axis=0) @ area, abs=0.006)
    pairs = [np.maximum(seen[a], seen[b]) @ area for a in range(9) for b in range(a + 1, 9)]
    assert chosen == pytest.approx(max(pairs))
    assert "(exact)" in text


def test_a_refined_pose_is_not_worse_and_is_kept(sweep: Path, tmp_path: Path, run: Run) -> None:
    file = tmp_path / "refined.json"
    options = ["--refine", "--evaluations=14", "-o", str(file), "--save=chosen.json"]
    text = run("plan", sweep, "--coverage=0.6", *options)
    kept = json.loads(file.read_text())
    np.testing.assert_array_equal(read_poses("chosen.json").matrices, [kept["matrix"]])
    assert json.loads(Path("chosen.json").read_text())["focus_mm"] == [kept["distance_mm"]]
    assert kept["score"] <= kept["start"]["score"]
    assert kept["evaluations"] <= 14
    np.testing.assert_allclose(matrix_after(text, "Refined pose,"), kept["matrix"], atol=1e-6)
    assert f"pose {kept['start']['pose']} ({kept['evaluations']} poses" in text
    # Rendering the start again gives what the sweep has.
    data = read_sweep(sweep).sel(region="part")
    start = kept["start"]
    for name, variable in (("displacement", "displacement_p95"), ("coverage", "coverage_area")):
        assert start["metrics"][name] == float(data[variable][start["pose"]])


def test_the_report_holds_what_plan_prints(
    sweep: Path, tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its pictures are those of tests/figures."""
    monkeypatch.setattr(report_module, "sweep_charts", lambda _: {})
    monkeypatch.setattr(report_module, "sweep_pictures", lambda *_: ({}, ()))
    options = ["--statistic=median", "--top=4"]
    text = run("plan", sweep, *options)
    file = tmp_path / "report.html"
    assert f"Report in {file}" in run("report", sweep, "-o", file, *options)
    page = read_page(file)
    page.assert_needs_nothing()
    rows = [line.split() for line in text.splitlines() if re.match(r"\s+\d+ +\d+ ", line)]
    ranking = next(table for table in page.tables if table[0][0] == "rank")
    assert rows[:4] == ranking[1:]
    matrix, xml = (lines.splitlines() for lines in page.listings)
    assert (len(matrix), xml[0].strip()) == (4, '<transform name="to_world">')
    for line in (*matrix, *xml):
        assert line.strip() in text
    assert list(tmp_path.iterdir()) == [file]


def test_a_sweep_keeps_what_it_warned_of_and_plans_show_it(
    hot: HotBlock, tmp_path: Path, run: Run
) -> None:
    """One pose sees the whole block, one half of it, one is too far away to be in focus."""
    places = [((60.0, -45.0, 70.0), (0.0, 0.0, 0.0)), ((60.0, -45.0, 70.0), (11.0, 9.0, 0.0))]
    far = ((240.0, -180.0, 280.0), (0.0, 0.0, 0.0))
    poses = PoseSet(np.stack([look_at(*place) for place in (*places, far)]))
    file = tmp_path / "s.nc"
    run_sweep(load_scene(hot.scene, engine="cells"), poses, file)
    kept = xr.open_dataset(file)["warned"]
    # By their meanings, as any program that knows the CF conventions reads them.
    masks = dict(zip(kept.flag_meanings.split(), kept.flag_masks, strict=True))
    flags = {name: ((kept.values & mask) != 0).tolist() for name, mask in masks.items()}
    assert flags["out_of_focus"] == [False, False, True]
    assert flags["part_beyond_picture"] == [False, True, False]
    assert not any(flags["air_too_coarse"])
    assert read_sweep(file)["hits_at_border"].values[0] == 0
    weights = ["--displacement=0", "--coverage=0", "--axial=0", "--lateral=1"]
    said = run("plan", file, *weights, "--min-hits=1")
    assert "b part reaches beyond the picture" in said
