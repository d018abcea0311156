"""Pairs of poses: ranked by offsets as the exact solver has them; wrong requests are refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from attrs import evolve

from iriftrace.cli import main
from iriftrace.cli.plan_text import print_pairs
from iriftrace.core.errors import InputError
from iriftrace.measuring.features.choice import FeatureChoice
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.measuring.two_devices.scan import Scan
from iriftrace.planning.criteria import Criteria, Pairing
from iriftrace.planning.pairs import plan_pairs
from iriftrace.planning.refine import refine_pair
from iriftrace.scenes import folder_of
from iriftrace.sweep.reload import swept_camera
from iriftrace.sweep.store import read_sweep
from iriftrace.tracing.load import load_scene

BY_ERROR = Criteria(
    displacement=1.0, coverage=0.0, axial=0.0, lateral=0.0, statistic="median", min_coverage=0.15
)


@pytest.fixture(scope="module")
def swept(variant: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bundled cylinder from seven places 15 degrees apart."""
    file = tmp_path_factory.mktemp("pairs") / "sweep.nc"
    xml = folder_of("cylinder_paper") / "scene.xml"
    orbit = ["--azimuth=90", "--elevation=-45:45:7", "-D", "scale=0.12"]
    assert main(["sweep", str(xml), "-o", str(file), *orbit]) == 0
    return file


@pytest.fixture(scope="module")
def dataset(swept: Path) -> xr.Dataset:
    return read_sweep(swept)


@pytest.mark.slow
def test_the_order_is_that_of_what_the_pairs_measure(dataset: xr.Dataset) -> None:
    """To a tenth: a sweep's rays leave out faces that the projector grazes, with large errors."""
    found = plan_pairs(dataset, BY_ERROR)
    assert len(found.exact_mm) == 3
    assert (np.diff(found.exact_mm) >= 0).all(), "the measured ones by what they measured"
    for known in (found.score[:3], found.score[3:]):
        assert (np.diff(known) >= 0).all()
    assert found.exact_mm == pytest.approx(found.error_mm[:3], rel=0.1)
    assert (found.bias_mm < 0).all(), "a hot cylinder measures too small"


def test_measured_pairs_change_places(dataset: xr.Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second of the first order measures best: everything of it goes with it."""
    before = plan_pairs(dataset, BY_ERROR, Pairing(confirm=False))
    low, high = before.limits["error"]
    measured = [low + share * (high - low) for share in (0.9, 0.1, 0.5)]
    errors = iter(measured)
    monkeypatch.setattr("iriftrace.planning.pairs.statistic_along", lambda *_: next(errors))
    after = plan_pairs(dataset, BY_ERROR)
    places = [1, 2, 0]
    assert after.exact_mm.tolist() == sorted(measured)
    for name in ("pairs", "error_mm", "bias_mm", "coverage", "angle_deg"):
        np.testing.assert_array_equal(getattr(after, name)[:3], getattr(before, name)[places])
        np.testing.assert_array_equal(getattr(after, name)[3:], getattr(before, name)[3:])
    assert (np.diff(after.score[:3]) > 0).all()
    np.testing.assert_array_equal(after.score[3:], before.score[3:])


@pytest.mark.usefixtures("variant")
def test_angles_are_those_of_the_lines(dataset: xr.Dataset) -> None:
    found = plan_pairs(dataset, BY_ERROR, Pairing(confirm=False, angle=(15.0, 45.0)))
    assert ((found.angle_deg >= 15) & (found.angle_deg <= 45)).all()
    wide = plan_pairs(dataset, BY_ERROR, Pairing(confirm=False, angle=(15.0, 80.0)))
    assert len(wide.pairs) > len(found.pairs)
    assert len(found.exact_mm) == 0


def test_two_cameras_may_change_places(dataset: xr.Dataset) -> None:
    stereo = plan_pairs(dataset, BY_ERROR, Pairing(system="stereo", confirm=False))
    assert (stereo.pairs[:, 0] < stereo.pairs[:, 1]).all()
    fringe = plan_pairs(dataset, BY_ERROR, Pairing(confirm=False))
    assert len(fringe.pairs) == 2 * len(stereo.pairs)


def test_a_diameter_to_first_order_is_what_is_measured(dataset: xr.Dataset) -> None:
    """From the side, where the cylinder is seen over a wide arc; and ranked by it."""
    found = plan_pairs(dataset, BY_ERROR, Pairing(feature="cylinder:lateral", angle=(15.0, 80.0)))
    assert found.exact_engine == "shells"
    assert found.exact_mm == pytest.approx(found.bias_mm[:3], abs=3e-4)
    worst = np.maximum(np.abs(found.bias_mm), found.error_mm)
    assert (np.diff(worst) >= 0).sum() >= 0.9 * (len(worst) - 1)


def test_poses_of_several_scenes_are_paired_scene_by_scene(dataset: xr.Dataset) -> None:
    """A pose alone in its scene has no partner."""
    alone = plan_pairs(dataset, BY_ERROR, Pairing(confirm=False))
    names = np.array(["one", "two", *["one"] * (dataset.sizes["pose"] - 2)], dtype=object)
    mixed = plan_pairs(dataset.assign(scene=("pose", names)), BY_ERROR, Pairing(confirm=False))
    assert 0 < len(mixed.pairs) < len(alone.pairs)
    assert (mixed.pairs != 1).all()


def of_pairs(dataset: xr.Dataset, criteria: Criteria = BY_ERROR, **pairing: Any) -> None:
    plan_pairs(dataset, criteria, Pairing(**pairing))


@pytest.mark.parametrize(
    ("chosen", "said"),
    [
        ({"feature": "cylinder:head -x"}, "is a plane and not a cylinder"),
        ({"feature": "cylinder"}, "not a simple surface"),
        ({"feature": "plane:head -x"}, "diameter of a cylinder or sphere"),
        ({"feature": "cylinder:nowhere"}, "no region 'nowhere'"),
        (
            {"feature": "cylinder:lateral", "criteria": Criteria(region="head -x")},
            "not on the region",
        ),
        ({"angle": (45.0, 15.0)}, "not a range of triangulation"),
        ({"angle": (0.1, 0.2)}, "No two poses of the sweep"),
        ({"criteria": Criteria(region="nowhere")}, "no region 'nowhere'"),
        ({"criteria": Criteria(robust=2.0)}, "has no scatter of pairs"),
        ({"criteria": Criteria(outside="discard")}, "clip instead of discarding"),
        ({"criteria": Criteria(criterion="displacement")}, "not by the criterion displacement"),
        ({"criteria": Criteria(criterion="features")}, "leave it out, or give normal"),
        (
            {"feature": "cylinder:lateral", "criteria": Criteria(criterion="normal")},
            "leave it out, or give features",
        ),
    ],
)
def test_wrong_requests(dataset: xr.Dataset, chosen: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        of_pairs(dataset, **chosen)


def test_a_sweep_without_offsets_is_refused(dataset: xr.Dataset) -> None:
    with pytest.raises(InputError, match="sighting_offset_x is missing"):
        plan_pairs(dataset.drop_vars("sighting_offset_x"))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--system=stereo"], "for two devices is given without --pairs"),
        (["--angle=15:45"], "for two devices is given without --pairs"),
        (["--feature=cylinder:lateral"], "for two devices is given without --pairs"),
        (["--pairs", "--views=3"], "--views is about single poses"),
        (["--pairs", "--save=p.csv"], "--save is about single poses"),
        (["--pairs", "--refine", "--evaluations=0"], "0 evaluations are too few"),
    ],
)
def test_options_that_belong_together(
    swept: Path, options: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["plan", str(swept), *options]) == 2
    assert said in " ".join(capsys.readouterr().err.split())


@pytest.mark.slow
def test_a_search_never_returns_anything_worse(
    dataset: xr.Dataset, swept: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What it says of a pair is what `measure` says of devices that stand there."""
    seen: list[float] = []
    plan = plan_pairs(dataset, BY_ERROR, Pairing(feature="cylinder:lateral", confirm=False))
    found = refine_pair(dataset, plan, evaluations=10, progress=lambda _, score: seen.append(score))
    assert found.evaluations == len(seen) == 10
    assert (np.diff(seen) <= 0).all()
    assert found.best.score == min(seen) <= found.start.score
    scene = load_scene(folder_of("cylinder_paper") / "scene.xml")
    camera = swept_camera(dataset, 0)
    scan = measure(scene, *(camera.at(matrix) for matrix in found.best.matrices), system="fringe")
    (feature,) = scan.features(scene.part, [FeatureChoice("cylinder", "lateral")])
    error = feature.size.difference("measured", "cold")
    assert found.best.bias_mm == pytest.approx(error, rel=1e-6)
    capsys.readouterr()
    file = tmp_path / "pair.json"
    words = ["--pairs", "--no-confirm", "--refine", "--evaluations=10", "-o", str(file)]
    assert main(["plan", str(swept), *words]) == 0
    assert "Refined second device" in capsys.readouterr().out
    written = json.loads(file.read_text())
    assert written["score"] <= written["start"]["score"]
    assert np.array(written["second"]["matrix"]).shape == (4, 4)


def test_the_best_pair_is_printed(swept: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["plan", str(swept), "--pairs", "--no-confirm", "--top=2"]) == 0
    said = capsys.readouterr().out
    assert "both see" in said
    assert "Second device, pose" in said
    assert 'inside the second sensor (id="projector")' in said


@pytest.mark.usefixtures("variant")
def test_pairs_say_what_bent_their_rays_and_that_scatter_is_left_out(
    dataset: xr.Dataset, capsys: pytest.CaptureFixture[str]
) -> None:
    """Shells may be too coarse for some of the pairs alone; only measurements have scatter."""
    found = plan_pairs(dataset, BY_ERROR, Pairing(confirm=False))
    for engine, said in (
        ("shells", "solver, through the shells."),
        ("cells", "solver, through the field data."),
        ("cells and shells", "of pairs for which these are too coarse through the field data."),
    ):
        plan = evolve(found, exact_mm=np.zeros(3), exact_engine=engine)
        print_pairs(dataset, plan, 1)
        printed = " ".join(capsys.readouterr().out.split())
        assert said in printed
        assert "scatter" not in printed
    print_pairs(dataset.assign(scatter_p95=dataset["displacement_p95"]), found, 1)
    assert "without their scatter" in " ".join(capsys.readouterr().out.split())


def test_the_engines_of_all_measured_pairs_are_stated(
    dataset: xr.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not that of the last pair alone."""
    engines = iter(("shells", "cells", "shells"))

    def measured(*given: Any, **named: Any) -> Scan:
        scan = measure(*given, **named)
        return evolve(scan, provenance={**scan.provenance, "engine": next(engines)})

    monkeypatch.setattr("iriftrace.planning.pairs.measure", measured)
    assert plan_pairs(dataset, BY_ERROR).exact_engine == "cells and shells"
