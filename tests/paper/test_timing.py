"""Studies of times count what they say; how long anything takes is not asked."""

from pathlib import Path

import numpy as np
import pytest

from bench.queries import Recording
from iriftrace.core.errors import InputError
from iriftrace.medium.shells.contour import contour_shells
from validation.inputs.study_inputs import field_and_scene
from validation.paper import times
from validation.paper.figures import timing_figure
from validation.paper.kinds import polygons_study, rays_study
from validation.paper.mode import OURS, PAPERS, Mode, through_shells
from validation.paper.study import Setup, run_study
from validation.paper.times import STAGES


@pytest.fixture(autouse=True)
def _few_repeats(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(times, "REPEATS", 1)


def test_rays_are_counted_and_every_stage_takes_time(variant: str, tmp_path: Path) -> None:
    field, scene = field_and_scene(tmp_path, variant)
    study = rays_study(Setup(scene, {"f": field}, [OURS]), scales=[0.5, 1.0], layers=3)
    found = run_study(study, tmp_path / "rays.nc")
    np.testing.assert_array_equal(found["rays"], [[750, 3000]])
    for stage in STAGES:
        if stage != "refraction":
            assert (found[f"time_{stage}"] > 0).all()
        assert found[f"time_{stage}"].attrs["units"] == "s"
    np.testing.assert_allclose(
        found["time_search"] + found["time_refraction"], found["time_refracted"]
    )
    ratio = found["rays_refracted"] / found["rays"]
    assert float(abs(ratio.isel(launched=0) - ratio.isel(launched=1)).max()) < 0.02
    timing_figure(found)
    noise = "above 100 %: noise, the search is timed in a separate run"
    for share, count in ((0.9, 0), (1.2, 1)):
        found["search_share"][:] = share
        titles = [
            axes.get_title(loc="right")
            for body in timing_figure(found).subfigs
            for axes in body.axes
        ]
        assert titles.count(noise) == count


def test_polygons_grow_by_four(variant: str, tmp_path: Path) -> None:
    field, scene = field_and_scene(tmp_path, variant)
    study = polygons_study(
        Setup(scene, {"f": field}, [OURS, PAPERS]), layers=3, smallest=400, largest=2_000
    )
    found = run_study(study, tmp_path / "polygons.nc")
    triangles = found["triangles"].values
    assert triangles.shape == (2, 2)
    np.testing.assert_array_equal(triangles[:, 1:], 4 * triangles[:, :-1])
    assert found["triangles_per_shell"].values[0, 0] == pytest.approx(400, rel=0.15)
    timing_figure(found)


@pytest.mark.parametrize("mode", [OURS, PAPERS])
def test_replayed_queries_find_what_the_trace_found(
    variant: str, tmp_path: Path, mode: Mode
) -> None:
    """Each recorded query ends where the next one starts, but for the step beyond the crossing."""
    field, scene = field_and_scene(tmp_path, variant)
    seen = through_shells(scene, contour_shells(field, 3), mode)
    recording = Recording(seen.ready, queries=8)
    assert recording.rays > 500
    last = np.array(recording.last)
    assert last.min() >= 1
    import mitsuba as mi

    found = seen.compiled.mitsuba_scene.ray_intersect_preliminary(
        mi.Ray3f(recording.points, recording.directions), coherent=False
    )
    distance = np.array(found.t).reshape(8, -1)
    points = np.stack([np.array(axis) for axis in recording.points]).reshape(3, 8, -1)
    ahead = np.stack([np.array(axis) for axis in recording.directions]).reshape(3, 8, -1)
    inner = np.arange(7)[:, None] < last - 1
    gap = (points + ahead * distance)[:, :-1] - points[:, 1:]
    assert inner.any()
    assert np.abs(gap[:, inner]).max() < 1e-3
    assert len(recording.time_pairs(1)) == 1


def test_ranges_are_checked(variant: str, tmp_path: Path) -> None:
    field, scene = field_and_scene(tmp_path, variant)
    with pytest.raises(InputError, match="not a range"):
        polygons_study(Setup(scene, {"f": field}, [OURS]), smallest=5000, largest=400)
    with pytest.raises(InputError, match="each different"):
        rays_study(Setup(scene, {"f": field}, [OURS]), scales=[1.0, 1.0])
    with pytest.raises(InputError, match="scale"):
        rays_study(Setup(scene, {"f": field}, [OURS]), scales=[0.0])
