"""Pairs of poses: ranked by offsets as the exact solver has them; wrong requests are refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.planning.criteria import Criteria
from iriftrace.planning.pairs import plan_pairs
from iriftrace.scenes import folder_of
from iriftrace.sweep.store import read_sweep

BY_ERROR = Criteria(
    displacement=1.0, coverage=0.0, axial=0.0, lateral=0.0, statistic="median", min_coverage=0.15
)


@pytest.fixture(scope="module")
def swept(variant: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bundled cylinder from seven places 15 degrees apart."""
    file = tmp_path_factory.mktemp("pairs") / "sweep.nc"
    xml = folder_of("cylinder") / "scene.xml"
    orbit = ["--azimuth=90", "--elevation=-45:45:7", "-D", "scale=0.1"]
    assert main(["sweep", str(xml), "-o", str(file), *orbit]) == 0
    return file


@pytest.fixture(scope="module")
def dataset(swept: Path) -> xr.Dataset:
    return read_sweep(swept)


def test_the_order_is_that_of_what_the_pairs_measure(dataset: xr.Dataset) -> None:
    """Centres of faces stand for their points, so errors agree to a tenth."""
    found = plan_pairs(dataset, BY_ERROR)
    assert (np.diff(found.score) >= 0).all()
    assert len(found.exact_mm) == 3
    assert found.exact_mm == pytest.approx(found.error_mm[:3], rel=0.1)
    assert (found.bias_mm < 0).all(), "a hot cylinder measures too small"


@pytest.mark.usefixtures("variant")
def test_angles_are_those_of_the_lines(dataset: xr.Dataset) -> None:
    found = plan_pairs(dataset, BY_ERROR, confirm=False, angles_deg=(15.0, 45.0))
    assert ((found.angle_deg >= 15) & (found.angle_deg <= 45)).all()
    wide = plan_pairs(dataset, BY_ERROR, confirm=False, angles_deg=(15.0, 80.0))
    assert len(wide.pairs) > len(found.pairs)
    assert len(found.exact_mm) == 0


def test_two_cameras_may_change_places(dataset: xr.Dataset) -> None:
    stereo = plan_pairs(dataset, BY_ERROR, system="stereo", confirm=False)
    assert (stereo.pairs[:, 0] < stereo.pairs[:, 1]).all()
    fringe = plan_pairs(dataset, BY_ERROR, confirm=False)
    assert len(fringe.pairs) == 2 * len(stereo.pairs)


def test_a_diameter_to_first_order_is_what_is_measured(dataset: xr.Dataset) -> None:
    """From the side, where the cylinder is seen over a wide arc; and ranked by it."""
    found = plan_pairs(dataset, BY_ERROR, feature="cylinder:lateral", angles_deg=(15.0, 80.0))
    assert found.exact_engine == "continuous"
    assert found.exact_mm == pytest.approx(found.bias_mm[:3], abs=2e-3)
    worst = np.maximum(np.abs(found.bias_mm), found.error_mm)
    assert (np.diff(worst) >= 0).sum() >= 0.9 * (len(worst) - 1)


def test_poses_of_several_scenes_are_paired_scene_by_scene(dataset: xr.Dataset) -> None:
    """A pose alone in its scene has no partner."""
    alone = plan_pairs(dataset, BY_ERROR, confirm=False)
    names = np.array(["one", "two", *["one"] * (dataset.sizes["pose"] - 2)], dtype=object)
    mixed = plan_pairs(dataset.assign(scene=("pose", names)), BY_ERROR, confirm=False)
    assert 0 < len(mixed.pairs) < len(alone.pairs)
    assert (mixed.pairs != 1).all()


@pytest.mark.parametrize(
    ("chosen", "said"),
    [
        ({"feature": "cylinder:head -x"}, "is a plane and no cylinder"),
        ({"feature": "cylinder"}, "no simple surface"),
        ({"feature": "plane:head -x"}, "diameter of a cylinder or sphere"),
        ({"feature": "cylinder:nowhere"}, "no region 'nowhere'"),
        (
            {"feature": "cylinder:lateral", "criteria": Criteria(region="head -x")},
            "not on the region",
        ),
        ({"angles_deg": (45.0, 15.0)}, "no range of triangulation"),
        ({"angles_deg": (0.1, 0.2)}, "No two poses of the sweep"),
        ({"criteria": Criteria(region="nowhere")}, "no region 'nowhere'"),
    ],
)
def test_wrong_requests(dataset: xr.Dataset, chosen: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        plan_pairs(dataset, **{"criteria": BY_ERROR, **chosen})


def test_a_sweep_without_offsets_is_refused(dataset: xr.Dataset) -> None:
    """As earlier versions wrote it."""
    with pytest.raises(InputError, match="run it again"):
        plan_pairs(dataset.drop_vars("sighting_offset_x"))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--system=stereo"], "--system is given without --pairs"),
        (["--angle=15:45"], "--angle is given without --pairs"),
        (["--feature=cylinder:lateral"], "--feature is given without --pairs"),
        (["--pairs", "--views=3"], "--views is about single poses"),
        (["--pairs", "--refine"], "--refine is about single poses"),
    ],
)
def test_options_that_belong_together(
    swept: Path, options: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["plan", str(swept), *options]) == 2
    assert said in " ".join(capsys.readouterr().err.split())


def test_the_best_pair_is_printed(swept: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["plan", str(swept), "--pairs", "--no-confirm", "--top=2"]) == 0
    said = capsys.readouterr().out
    assert "both see" in said
    assert "Second device, pose" in said
