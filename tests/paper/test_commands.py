"""The studies as a user runs them: files, tables, going on after a kill, and wrong input."""

import io
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from failing import Run
from rich.console import Console

from iriftrace.cli import console, main
from validation.paper.__main__ import study
from validation.paper.study import read_study
from validation.inputs import hot_block
from validation.inputs.hot_block import HotBlock
from validation.inputs.journals import pieces_done

CAMERA = [word for word in hot_block.CAMERA if not word.startswith(("--resolution", "--scale"))]
SMALL = [*CAMERA, "--resolution=60,50", "--scale=1"]


@pytest.mark.parametrize(
    ("name", "scale"), [("layers", 0.25), ("mesh", 0.25), ("polygons", 0.25), ("rays", 1.0)]
)
def test_moving_the_camera_does_not_change_the_resolution(name: str, scale: float) -> None:
    words = [name, "field.vtu", "part.ply", "--origin=150,-100,120"]
    _, bound, _ = study.parse_args(words, exit_on_error=False, print_error=False)
    bound.apply_defaults()
    assert bound.arguments["options"].camera.origin == (150.0, -100.0, 120.0)
    assert bound.arguments["scale"] == scale


@pytest.mark.slow
def test_layers_write_a_file_and_a_figure_and_print_a_table(
    hot: HotBlock, tmp_path: Path, run: Run
) -> None:
    out = tmp_path / "layers.nc"
    words = ["study", "layers", hot.field, hot.part, "-o", out, "--layers=2:3", "--drop-inner=1"]
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
    pictures = tmp_path / "figures"
    assert "layers.png" in run("plot", out, "-o", pictures)
    assert (pictures / "layers.png").read_bytes() == out.with_suffix(".png").read_bytes()
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
    hot: HotBlock,
    tmp_path: Path,
    run: Run,
    line: str,
    dimension: str,
    length: int,
) -> None:
    other = tmp_path / "finer.vtu"
    hot_block.air(12).save(other)
    words = shlex.split(line.format(field=hot.field, part=hot.part, other=other))
    out = tmp_path / "study.nc"
    extra = ["-o", out, "--reference=same mode", "--inside-hit=refract", *SMALL]
    said = run("study", *words, *extra)
    assert "Difference from the finest field, same mode / um" in said
    found = read_study(out)
    assert found.sizes[dimension] == length
    assert "other" in found["mode"].values
    assert out.with_suffix(".png").is_file()


@pytest.mark.slow
def test_times_are_printed_as_ratios(hot: HotBlock, tmp_path: Path, run: Run) -> None:
    out = tmp_path / "rays.nc"
    words = ["--scales=0.5,1", "--layers=2", *SMALL]
    said = run("study", "rays", hot.field, hot.part, "-o", out, *words)
    assert "times over that of the refracted trace" in said
    first, second = _rows(said)
    assert (first[0], second[0]) == ("750", "3,000")
    # The growth of the first case over itself.
    assert first[1] == "1.00"
    assert out.with_suffix(".png").is_file()


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


def test_a_picture_of_few_rays_is_refused(
    hot: HotBlock, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Statistics of less than 100 rays are none, as in the metrics of a picture."""
    words = ["study", "layers", hot.field, hot.part, "-o", tmp_path / "a.nc", "--layers=2"]
    small = ["--resolution=120,100", "--scale=0.05"]
    assert main([str(word) for word in (*words, *CAMERA, *small)]) == 2
    assert re.search(r"of the 30 rays .* at least 100", capsys.readouterr().err)
    assert list(tmp_path.iterdir()) == []


def _rows(said: str) -> list[list[str]]:
    """Cells of the rows of the first table that hold numbers."""
    rows = [line.split() for line in said.splitlines()]
    return [row for row in rows if row and row[0][0].isdigit()][:2]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL")
def test_a_killed_study_goes_on(hot: HotBlock, tmp_path: Path, run: Run) -> None:
    out = tmp_path / "layers.nc"
    words = ["study", "layers", str(hot.field), str(hot.part), "-o", str(out), "--layers=1:4"]
    words += ["--reference=3", *SMALL]
    journal = tmp_path / "layers.nc.partial"
    program = subprocess.Popen(
        [sys.executable, "-m", "iriftrace", *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ},
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
