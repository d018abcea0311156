"""The command compare on a rendering, with markers and maps that were made of it."""

import json
from pathlib import Path

import numpy as np
import pytest

from iriftrace.cli import main
from iriftrace.cli.compare import _with_deviation
from iriftrace.io.exr import read_exr
from validation.inputs.hot_block import HotBlock


def test_maps_and_markers_are_compared(
    hot: HotBlock, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Off by (0.3, -0.4) px everywhere; a marker's (0, 0) is the first pixel's centre."""
    image = read_exr(hot.image)
    good = image.status == 0
    measured = np.full((*good.shape, 2), np.nan)
    measured[good] = image.vector("shift.px", good) + np.array((0.3, -0.4))
    np.save(tmp_path / "map.npy", measured)
    row, column = np.nonzero(good)
    table = np.column_stack((column, row, measured[good]))[::10]
    np.savetxt(tmp_path / "m.csv", table, delimiter=",", header="u,v,du,dv", comments="")
    for name in ("map.npy", "m.csv"):
        target = tmp_path / f"{name}.json"
        words = ["compare", hot.image, tmp_path / name, "-o", target, "--positions=hot"]
        assert main([*map(str, words)]) == 0
        assert "which explains" in capsys.readouterr().out
        assert target.with_suffix(".png").is_file()
        report = json.loads(target.read_text())
        assert report["schema"] == "iriftrace.comparison/2"
        assert report["wavelength_nm"] == 633.0
        assert report["residual_px"]["bias"] == pytest.approx((0.3, -0.4), abs=1e-5)
        assert report["camera_motion"]["explained"] > 0.9


def test_places_that_were_not_found_are_left_out_and_counted(
    hot: HotBlock, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of 90 rows 10 are marked and 8 exactly 0, by which the residual's rms would be wrong."""
    image = read_exr(hot.image)
    row, column = (axis[:90] for axis in np.nonzero(image.status == 0))
    shifts = image.vector("shift.px")[row, column] + np.array((0.3, -0.4))
    valid = np.ones(90)
    shifts[:10], valid[:10], shifts[40:48] = 5.0, 0.0, 0.0
    table = np.column_stack((column, row, shifts, valid))
    np.savetxt(tmp_path / "m.csv", table, delimiter=",", header="u,v,du,dv,valid", comments="")
    target = tmp_path / "out.json"
    words = ["compare", str(hot.image), str(tmp_path / "m.csv"), "-o", str(target)]
    words += ["--positions=hot", "--no-figures"]
    assert main(words) == 0
    assert "leave them out with --without-zeros" in " ".join(capsys.readouterr().err.split())
    points = json.loads(target.read_text())["points"]
    assert (points["measured"], points["failed"], points["zeros"]) == (80, 10, 0)
    assert main([*words, "--without-zeros"]) == 0
    said = capsys.readouterr()
    assert "10 marked as not found, 8 exactly 0" in said.out
    assert "--without-zeros" not in said.err
    report = json.loads(target.read_text())
    assert (report["points"]["measured"], report["points"]["zeros"]) == (72, 8)
    assert report["residual_px"]["rms"] == pytest.approx(0.5, abs=1e-5)


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
