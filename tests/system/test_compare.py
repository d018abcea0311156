"""The command compare on a rendering, with markers and maps that were made of it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from iriftrace.cli import main
from iriftrace.cli.compare import _with_deviation
from iriftrace.image.aov_image import read_exr
from validation.inputs.hot_block import HotBlock

MOTION = np.array((4e-3, -3e-3, 6e-3, 2e-5, -3e-5, 5e-5))
NOISE = 5e-4


def measurement(image_path: Path, seed: int = 1) -> np.ndarray:
    """(h, w, 2) map: the rendering's shift, a rigid motion of the camera, and noise."""
    image = read_exr(image_path)
    camera = image.camera
    good = image.status == 0
    hits = image.vector("refracted", good)
    step = np.eye(4)
    step[:3, :3] = Rotation.from_rotvec(MOTION[3:]).as_matrix()
    step[:3, 3] = MOTION[:3]
    rigid = camera.at(camera.matrix @ step).project(hits) - camera.project(hits)
    field = np.full((*good.shape, 2), np.nan)
    noise = np.random.default_rng(seed).normal(0, NOISE, rigid.shape)
    field[good] = image.vector("shift.px", good) + rigid + noise
    return field


def test_map_and_markers_give_motion_and_noise_back(
    hot: HotBlock, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Markers in OpenCV's pixels: (0, 0) is the first pixel's centre."""
    field = measurement(hot.image)
    np.save(tmp_path / "map.npy", field)
    row, column = np.nonzero(np.isfinite(field[..., 0]))
    chosen = np.random.default_rng(2).choice(len(row), 400, replace=False)
    row, column = row[chosen], column[chosen]
    table = np.column_stack((column, row, field[row, column]))
    np.savetxt(tmp_path / "m.csv", table, delimiter=",", header="u,v,du,dv", comments="")
    for name in ("map.npy", "m.csv"):
        target = tmp_path / f"{name}.json"
        words = ["compare", hot.image, tmp_path / name, "-o", target, "--positions=hot"]
        assert main([*map(str, words)]) == 0
        assert "which explains" in capsys.readouterr().out
        assert target.with_suffix(".png").is_file()
        report = json.loads(target.read_text())
        assert report["schema"] == "iriftrace.comparison/1"
        assert report["wavelength_nm"] == 633.0
        found = report["camera_motion"]
        got = np.array((*found["translation_um"], *found["rotation_urad"]))
        deviations = np.array((*found["translation_std_um"], *found["rotation_std_urad"]))
        expected = MOTION * np.array((1e3,) * 3 + (1e6,) * 3)
        assert (np.abs(got - expected) < 4 * deviations + 1e-3 * np.abs(expected)).all()
        assert found["rms_after_px"] == pytest.approx(np.sqrt(2) * NOISE, rel=0.1)
        assert found["explained"] > 0.9
        assert found["correlation_after"] > report["correlation"]


def test_rendering_compared_with_itself_leaves_nothing(hot: HotBlock, tmp_path: Path) -> None:
    """By default the files go beside the rendering; --no-figures leaves the picture out."""
    image = tmp_path / "out.exr"
    image.write_bytes(hot.image.read_bytes())
    assert main(["compare", str(image), str(hot.image), "--positions=hot", "--no-figures"]) == 0
    name = f"out_against_{hot.image.stem}.json"
    report = json.loads((tmp_path / name).read_text())
    assert report["residual_px"]["max"] == 0
    assert report["points"]["without_simulation"] == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out.exr", name]


def test_a_scaled_rendering_says_so(
    hot: HotBlock, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """120 x 100 pixels, a half of them: markers may be meant for either picture."""
    image = tmp_path / "half.exr"
    assert main(["render", str(hot.scene), "-o", str(image), "-D", "scale=0.5"]) == 0
    found = read_exr(image)
    assert found.header["full_resolution"] == [120, 100]
    row, column = np.nonzero(found.status == 0)
    shift = found.vector("shift.px", found.status == 0)
    table = np.column_stack((column, row, shift))
    np.savetxt(tmp_path / "m.csv", table, delimiter=",", header="u,v,du,dv", comments="")
    capsys.readouterr()
    words = ["compare", str(image), str(tmp_path / "m.csv"), "--positions=hot", "--no-figures"]
    assert main(words) == 0
    said = capsys.readouterr()
    assert "half.exr, 60 x 50 px" in said.out
    assert "60 x 50 px, 0.5 times the camera's 120 across" in said.err
    assert "scale=1" in said.err


@pytest.mark.parametrize(
    ("value", "deviation", "text"),
    [
        (3.14159, 118.3, "3.142 +- 120 um (not significant)"),
        (-351.26, 1.26, "-351.3 +- 1.3 um"),
        (-0.5, 0.6, "-0.5 +- 0.6 um (not significant)"),
        (123456.0, 2345.0, "123500 +- 2300 um"),
    ],
)
def test_motion_is_written_without_exponents(value: float, deviation: float, text: str) -> None:
    assert _with_deviation(value, deviation, "um") == text
