"""Both engines from the command line."""

import json
from pathlib import Path

import numpy as np
import pytest

from iriftrace.cli import main
from iriftrace.core.errors import IriftraceWarning
from iriftrace.core.runtime import variant as runtime
from iriftrace.io.exr import read_exr
from iriftrace.io.field_npz import FIELD_FILE
from iriftrace.sweep.reload import load_swept_scene
from iriftrace.sweep.store import read_sweep
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.render import render_scene
from validation.inputs.hot_block import HotBlock


def test_scene_carries_the_field_and_render_switches_the_engine(
    hot: HotBlock, tmp_path: Path
) -> None:
    assert (hot.scene.parent / FIELD_FILE).is_file()
    exr = tmp_path / "continuous.exr"
    assert main(["render", str(hot.scene), "-o", str(exr), "--engine", "cells"]) == 0
    continuous, shells = read_exr(exr), read_exr(hot.image)
    assert continuous.header["engine"] == "cells"
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


@pytest.mark.slow
def test_sweep_bends_rays_through_the_field(hot: HotBlock, tmp_path: Path) -> None:
    """Each pose is the cells engine's own rendering, also when it is loaded again."""
    output = tmp_path / "sweep.nc"
    asked = ["sweep", str(hot.scene), "-o", str(output), "--azimuth=0:60:2", "--elevation=30:30:1"]
    assert main([*asked, "--engine=cells"]) == 0
    dataset = read_sweep(output)
    alone = load_scene(hot.scene, engine="cells")
    median = dataset["displacement_median"].sel(region="part").values
    swept = load_swept_scene(dataset, 0)
    assert swept.scene.compiled.engine == "cells"
    assert swept.scene.variant == alone.variant
    for pose, matrix in enumerate(dataset["matrix"].values):
        rendering = render_scene(alone, camera=alone.camera.at(matrix))
        assert median[pose] == rendering.metrics.displacement_mm.median
        again = swept.render(matrix).image
        np.testing.assert_array_equal(
            again.channels["displacement.norm"], rendering.image.channels["displacement.norm"]
        )
    (named,) = json.loads(dataset.attrs["scenes"])
    assert named["engine"] == "cells"
    # The field decides the result, so it belongs to the files that must not change.
    assert str((hot.scene.parent / FIELD_FILE).resolve()) in named["files"]
    assert "ray equation" in json.loads(dataset.attrs["assumptions"])["engine"]
    # By shells it would be another sweep.
    assert main(asked) == 2


def test_a_sweeps_variant_that_does_not_run_here_is_replaced_and_said(
    hot: HotBlock, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    output = tmp_path / "sweep.nc"
    asked = ["sweep", str(hot.scene), "-o", str(output), "--azimuth=0:0:1", "--elevation=30:30:1"]
    assert main(asked) == 0
    dataset = read_sweep(output)
    named = json.loads(dataset.attrs["scenes"])
    assert named[0]["variant"] == "llvm_ad_mono"
    assert named[0]["engine"] == "shells"
    # As on a machine without a GPU, also where there is one.
    monkeypatch.setattr(runtime, "cuda_state", lambda: runtime.CudaState((), "no device"))
    dataset.attrs["scenes"] = json.dumps([{**named[0], "variant": "cuda_ad_mono"}])
    with pytest.warns(IriftraceWarning, match="cuda_ad_mono, which does not run here"):
        assert load_swept_scene(dataset, 0).scene.variant == "llvm_ad_mono"
