"""``iriftrace render --check-shells``: the shells' distance from the field, beside the metrics."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from failing import Failing

from iriftrace.cli import main
from iriftrace.scene.load import load_scene
from iriftrace.trace import field_reference as shell_check
from iriftrace.trace.field_reference import ShellError, shell_error
from iriftrace.trace.pose_image import pose_image
from validation.inputs.hot_block import HotBlock

KEY = "shells_against_field"


def test_it_is_the_difference_of_two_renderings(hot: HotBlock) -> None:
    """A small picture is its own sample, so both engines' images give every number."""
    shells = load_scene(hot.scene)
    width, height = shells.camera.resolution
    found = shell_error(shells, sample=width * height)
    images = [pose_image(load_scene(hot.scene, engine=engine)) for engine in ("shells", "cells")]
    good = [image.status == 0 for image in images]
    both = good[0] & good[1]
    vectors = [image.vector("displacement").astype(np.float64) for image in images]
    distance = np.linalg.norm(vectors[0] - vectors[1], axis=-1)[both]
    length = np.linalg.norm(vectors[1], axis=-1)[good[1]]
    assert found.rays == both.sum() > 100
    assert found.unmatched == (good[0] != good[1]).sum()
    assert found.median_mm == pytest.approx(np.median(distance))
    assert found.p95_mm == pytest.approx(np.percentile(distance, 95))
    assert found.median_share == pytest.approx(np.median(distance) / np.median(length))
    assert found.p95_share == pytest.approx(np.percentile(distance, 95) / np.percentile(length, 95))


def test_a_sample_is_a_coarser_picture(hot: HotBlock) -> None:
    shells = load_scene(hot.scene)
    width, height = shells.camera.resolution
    whole, quarter = (shell_error(shells, sample=width * height // n) for n in (1, 4))
    assert quarter.rays == pytest.approx(whole.rays / 4, rel=0.1)
    assert quarter.median_mm == pytest.approx(whole.median_mm, rel=0.3)


@pytest.mark.parametrize("limit", [1e-6, 1.0])
def test_render_says_it_and_metrics_keeps_it(
    hot: HotBlock,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    limit: float,
) -> None:
    monkeypatch.setattr(shell_check, "P95_LIMIT", limit)
    exr = tmp_path / "checked.exr"
    assert main(["render", str(hot.scene), "-o", str(exr), "--check-shells", "--no-figures"]) == 0
    said = capsys.readouterr().out
    report = exr.with_suffix(".json")
    values = json.loads(report.read_text())[KEY]
    assert "shells against field" in said
    enough = values["median_share"] <= shell_check.MEDIAN_LIMIT and values["p95_share"] <= limit
    assert values["suffice"] == enough
    assert ("--engine cells" in said) == (not enough)
    assert main(["metrics", str(exr)]) == 0
    assert json.loads(report.read_text())[KEY] == values


def test_either_share_alone_is_too_much() -> None:
    limits = {"shells": 13, "rays": 900, "unmatched": 0, "median_mm": 1e-3, "p95_mm": 1e-2}
    assert ShellError(**limits, median_share=0.019, p95_share=0.039).suffice
    assert not ShellError(**limits, median_share=0.021, p95_share=0.039).suffice
    assert not ShellError(**limits, median_share=0.019, p95_share=0.041).suffice


def test_without_shells_or_field_there_is_nothing_to_check(
    hot: HotBlock, scene: Path, fails: Failing
) -> None:
    asked = ("render", scene, "-o", "out.exr", "--check-shells")
    assert "no shells to check" in fails(*asked, "--engine", "cells")
    (scene.parent / "field.npz").unlink()
    assert "no field file" in fails(*asked)
    shutil.copy(hot.scene.parent / "field.npz", scene.parent)
    table = scene.parent / "shells" / "shells.json"
    theirs = json.loads(table.read_text())
    theirs["source"]["sha256"] = "0" * 64
    table.write_text(json.dumps(theirs))
    assert "another field than its field file" in fails(*asked)


def test_a_few_rays_check_nothing(
    hot: HotBlock, fails: Failing, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shell_check, "FEWEST", 10**6)
    message = fails("render", str(hot.scene), "-o", "out.exr", "--check-shells")
    assert "too few to check the shells; render at least 1000000" in message
