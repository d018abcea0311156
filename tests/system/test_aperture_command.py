"""Bias and blur of a lens in the files and on the screen of ``render`` and ``measure``."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from iriftrace.cli import main
from iriftrace.scenes import folder_of

pytestmark = pytest.mark.usefixtures("variant")


def test_render_states_bias_and_blur_and_metrics_keep_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    xml, exr = str(folder_of("slab") / "scene.xml"), str(tmp_path / "out.exr")
    words = ["-D", "scale=0.1", "--no-figures", "--aperture", "f/2", "--focus-distance", "15 cm"]
    assert main(["render", xml, "-o", exr, *words]) == 0
    text = " ".join(capsys.readouterr().out.split())
    written = json.loads((tmp_path / "out.json").read_text())
    lens = written["aperture"]
    assert (lens["f_number"], lens["focus_mm"], lens["samples"]) == (2.0, 150.0, 32)
    bias, blur = (f"{lens[key]['median']:.2g}" for key in ("bias_px", "blur_px"))
    assert f"Aperture f/2 of the camera, in focus at 150 mm: bias {bias} px, blur {blur} px" in text
    assert lens["shift_px"]["median"] == pytest.approx(written["shift_px"]["median"], rel=0.02)
    assert 0.0 < lens["bias_px"]["median"] < lens["blur_px"]["median"]
    assert main(["metrics", exr]) == 0
    assert json.loads((tmp_path / "out.json").read_text())["aperture"] == lens


def test_a_picture_through_a_pinhole_has_no_lens(tmp_path: Path) -> None:
    xml, exr = str(folder_of("slab") / "scene.xml"), str(tmp_path / "out.exr")
    assert main(["render", xml, "-o", exr, "-D", "scale=0.05", "--no-figures"]) == 0
    assert "aperture" not in json.loads((tmp_path / "out.json").read_text())


def test_measure_states_both_devices(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    xml, cloud = str(folder_of("fringe_cylinder") / "scene.xml"), str(tmp_path / "scan.vtp")
    words = ["-D", "scale=0.05", "--no-figures", "--aperture", "f/4"]
    assert main(["measure", xml, "-o", cloud, *words]) == 0
    lenses = json.loads((tmp_path / "scan.json").read_text())["aperture"]
    assert set(lenses) == {"camera", "projector"}
    text = capsys.readouterr().out
    assert "of the camera" in text
    assert "of the projector" in text


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--aperture", "4"], "f/4"),
        (["--aperture", "f/0"], "f-number is 0"),
        (["--focus-distance", "100 mm"], "--aperture"),
        (["--aperture", "f/4", "--focus-distance=-3 mm"], "--focus-distance"),
    ],
)
def test_wrong_lenses_end_in_one_sentence(
    words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    xml, exr = str(folder_of("slab") / "scene.xml"), tmp_path / "out.exr"
    assert main(["render", xml, "-o", str(exr), "-D", "scale=0.05", *words]) == 2
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
