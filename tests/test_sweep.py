"""A sweep is its poses rendered one by one, whatever interrupts it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from iriftrace.errors import InputError, IriftraceWarning
from iriftrace.orbit import Orbit, orbit_poses
from iriftrace.pose_set import PoseSet
from iriftrace.render import render_scene
from iriftrace.scene import LoadedScene, load_scene
from iriftrace.scenes import folder_of
from iriftrace.sweep import SweepOptions, run_sweep
from iriftrace.sweep_store import MEASURES, read_sweep, write_table


@pytest.fixture(scope="module")
def scene(variant: str) -> LoadedScene:
    return load_scene(folder_of("cylinder") / "scene.xml", {"scale": 0.1}, variant=variant)


@pytest.fixture(scope="module")
def poses(scene: LoadedScene) -> PoseSet:
    orbit = Orbit(centre=scene.part.centre, semi_axes_mm=(310.0, 238.5, 238.5))
    return orbit_poses(orbit, np.array((0.0, 45.0, 90.0)), np.array((-40.0, 0.0, 90.0)))


@pytest.fixture(scope="module")
def swept(
    scene: LoadedScene, poses: PoseSet, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, xr.Dataset]:
    path = tmp_path_factory.mktemp("sweep") / "sweep.nc"
    return path, run_sweep(scene, poses, scene.camera, path)


def same_results(one: xr.Dataset, other: xr.Dataset) -> bool:
    """Bit for bit, times apart."""
    times = [name for name in one.data_vars if str(name).startswith("time_")]
    return bool(one.drop_vars(times).identical(other.drop_vars(times)))


def test_each_pose_holds_the_metrics_of_its_own_rendering(
    scene: LoadedScene, poses: PoseSet, swept: tuple[Path, xr.Dataset]
) -> None:
    dataset = swept[1]
    assert dataset.sizes["pose"] == len(poses) == 7
    for number, matrix in enumerate(poses.matrices):
        metrics = render_scene(
            scene, camera=scene.camera.at(matrix), nearest=False, empty=True
        ).metrics
        for name, (keys, _, _) in MEASURES.items():
            expected = metrics
            for key in keys:
                expected = expected[key]
            found = float(dataset[name].sel(region="part")[number])
            assert (np.isnan(found) and expected is None) or found == expected
        lateral = metrics["regions"]["lateral"]
        assert int(dataset["rays_good"].sel(region="lateral")[number]) == lateral["rays"]["good"]


def test_file_says_what_it_holds_and_reads_back(swept: tuple[Path, xr.Dataset]) -> None:
    path, dataset = swept
    plain = xr.open_dataset(path, engine="h5netcdf").load()
    assert plain["displacement_median"].attrs["units"] == "mm"
    assert list(plain["region"].values) == ["part", "lateral", "head -x", "head +x"]
    assert json.loads(plain.attrs["camera"])["focal_length_mm"] == 10
    assert json.loads(plain.attrs["assumptions"])["optics"].startswith("geometric")
    assert read_sweep(path).identical(dataset.astype(dataset.dtypes))
    assert not list(path.parent.glob("*journal*"))


def test_head_on_view_covers_the_head(swept: tuple[Path, xr.Dataset]) -> None:
    """Along the axis a cylinder shows one head: 3.68 % of its area exactly, 3.67 % of the mesh."""
    dataset = swept[1]
    head_on = (dataset["azimuth"] == 0) & (dataset["elevation"] == 0)
    whole = dataset.sel(region="part").isel(pose=np.flatnonzero(head_on.values))
    # By footprint: at a tenth of the resolution some small faces are hit by no ray.
    assert float(whole["coverage_area"][0]) == pytest.approx(0.0367, abs=0.0003)
    assert float(whole["axial_resolution"][0]) < 1e-4


def test_interrupted_sweep_goes_on_and_ends_the_same(
    scene: LoadedScene, poses: PoseSet, swept: tuple[Path, xr.Dataset], tmp_path: Path
) -> None:
    path = tmp_path / "sweep.nc"
    rendered: list[int] = []

    def stop_after_three(done: int, total: int) -> None:
        rendered.append(done)
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_sweep(scene, poses, scene.camera, path, progress=stop_after_three)
    assert not path.exists()
    journal = tmp_path / "sweep.nc.journal"
    # What a kill in the middle of a write leaves behind.
    journal.write_bytes(journal.read_bytes() + b'{"pose": 3, "metr')
    rendered.clear()
    dataset = run_sweep(
        scene, poses, scene.camera, path, progress=lambda done, total: rendered.append(done)
    )
    assert rendered[0] == 3
    assert same_results(dataset, swept[1])


def test_finished_sweep_is_not_repeated(
    scene: LoadedScene, poses: PoseSet, swept: tuple[Path, xr.Dataset]
) -> None:
    path, dataset = swept

    def never(done: int, total: int) -> None:
        raise AssertionError

    assert run_sweep(scene, poses, scene.camera, path, progress=never).identical(read_sweep(path))
    assert same_results(read_sweep(path), dataset)


def test_other_sweep_is_not_overwritten(
    scene: LoadedScene, poses: PoseSet, swept: tuple[Path, xr.Dataset], tmp_path: Path
) -> None:
    path, _ = swept
    before = path.read_bytes()
    with pytest.raises(InputError, match="other poses"):
        run_sweep(scene, poses.take([0, 1]), scene.camera, path)
    assert path.read_bytes() == before
    with pytest.raises(KeyboardInterrupt):
        run_sweep(scene, poses, scene.camera, tmp_path / "a.nc", progress=_stop_after_one)
    with pytest.raises(InputError, match="belongs to a sweep of other"):
        run_sweep(scene, poses, scene.camera, tmp_path / "a.nc", options=SweepOptions(nearest=True))


def _stop_after_one(done: int, total: int) -> None:
    if done == 1:
        raise KeyboardInterrupt


def test_failed_and_empty_poses_do_not_stop_the_rest(
    scene: LoadedScene, poses: PoseSet, tmp_path: Path
) -> None:
    """One camera in the part, one that looks away, one that sees it."""
    matrices = np.array(poses.matrices[:3])
    matrices[0, :3, 3] = (0.0, 0.0, 0.0)
    matrices[1, :3, :3] = matrices[1, :3, :3] @ np.diag((-1.0, 1.0, -1.0))
    odd = PoseSet(matrices=matrices)
    with pytest.warns(IriftraceWarning, match="2 of 3 poses see fewer than 100 good rays"):
        dataset = run_sweep(scene, odd, scene.camera, tmp_path / "odd.nc")
    assert "inside the part" in str(dataset["failure"][0].values)
    whole = dataset.sel(region="part")
    assert whole["rays_good"].values.tolist()[:2] == [-1, 0]
    assert np.isnan(whole["displacement_mean"].values[:2]).all()
    assert whole["rays_good"].values[2] > 100


def test_images_are_kept_on_request(scene: LoadedScene, poses: PoseSet, tmp_path: Path) -> None:
    dataset = run_sweep(
        scene, poses.take([2]), scene.camera, tmp_path / "one.nc", options=SweepOptions(exr=True)
    )
    assert (tmp_path / str(dataset["exr"].values[0])).is_file()


def test_table_has_a_row_for_each_pose(swept: tuple[Path, xr.Dataset], tmp_path: Path) -> None:
    write_table(tmp_path / "sweep.csv", swept[1])
    lines = (tmp_path / "sweep.csv").read_text().splitlines()
    assert len(lines) == 1 + swept[1].sizes["pose"]
    assert lines[0].startswith("pose,displacement_mean")


@pytest.mark.parametrize("content", [b"", b"not netCDF"])
def test_file_of_another_kind_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "odd.nc"
    path.write_bytes(content)
    with pytest.raises(InputError, match="no netCDF"):
        read_sweep(path)


def test_netcdf_of_another_program_is_refused(tmp_path: Path) -> None:
    xr.Dataset({"a": ("x", [1.0])}).to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
    with pytest.raises(InputError, match="no sweep of this version"):
        read_sweep(tmp_path / "other.nc")
