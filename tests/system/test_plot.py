"""`iriftrace plot` as a user runs it: pictures of a sweep and of a pose, and what it refuses."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from iriftrace.cli import main
from iriftrace.core.runtime import doctor
from iriftrace.figures import sweep as sweep_figures
from iriftrace.figures import sweep_space
from iriftrace.planning.summary import extreme_images, summarise
from iriftrace.sweep.store import read_sweep
from validation.inputs.hot_block import HotBlock

METRICS = ("displacement", "coverage", "axial", "lateral", "score")
VECTOR = {*(f"map_{key}" for key in METRICS), "histograms", "histograms_normalised"}
VECTOR |= {"rays", "pareto"}
IN_SPACE = {f"scene_{key}" for key in METRICS}
IN_SPACE |= {f"faces_{key}" for key in ("displacement", "times_seen", "incidence")}
VIEWS = {"view_best", "view_smallest_displacement", "view_largest_displacement"}


def names(folder: Path, suffix: str) -> set[str]:
    return {path.stem for path in folder.iterdir() if path.suffix == suffix}


@pytest.mark.slow
def test_a_sweep_becomes_pictures(
    sweep: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    (tmp_path / "figures").mkdir()
    assert main(["plot", str(sweep), "-o", str(tmp_path / "figures")]) == 0
    said = capsys.readouterr()
    assert said.err == ""
    assert names(tmp_path / "figures", ".png") == VECTOR | IN_SPACE | VIEWS
    assert names(tmp_path / "figures", ".pdf") == VECTOR
    for path in (tmp_path / "figures").iterdir():
        assert path.name in said.out


def test_without_opengl_the_rest_is_drawn(
    sweep: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(doctor, "drawing_trouble", lambda: "no driver")
    # The charts take their time.
    monkeypatch.setattr(sweep_figures, "sweep_charts", lambda _: {})
    capsys.readouterr()
    assert main(["plot", str(sweep), "-o", str(tmp_path / "figures")]) == 0
    said = capsys.readouterr()
    assert said.err.startswith("note: The 3-D pictures are left out")
    assert names(tmp_path / "figures", ".png") == VIEWS


@pytest.mark.slow
def test_a_sweep_whose_scene_is_gone_is_drawn_without_it(
    sweep: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sweep_figures, "sweep_charts", lambda _: {})
    for name in ("sweep_scene_figure", "sweep_face_figure"):
        monkeypatch.setattr(sweep_space, name, lambda *_: Figure())
    moved = tmp_path / "moved.nc"
    gone = {"scene": '{"path": "gone.xml"}', "scenes": "[]"}
    with xr.open_dataset(sweep, engine="h5netcdf") as data:
        data.load().assign_attrs(gone).to_netcdf(moved, engine="h5netcdf")
    capsys.readouterr()
    assert main(["plot", str(moved), "-o", str(tmp_path / "figures")]) == 0
    views, space = capsys.readouterr().err.splitlines()
    # The EXRs lie beside the sweep, which has moved away from them.
    assert views.startswith("note: The views from poses ")
    assert views.endswith("cannot be rendered again: gone.xml is gone.")
    assert space == "note: The 3-D pictures do not show the hot air (gone.xml is gone)."
    assert names(tmp_path / "figures", ".png") == IN_SPACE


def test_views_that_were_not_kept_are_rendered_again(sweep: Path, tmp_path: Path) -> None:
    """Away from its EXRs the sweep gives the same images of the extreme views, bit for bit."""
    dataset = read_sweep(sweep)
    summary = summarise(dataset)
    kept = dict(extreme_images(dataset, summary))
    moved = read_sweep(Path(shutil.copy(sweep, tmp_path)))
    again = dict(extreme_images(moved, summary))
    assert set(kept) == set(again) == {"best", "smallest", "largest"}
    for name, image in kept.items():
        for channel, values in image.channels.items():
            np.testing.assert_array_equal(again[name].channels[channel], values)
    medians = {
        name: np.median(image.channels["displacement.norm"][image.status == 0])
        for name, image in kept.items()
    }
    assert medians["smallest"] < medians["largest"]


def test_a_pose_becomes_its_displacement_picture(hot: HotBlock, tmp_path: Path) -> None:
    assert main(["plot", str(hot.image), "-o", str(tmp_path / "figures")]) == 0
    assert [path.name for path in (tmp_path / "figures").iterdir()] == [f"{hot.image.stem}.png"]
