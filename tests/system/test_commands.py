"""The program, render and metrics as a user runs them: files, numbers and what is printed."""

import io
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from failing import Run, metrics_of
from rich.console import Console

import iriftrace
from iriftrace.cli import console, main
from iriftrace.core.runtime import doctor
from iriftrace.image.aov_image import CHANNELS, Status
from validation.inputs.hot_block import HotBlock

COMMANDS = (
    *("doctor", "shells", "scene", "render", "metrics", "demo"),
    *("sweep", "plan", "plot", "report"),
)


def channels_of(path: str | Path) -> dict[str, np.ndarray]:
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: channel.pixels.copy() for name, channel in file.channels().items()}


def python(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=cwd,
        env={**os.environ, "COLUMNS": "80", "TERM": "dumb"},
        capture_output=True,
        text=True,
        check=False,
    )


def test_help_is_quick_and_has_an_example_and_metrics_need_no_mitsuba(
    hot: HotBlock, tmp_path: Path
) -> None:
    """Help that loads VTK or Mitsuba takes seconds, and fails where they do not work."""
    code = (
        "import sys; from iriftrace.cli import main\n"
        "for words in ([], *([name] for name in sys.argv[2:])):\n"
        "    assert main([*words, '--help']) == 0; print('END')\n"
        "print(*{'mitsuba', 'drjit', 'vtkmodules', 'pyvista', 'trimesh'} & set(sys.modules))\n"
        "assert main(['metrics', sys.argv[1], '-o', 'a.json']) == 0\n"
        "print('END', *{'mitsuba', 'drjit'} & set(sys.modules), sep='\\n')"
    )
    done = python("-c", code, str(hot.image), *COMMANDS, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    program, *texts, metrics, heavy = done.stdout.split("END\n")
    assert metrics.startswith("\n")
    assert heavy == ""
    assert max(len(line) for text in (program, *texts) for line in text.splitlines()) <= 80
    assert all(re.search(rf"^│ {name} ", program, re.MULTILINE) for name in COMMANDS)
    for command, text in zip(COMMANDS, texts, strict=True):
        assert f"Example: iriftrace {command}" in " ".join(text.split())


def test_exit_codes_reach_the_shell(tmp_path: Path) -> None:
    done = python("-m", "iriftrace", "render", "gone.xml", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert re.fullmatch(r"error: There is no scene file gone\.xml;.*\n", done.stderr)


def test_version_and_doctor(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    assert run("--version").strip() == iriftrace.__version__
    # tests/core runs the trials.
    monkeypatch.setattr(doctor, "run_trial", lambda variant: None)
    monkeypatch.setattr(doctor, "drawing_trouble", lambda: "")
    printed = run("doctor")
    for name in ("Python", "iriftrace", "mitsuba", "LLVM", "CUDA", "variant"):
        assert re.search(rf"^ok +{name} ", printed, re.MULTILINE)


def test_examples_of_the_help_run_as_they_stand(run: Run, hot: HotBlock, tmp_path: Path) -> None:
    """In a folder with a field, a part and a scene, from shells to metrics."""
    shutil.copytree(hot.scene.parent, tmp_path / "scenes" / "cylinder")
    shutil.copy(hot.field, tmp_path / "field.vtu")
    shutil.copy(hot.scene.parent / "part.ply", tmp_path)
    for command in ("shells", "scene", "render", "metrics"):
        text = " ".join(run(command, "--help").partition("╭")[0].split())
        (example,) = re.findall(r"Example: iriftrace (.*)", text)
        run(*shlex.split(example))
    assert metrics_of("shells/shells.json")["shells"][12]["layer"] == 13
    assert (tmp_path / "scene" / "scene.xml").is_file()
    assert metrics_of("out.json")["camera"]["resolution"] == [30, 25]


def test_demo(run: Run, tmp_path: Path) -> None:
    """A metrologist's summary, two pictures, and a scene that is ready to be changed."""
    printed = run("demo", "-o", "out", "-D", "scale=0.1")
    assert max(map(len, printed.partition("Assumptions")[0].splitlines())) <= 80
    flat = " ".join(printed.split())
    for words in (
        r"displacement │ median [\d.]+ um, mean",
        r"coverage │ [\d.]+ ?% of the part's area seen \(faces hit",
        r"lateral [\d.]+ um, axial",
        r"50,225 launched",
        r"region lateral │ median [\d.]+ um",
        r"time │ load",
        r"geometric optics",
        r"iriftrace render out/scene/scene.xml",
    ):
        assert re.search(words, flat), words
    out = tmp_path / "out"
    names = {path.name for path in out.iterdir()}
    pictures = {"cylinder.png", "cylinder_scene.png", "cylinder_rays.png"}
    assert names == {"scene", "cylinder.exr", "cylinder.json", *pictures}
    assert all(path.read_bytes()[:4] == b"\x89PNG" for path in out.glob("*.png"))
    run("render", out / "scene" / "scene.xml", "-D", "scale=0.1", "--no-figures")
    again, copy = metrics_of(out / "cylinder.json"), metrics_of(out / "scene" / "scene.json")
    assert without_times(again) == without_times(copy)


STATISTICS = {"mean", "median", "p25", "p75", "p95", "max"}
NUMBERS = {
    *("rays", "displacement_mm", "displacement_lateral_mm", "displacement_axial_mm", "shift_px"),
    *("lateral_resolution_mm", "axial_resolution_mm", "incidence_angle_deg"),
    *("coverage", "coverage_area"),
}


def without_times(metrics: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in metrics.items() if key != "time_s"}


def test_metrics_have_every_key_of_the_schema(hot: HotBlock) -> None:
    metrics = metrics_of(hot.image.with_suffix(".json"))
    assert metrics["schema"] == "iriftrace.pose/2"
    rays = metrics["rays"]
    assert rays.keys() == {"launched", "hit", "open_boundary", *(s.key for s in Status)}
    assert rays["launched"] == 12_000 == sum(rays[s.key] for s in Status)
    assert metrics.keys() >= NUMBERS | {"triangles_in_view", "camera", "assumptions"}
    assert metrics["displacement_mm"].keys() == STATISTICS | {"rms"}
    assert metrics["shift_px"].keys() == STATISTICS
    times = metrics["time_s"]
    steps = ("load", "build", "straight", "refracted", "check", "metrics", "write", "figures")
    assert times.keys() == {*steps, "total"}
    assert all(times[step] > 0 for step in steps)
    assert times["total"] == pytest.approx(sum(times[step] for step in steps), rel=0.5)
    assert np.shape(metrics["pose"]["matrix"]) == (4, 4)
    assert metrics["pose"]["origin_mm"] == pytest.approx([60, -45, 70])
    assert metrics["assumptions"].keys() >= {
        *("engine", "index_rule", "normals", "bending"),
        *("field_source", "field_time", "field_symmetry"),
        *("open_boundary", "camera", "optics", "sampling", "air"),
    }
    regions = metrics["regions"]
    assert regions.keys() == {f"plane {sign}{axis}" for sign in "+-" for axis in "xyz"}
    for region in regions.values():
        assert region.keys() >= NUMBERS
    seen = {name for name, region in regions.items() if region["coverage"]}
    assert seen == {"plane +x", "plane -y", "plane +z"}
    assert regions["plane -x"]["displacement_mm"]["median"] is None  # fewer than 100 good rays
    assert sum(region["rays"]["good"] for region in regions.values()) == rays["good"]


def test_colours_repeat_the_channels_that_are_asked_for(run: Run, hot: HotBlock) -> None:
    run("render", hot.scene, "-o", "c.exr", "--rgb=shift", "--no-figures")
    channels = channels_of("c.exr")
    assert channels["R"].any()
    np.testing.assert_array_equal(channels["R"], channels["shift.px.X"])
    np.testing.assert_array_equal(channels["G"], channels["shift.px.Y"])
    assert not channels["B"].any()


def test_outputs_lie_where_they_are_expected(run: Run, hot: HotBlock, tmp_path: Path) -> None:
    """Beside the scene by default; and a scene folder can be moved as a whole."""
    shutil.copytree(
        hot.scene.parent, tmp_path / "moved", ignore=shutil.ignore_patterns("scene.[ejp]*")
    )
    printed = run("render", "moved/scene.xml")
    assert "Files: moved/scene.exr, moved/scene.json, moved/scene.png" in printed
    assert {p.name for p in (tmp_path / "moved").glob("scene.*")} == {
        *("scene.xml", "scene.exr", "scene.json", "scene.png")
    }
    run("render", "moved/scene.xml", "-o", "other.exr", "--no-figures", "--variant=llvm_ad_mono")
    assert {path.name for path in tmp_path.iterdir()} == {"moved", "other.exr", "other.json"}
    first, second = channels_of("moved/scene.exr"), channels_of("other.exr")
    assert all(np.array_equal(first[name], second[name]) for name in CHANNELS)


def test_definitions_change_the_scene(run: Run, hot: HotBlock) -> None:
    options = ("-D", "scale=0.5", "-D", "normals=facet", "--no-figures", "--include=5")
    printed = run("render", hot.scene, "-o", "half.exr", *options)
    metrics = metrics_of("half.json")
    assert metrics["camera"]["resolution"] == [60, 50]
    assert metrics["assumptions"]["normals"] == "facet"
    assert metrics["assumptions"]["included_rays"] == ["good", "index_mismatch"]
    assert "good, index_mismatch" in printed
    printed = run("render", hot.scene, "-o", "tiny.exr", "-D", "scale=0.1", "--no-figures")
    assert re.search(r"displacement +│ fewer than 100 good rays, so no numbers", printed)
    metrics = metrics_of("tiny.json")
    assert 0 < metrics["rays"]["good"] < 100
    assert metrics["displacement_mm"]["median"] is None


def test_metrics_again(run: Run, hot: HotBlock, tmp_path: Path) -> None:
    """The numbers that render wrote, from the EXR alone; times apart."""
    shutil.copy(hot.image, tmp_path / "a.exr")
    printed = run("metrics", "a.exr")
    assert "Metrics in a.json" in printed
    written = metrics_of(hot.image.with_suffix(".json"))
    assert without_times(metrics_of("a.json")) == without_times(written)
    shutil.copy(hot.scene.parent / "part.ply", tmp_path / "elsewhere.ply")
    run("metrics", "a.exr", "--part", "elsewhere.ply", "-o", "b.json")
    assert without_times(metrics_of("b.json")) == without_times(written)


def test_metrics_again_in_place_of_the_renderings(run: Run, hot: HotBlock, tmp_path: Path) -> None:
    """The report that is replaced alone knew how long files and figures took."""
    for suffix in (".exr", ".json"):
        shutil.copy(hot.image.with_suffix(suffix), tmp_path / f"a{suffix}")
    before = metrics_of("a.json")
    run("metrics", "a.exr")
    after = metrics_of("a.json")
    assert {**after["time_s"], "metrics": None} == {**before["time_s"], "metrics": None}


def test_an_output_without_a_sign_shows_a_question_mark(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a file does into which Windows leads the output."""
    written = io.BytesIO()
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(written, encoding="ascii"))
    assert main(["part", "cylinder", "-o", str(tmp_path / "Pr\u00fcfling.ply")]) == 0
    sys.stdout.flush()
    assert b"Pr?fling.ply" in written.getvalue()


@pytest.mark.parametrize("width", [40, 80])
def test_numbers_of_a_table_are_never_cut(width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Many digits, long names of modes and fields, and a narrow terminal: words may wrap."""
    narrow = Console(width=width, file=io.StringIO())
    monkeypatch.setattr(console, "out", narrow)
    row = ("plume_refined_twice", "paper's but inside hits refracted", *["12345.678"] * 7)
    texts = ("field", "mode")
    console.print_table("Differences", (*texts, *"abcdefg"), [row, row], texts)
    said = narrow.file.getvalue()
    assert said.split().count("12345.678") == 14
    assert "refracted" in said
    assert "…" not in said
