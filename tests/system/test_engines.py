"""Both engines from the command line."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
from conftest import Failing
from hot_block import HotBlock

from iriftrace.cli import main
from iriftrace.continuous_field import FIELD_FILE
from iriftrace.exr import read_exr


def test_scene_carries_the_field_and_render_switches_the_engine(
    hot: HotBlock, tmp_path: Path
) -> None:
    assert (hot.scene.parent / FIELD_FILE).is_file()
    exr = tmp_path / "continuous.exr"
    assert main(["render", str(hot.scene), "-o", str(exr), "--engine", "continuous"]) == 0
    continuous, shells = read_exr(exr), read_exr(hot.image)
    assert continuous.header["engine"] == "continuous"
    assert shells.header["engine"] == "shells"
    assert (
        "ray equation" in json.loads(exr.with_suffix(".json").read_text())["assumptions"]["engine"]
    )
    good = (continuous.status == 0) & (shells.status == 0)
    assert good.sum() > 100
    lengths = [np.median(i.channels["displacement.norm"][good]) for i in (continuous, shells)]
    # Four shells of coarse cells.
    assert abs(lengths[0] / lengths[1] - 1) < 0.2
    # What the engine adds can be reduced again.
    assert main(["metrics", str(exr), "-o", str(tmp_path / "again.json")]) == 0


def test_an_older_scene_is_refused_with_what_to_do(
    hot: HotBlock, tmp_path: Path, fails: Failing
) -> None:
    shutil.copytree(hot.scene.parent, tmp_path / "old")
    (tmp_path / "old" / FIELD_FILE).unlink()
    message = fails("render", "old/scene.xml", "--engine", "continuous")
    assert "no field file" in message
    assert "`iriftrace scene FIELD PART -o SCENE.xml`" in message
