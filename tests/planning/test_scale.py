"""Faces that poses see, alone, together and in common, at several scales of their pictures."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from iriftrace.camera.orbit import Orbit, orbit_poses
from iriftrace.planning.cover import plan_views
from iriftrace.planning.criteria import Criteria, Pairing, Views
from iriftrace.planning.pairs import plan_pairs
from iriftrace.planning.rank import rank_poses
from iriftrace.scenes import folder_of
from iriftrace.sweep.sweep import run_sweep
from iriftrace.tracing.load import load_scene

pytestmark = [
    pytest.mark.filterwarnings("ignore:.*every second shell"),
    pytest.mark.filterwarnings("ignore:The ranked poses"),
]
SCALES = (0.1, 0.35)


@pytest.fixture(
    scope="module",
    params=["cylinder", "bevel_gear"],
)
def sweeps(
    variant: str, request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> list[xr.Dataset]:
    """The same five poses, of which one looks at the level cylinder's side."""
    folder: Path = tmp_path_factory.mktemp(request.param)
    found = []
    for scale in SCALES:
        xml = folder_of(request.param) / "scene.xml"
        scene = load_scene(xml, {"scale": scale}, variant=variant, engine="shells")
        away = float(np.linalg.norm(scene.camera.origin - scene.part.centre))
        orbit = Orbit(centre=scene.part.centre, semi_axes_mm=(away, away, away))
        poses = orbit_poses(orbit, (30.0, 60.0, 90.0, 120.0, 250.0), 10.0)
        found.append(run_sweep(scene, poses, folder / f"{scale}.nc"))
    return found


@pytest.mark.slow
def test_what_each_pose_sees(sweeps: list[xr.Dataset]) -> None:
    """The area is equal within 2 %; the faces hit are not, least of all on the gear."""
    low, high = (table.sel(region="part") for table in sweeps)
    np.testing.assert_allclose(low["coverage_area"], high["coverage_area"], rtol=0.02)
    assert np.abs(low["coverage"] / high["coverage"] - 1).max() > 0.03
    for table in sweeps:
        seen = rank_poses(table).metrics["coverage"]
        np.testing.assert_array_equal(seen, table["coverage_area"].sel(region="part"))


def test_what_poses_see_together(sweeps: list[xr.Dataset]) -> None:
    low, high = (plan_views(table, Views(3)) for table in sweeps)
    assert low.covered == pytest.approx(high.covered, rel=0.02)
    assert low.coverable == pytest.approx(high.coverable, rel=0.02)
    for table, found in zip(sweeps, (low, high), strict=True):
        alone = table["coverage_area"].sel(region="part").values
        assert found.added[0] == pytest.approx(alone[found.poses[0]], rel=0.01)


def test_what_pairs_see_in_common(sweeps: list[xr.Dataset]) -> None:
    criteria = Criteria(min_hits=10)
    seen = []
    for table in sweeps:
        found = plan_pairs(table, criteria, Pairing(confirm=False, angle=(15.0, 80.0)))
        seen.append(dict(zip(map(tuple, found.pairs.tolist()), found.coverage, strict=True)))
    assert seen[0].keys() == seen[1].keys()
    for pair, area in seen[0].items():
        assert area == pytest.approx(seen[1][pair], rel=0.02, abs=1e-3)
