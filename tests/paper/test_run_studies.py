"""The studies as they are run: files, tables, going on after a kill, and wrong input."""

import os
import re
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from validation.inputs import hot_block
from validation.inputs.journals import pieces_done
from validation.paper.__main__ import main, study
from validation.paper.study import read_study

CAMERA = [word for word in hot_block.CAMERA if not word.startswith(("--resolution", "--scale"))]
SMALL = [*CAMERA, "--resolution=60,50", "--scale=1"]

ROOT = Path(__file__).parents[2]

Files = tuple[Path, Path]
Run = Callable[..., str]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Run a study in a fresh folder; returns its output."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")

    def program(*words: str | Path) -> str:
        capsys.readouterr()
        code = main([str(word) for word in words])
        said = capsys.readouterr()
        assert code == 0, said.err
        return said.out

    return program


@pytest.mark.parametrize(
    ("name", "scale"), [("layers", 0.25), ("mesh", 0.25), ("polygons", 0.25), ("rays", 1.0)]
)
def test_moving_the_camera_does_not_change_the_resolution(name: str, scale: float) -> None:
    words = [name, "field.vtu", "part.ply", "--origin=150,-100,120"]
    _, bound, _ = study.parse_args(words, exit_on_error=False, print_error=False)
    bound.apply_defaults()
    assert bound.arguments["options"].camera.origin == (150.0, -100.0, 120.0)
    assert bound.arguments["scale"] == scale


def test_layers_write_a_file_and_a_figure_and_print_a_table(
    files: Files, tmp_path: Path, run: Run
) -> None:
    out = tmp_path / "layers.nc"
    words = ["layers", *files, "-o", out, "--layers=2:3", "--drop-inner=1"]
    words += ["--reference=3", "--explain", *SMALL]
    said = run(*words)
    assert "Difference from 3 shells of the same mode / um" in said
    assert out.with_suffix(".png").stat().st_size > 10_000
    found = read_study(out)
    assert [str(name) for name in found["mode"].values] == [
        "ours",
        "paper's",
        "paper's but gradient normals",
        "paper's but rim rule",
        "paper's but inside hits refracted",
        "paper's but all shells",
    ]
    np.testing.assert_array_equal(found["layers"], [2, 3])
    # One of two, and of three, is left out; the last level of the outer rule has no surface anyway.
    np.testing.assert_array_equal(found["shells"][:2], [[2, 3], [1, 2]])
    assert "sha256" in found.attrs["fields"]
    # The same command again only reads what is there.
    written = out.stat().st_mtime_ns
    assert run(*words) == said
    assert out.stat().st_mtime_ns == written


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "dimension", "length"),
    [
        ("smoothing {field} {part} {field} --iterations 0,2 --layers 2", "iterations", 2),
        ("mesh {field} {part} {other} --layers 2 --split {field}", "field", 4),
    ],
)
def test_studies_over_several_fields(
    files: Files,
    tmp_path: Path,
    run: Run,
    line: str,
    dimension: str,
    length: int,
) -> None:
    other = tmp_path / "finer.vtu"
    hot_block.air(12).save(other)
    words = shlex.split(line.format(field=files[0], part=files[1], other=other))
    out = tmp_path / "study.nc"
    extra = ["-o", out, "--reference=same mode", "--inside-hit=refract", *SMALL]
    said = run(*words, *extra)
    assert "Difference from the finest field, same mode / um" in said
    found = read_study(out)
    assert found.sizes[dimension] == length
    assert "other" in found["mode"].values
    assert out.with_suffix(".png").is_file()


@pytest.mark.slow
def test_times_are_printed_as_ratios(files: Files, tmp_path: Path, run: Run) -> None:
    out = tmp_path / "rays.nc"
    said = run("rays", *files, "-o", out, "--scales=0.5,1", "--layers=2", *SMALL)
    assert "times over that of the refracted trace" in said
    first, second = _rows(said)
    assert (first[0], second[0]) == ("750", "3,000")
    # The growth of the first case over itself.
    assert first[1] == "1.00"
    assert out.with_suffix(".png").is_file()


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("layers {field}", "--part"),
        ("layers gone.vtu {part}", "gone.vtu"),
        ("layers {part} {field}", "field and part may be exchanged"),
        ("layers {field} {part} -o a.csv", r"\.nc"),
        ("layers {field} {part} --layers many", "many"),
        ("layers {field} {part} --layers 20:1", "20:1"),
        ("layers {field} {part} --layers 0", "0 shells"),
        ("layers {field} {part} --layers 2,2", "each once"),
        ("layers {field} {part} --normals smooth", "smooth"),
        ("layers {field} {part} --drop-inner=-1", "-1"),
        ("layers {field} {part} --isosurfaces", "volume field"),
        ("layers {field} {part} --variant scalar_rgb", "scalar_rgb"),
        # Statistics of less than 100 rays are none, as in the metrics of a picture.
        (
            f"layers {{field}} {{part}} --layers=2 {shlex.join(CAMERA)} --resolution=120,100 "
            "--scale=0.05",
            r"of the 30 rays .* at least 100",
        ),
        ("smoothing {field} {part}", "--finest"),
        ("smoothing {field} {part} {field} --iterations=-3", "-3"),
        ("mesh {field} {part} {field}", "given twice"),
        ("mesh {field} {part} finer.vtu --split gone.vtu", "gone.vtu"),
        ("rays {field} {part} --scales big", "big"),
        ("polygons {field} {part} --smallest 5", "at least 400"),
    ],
)
def test_wrong_input_is_refused_and_writes_nothing(
    files: Files,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    line: str,
    words: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    hot_block.air(6).save("finer.vtu")
    assert main(shlex.split(line.format(field=files[0], part=files[1]))) == 2
    assert re.search(words, capsys.readouterr().err)
    assert [path.name for path in tmp_path.iterdir()] == ["finer.vtu"]


def _rows(said: str) -> list[list[str]]:
    """Cells of the rows of the first table that hold numbers."""
    rows = [line.split() for line in said.splitlines()]
    return [row for row in rows if row and row[0][0].isdigit()][:2]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL")
def test_a_killed_study_goes_on(files: Files, tmp_path: Path, run: Run) -> None:
    out = tmp_path / "layers.nc"
    words = ["layers", *map(str, files), "-o", str(out), "--layers=1:4"]
    words += ["--reference=3", *SMALL]
    journal = tmp_path / "layers.nc.partial"
    program = subprocess.Popen(
        [sys.executable, "-m", "validation.paper", *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    try:
        while program.poll() is None and pieces_done(journal) < 1:
            time.sleep(0.02)
    finally:
        program.send_signal(signal.SIGKILL)
        program.wait()
    assert not out.exists()
    assert pieces_done(journal) >= 1
    run(*words)
    again = tmp_path / "again.nc"
    run(*[word.replace("layers.nc", "again.nc") for word in words])
    assert not journal.exists()
    for name, values in read_study(again).items():
        np.testing.assert_array_equal(read_study(out)[name], values)
