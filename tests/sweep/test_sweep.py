"""A sweep is its poses rendered one by one, whatever interrupts it."""

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import pyvista as pv
import xarray as xr
from attrs import evolve

from iriftrace.camera.orbit import Orbit, orbit_poses
from iriftrace.camera.pose_set import PoseSet
from iriftrace.core import files
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.image.sightings import sightings_of
from iriftrace.scenes import folder_of
from iriftrace.sweep.diagnostics import varied_of
from iriftrace.sweep.export import write_face_maps, write_table
from iriftrace.sweep.measures import MEASURES
from iriftrace.sweep.series import Series, series_variables
from iriftrace.sweep.store import origin_of, read_sweep, scene_of_pose
from iriftrace.sweep.sweep import SweepOptions, run_series, run_sweep
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.render import render_scene
from iriftrace.tracing.scene import Scene
from validation.inputs.journals import pieces_done

# The pose from above is traced through the field, of which the sweep tells.
pytestmark = pytest.mark.filterwarnings("ignore:.*every second shell")


@pytest.fixture(scope="module")
def poses(orbit: Orbit) -> PoseSet:
    return orbit_poses(orbit, np.array((0.0, 45.0, 90.0)), np.array((-40.0, 0.0, 90.0)))


@pytest.fixture(scope="module")
def swept(
    scene: Scene, poses: PoseSet, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, xr.Dataset]:
    path = tmp_path_factory.mktemp("sweep") / "sweep.nc"
    return path, run_sweep(scene, poses, path)


def same_results(one: xr.Dataset, other: xr.Dataset) -> bool:
    """Bit for bit, times apart."""
    times = [name for name in one.data_vars if str(name).startswith("time_")]
    return bool(one.drop_vars(times).identical(other.drop_vars(times)))


@pytest.mark.slow
def test_each_pose_holds_the_metrics_of_its_own_rendering(
    scene: Scene, poses: PoseSet, swept: tuple[Path, xr.Dataset]
) -> None:
    dataset = swept[1]
    assert dataset.sizes["pose"] == len(poses) == 7
    for number, matrix in enumerate(poses.matrices):
        rendering = render_scene(scene, camera=scene.camera.at(matrix), empty=True)
        metrics = rendering.metrics.as_dict()
        for name, measure in MEASURES.items():
            expected = metrics
            for key in measure.keys:
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
    assert not list(path.parent.glob("*partial*"))


def test_poses_are_selected_by_where_they_are(swept: tuple[Path, xr.Dataset]) -> None:
    """As plain xarray does it with the file: by number, condition, angle and pair of angles."""
    plain = xr.open_dataset(swept[0], engine="h5netcdf").load()
    assert plain.attrs["Conventions"] == "CF-1.11"
    origins = np.column_stack([plain.coords[f"origin_{axis}"] for axis in "xyz"])
    np.testing.assert_array_equal(origins, plain["matrix"].values[:, :3, 3])
    moved = plain["displacement_median"].sel(region="part")
    for name in ("distance", "focal_length", "stand_off", "scene"):
        assert name in moved.coords
    angles = zip(plain["azimuth"].values, plain["elevation"].values, strict=True)
    number = list(angles).index((45.0, 0.0))
    expected = float(moved[number])
    assert float(moved.sel(pose=number)) == expected
    by_azimuth = moved.set_xindex("azimuth").sel(azimuth=45.0)
    assert sorted(by_azimuth["elevation"].values) == [-40.0, 0.0]
    by_both = moved.drop_vars("pose").set_xindex(["azimuth", "elevation"])
    assert float(by_both.sel(azimuth=45.0, elevation=0.0).squeeze()) == expected
    level = moved.where(moved["elevation"] == 0.0, drop=True)
    assert sorted(level["azimuth"].values) == [0.0, 45.0, 90.0]


def test_head_on_view_covers_the_head(swept: tuple[Path, xr.Dataset]) -> None:
    """Along the axis a cylinder shows one head: 3.68 % of its area exactly, 3.67 % of the mesh."""
    dataset = swept[1]
    head_on = (dataset["azimuth"] == 0) & (dataset["elevation"] == 0)
    whole = dataset.sel(region="part").isel(pose=np.flatnonzero(head_on.values))
    # By footprint: at a tenth of the resolution some small faces are hit by no ray.
    assert float(whole["coverage_area"][0]) == pytest.approx(0.0367, abs=0.0003)
    assert float(whole["axial_resolution"][0]) < 1e-4


def test_interrupted_sweep_goes_on_and_ends_the_same(
    scene: Scene, poses: PoseSet, swept: tuple[Path, xr.Dataset], tmp_path: Path
) -> None:
    path = tmp_path / "sweep.nc"
    rendered: list[int] = []

    def stop_after_three(done: int, total: int) -> None:
        rendered.append(done)
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_sweep(scene, poses, path, progress=stop_after_three)
    assert not path.exists()
    journal = tmp_path / "sweep.nc.partial"
    assert pieces_done(journal) == 3
    rendered.clear()
    dataset = run_sweep(scene, poses, path, progress=lambda done, total: rendered.append(done))
    assert rendered[0] == 3
    assert same_results(dataset, swept[1])
    assert not journal.exists()


def test_a_full_disk_costs_no_pose(
    scene: Scene, poses: PoseSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All poses are done, but the result does not fit; when it does, none is rendered again."""
    path = tmp_path / "sweep.nc"
    usage = shutil.disk_usage(tmp_path)
    with monkeypatch.context() as full:
        full.setattr(shutil, "disk_usage", lambda folder: usage._replace(free=1000))
        with pytest.raises(InputError, match="make room and give the same command again"):
            run_sweep(scene, poses.take([0, 2]), path)
    assert not path.exists()
    rendered: list[int] = []
    run_sweep(
        scene,
        poses.take([0, 2]),
        path,
        progress=lambda done, total: rendered.append(done),
    )
    assert rendered == [2]
    assert path.is_file()


def test_other_sweep_is_not_overwritten(
    scene: Scene, poses: PoseSet, swept: tuple[Path, xr.Dataset]
) -> None:
    path, _ = swept
    before = path.read_bytes()
    with pytest.raises(InputError, match="other poses"):
        run_sweep(scene, poses.take([0, 1]), path)
    assert path.read_bytes() == before
    with pytest.raises(InputError, match="other options"):
        run_sweep(scene, poses, path, options=SweepOptions(include=(0, 5)))


def test_failed_and_empty_poses_do_not_stop_the_rest(
    scene: Scene, poses: PoseSet, tmp_path: Path
) -> None:
    """One camera in the part, one that looks away, one that sees it."""
    matrices = np.array(poses.matrices[:3])
    matrices[0, :3, 3] = (0.0, 0.0, 0.0)
    matrices[1, :3, :3] = matrices[1, :3, :3] @ np.diag((-1.0, 1.0, -1.0))
    odd = PoseSet(matrices=matrices)
    with pytest.warns(IriftraceWarning, match="2 of 3 poses see fewer than 100 good rays"):
        dataset = run_sweep(scene, odd, tmp_path / "odd.nc")
    assert "inside the part" in str(dataset["failure"][0].values)
    whole = dataset.sel(region="part")
    assert whole["rays_good"].values.tolist()[:2] == [-1, 0]
    assert np.isnan(whole["displacement_mean"].values[:2]).all()
    assert whole["rays_good"].values[2] > 100


def test_a_part_far_away_is_said_to_be_small(scene: Scene, poses: PoseSet, tmp_path: Path) -> None:
    """It is hit, in the picture, and in focus."""
    matrices = np.array(poses.matrices[:1])
    matrices[0, :3, 3] *= 20.0
    camera = evolve(scene.camera, focus_mm=(50.0, np.inf))
    far = Series(scene, camera, PoseSet(matrices=matrices))
    with pytest.warns(IriftraceWarning, match="the part covers fewer than 100 pixels"):
        dataset = run_series([far], tmp_path / "far.nc")
    assert 0 < int(dataset["rays_good"].sel(region="part")[0]) < 100


def test_images_are_kept_on_request(scene: Scene, poses: PoseSet, tmp_path: Path) -> None:
    dataset = run_sweep(scene, poses.take([2]), tmp_path / "one.nc", options=SweepOptions(exr=True))
    assert (tmp_path / str(dataset["exr"].values[0])).is_file()


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_table_has_a_row_for_each_pose(
    swept: tuple[Path, xr.Dataset], tmp_path: Path, suffix: str
) -> None:
    path, dataset = tmp_path / f"sweep{suffix}", swept[1]
    write_table(path, dataset)
    table = pd.read_csv(path, index_col="pose") if suffix == ".csv" else pd.read_parquet(path)
    assert table.index.tolist() == list(range(dataset.sizes["pose"]))
    assert table.columns[0] == "displacement_mean"
    # A pose that was traced through the field data has no triangles in view.
    triangles = dataset["triangles_in_view"].values
    assert (triangles < 0).any()
    assert table["triangles_in_view"].isna().tolist() == (triangles < 0).tolist()
    for name in ("displacement_median", "elevation", "rays_good", "sightings", "focal_length"):
        variable = dataset[name]
        whole = variable.sel(region="part") if "region" in variable.dims else variable
        assert table[name].to_numpy().tolist() == whole.values.tolist()


@pytest.fixture(scope="module")
def other_scene(scene: Scene, variant: str, tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """The same part in other air: refracted at facets."""
    folder = tmp_path_factory.mktemp("other") / "scene"
    shutil.copytree(folder_of("cylinder"), folder)
    values = {"scale": 0.1, "normals": "facet"}
    return load_scene(folder / "scene.xml", values, variant=variant)


@pytest.mark.slow
def test_scenes_focal_lengths_and_distances_in_one_sweep(
    scene: Scene, other_scene: Scene, poses: PoseSet, tmp_path: Path
) -> None:
    """Each pose is what a sweep of its own gives."""
    wide = evolve(other_scene.camera, focal_length_mm=8.0)
    series = [
        Series(scene, scene.camera, poses.take([1, 2]), 225.0),
        Series(other_scene, wide, poses.take([4])),
    ]
    dataset = run_series(series, tmp_path / "all.nc")
    assert dataset["focal_length"].values.tolist() == [10, 10, 8]
    np.testing.assert_array_equal(dataset["stand_off"].values, (225, 225, np.nan))
    names = [str(scene.path)] * 2 + [str(other_scene.path)]
    assert dataset["scene"].values.tolist() == names
    listed = json.loads(dataset.attrs["scenes"])
    assert [entry["variables"].get("normals") for entry in listed] == [None, "facet"]
    first = 0
    for number, single in enumerate(series):
        alone = run_series([single], tmp_path / f"{number}.nc")
        last = first + len(single.poses)
        # Alone, its poses are counted from 0.
        mine = dataset.isel(pose=slice(first, last)).assign_coords(pose=alone["pose"])
        per_pose = [n for n, v in alone.data_vars.items() if v.dims[0] == "pose"]
        assert same_results(
            mine[per_pose].drop_attrs(deep=False), alone[per_pose].drop_attrs(deep=False)
        )
        for pose in range(first, last):
            got, expected = sightings_of(dataset, pose), sightings_of(alone, pose - first)
            assert np.array_equal(got.as_rows(), expected.as_rows())
        first = last


def test_scenes_of_one_name_stay_several(
    scene: Scene, poses: PoseSet, variant: str, tmp_path: Path
) -> None:
    """One file with two values of a parameter; and scenes in memory, all called "the scene"."""
    flat = load_scene(scene.path, {"scale": 0.1, "normals": "facet"}, variant=variant)
    dataset = run_sweep([scene, flat], poses.take([1]), tmp_path / "s.nc")
    assert dataset["scene"].values.tolist() == [str(scene.path), f"{scene.path} 2"]
    listed = [scene_of_pose(dataset, pose)["variables"].get("normals") for pose in (0, 1)]
    assert listed == [None, "facet"]
    one, other = (evolve(each, origin=None) for each in (scene, flat))
    series = [Series(each, each.camera, poses.take([1])) for each in (one, other, one)]
    names = series_variables(series)["scene"][1]
    assert names.tolist() == ["the scene", "the scene 2", "the scene"]
    (varied,) = varied_of(dataset.assign(scene=("pose", names[:2])))
    assert varied.values == ("the scene", "the scene 2")


def test_scenes_that_cannot_be_compared_are_refused(
    scene: Scene, other_scene: Scene, poses: PoseSet, tmp_path: Path
) -> None:
    mine = Series(scene, scene.camera, poses)
    coarse = Series(other_scene, other_scene.camera.scaled(0.5), poses)
    with pytest.raises(InputError, match="differ in more than pose and focal length"):
        run_series([mine, coarse], tmp_path / "a.nc")
    part = evolve(other_scene.part, sha256="0" * 64)
    foreign = evolve(other_scene, part=part)
    with pytest.raises(InputError, match="different parts"):
        run_series([mine, Series(foreign, foreign.camera, poses)], tmp_path / "a.nc")
    origin = evolve(other_scene._origin, part_to_world=2 * np.eye(4))
    moved = evolve(other_scene, origin=origin)
    with pytest.raises(InputError, match="place them differently"):
        run_series([mine, Series(moved, moved.camera, poses)], tmp_path / "a.nc")
    assert not list(tmp_path.iterdir())


def test_changed_mesh_makes_another_sweep(
    other_scene: Scene, poses: PoseSet, tmp_path: Path
) -> None:
    """The XML is the same, but a resumed sweep would mix poses of two fields."""

    def stop(done: int, total: int) -> None:
        if done == 1:
            raise KeyboardInterrupt

    path = tmp_path / "a.nc"
    with pytest.raises(KeyboardInterrupt):
        run_sweep(other_scene, poses.take([1, 2]), path, progress=stop)
    mesh = other_scene.path.parent / "shells" / "shell_03.ply"
    mesh.write_bytes(mesh.read_bytes() + b"\0")
    with pytest.raises(InputError, match="belongs to a sweep of other"):
        run_sweep(other_scene, poses.take([1, 2]), path)


def test_surface_carries_the_maps(
    scene: Scene, swept: tuple[Path, xr.Dataset], tmp_path: Path
) -> None:
    """What ParaView shows of a face is what the file says of it, in the order of the part."""
    dataset = swept[1]
    for name in ("part.vtp", "part.vtu"):
        write_face_maps(tmp_path / name, dataset, scene.part)
        surface = pv.read(tmp_path / name)
        centres = scene.part.vertices[scene.part.faces].mean(axis=1)
        assert np.allclose(surface.cell_centers().points, centres, atol=1e-4)
        data = surface.cell_data
        assert np.array_equal(data["times seen"], dataset["face_times_seen"])
        never = data["times seen"] == 0
        assert 0 < never.sum() < len(never)
        assert np.array_equal(np.isnan(data["displacement (um)"]), never)
        expected = 1e3 * dataset["face_displacement"].values
        assert np.allclose(data["displacement (um)"], expected, rtol=1e-6, equal_nan=True)
        assert np.array_equal(
            data["best incidence (deg)"], dataset["face_incidence"], equal_nan=True
        )


def test_a_sweep_that_is_not_finished_is_no_missing_one(tmp_path: Path) -> None:
    (tmp_path / "half.nc.partial").touch()
    with pytest.raises(
        InputError, match=r"half\.nc is not finished, its finished poses are in .*partial"
    ):
        read_sweep(tmp_path / "half.nc")


def test_only_a_report_needs_the_checksum_of_a_sweep(
    swept: tuple[Path, xr.Dataset], monkeypatch: pytest.MonkeyPatch
) -> None:
    path, _ = swept
    with monkeypatch.context() as changed:
        changed.setattr(files, "sha256_of", None)
        dataset = read_sweep(path)
    assert origin_of(dataset) == files.FileOrigin(str(path), files.sha256_of(path))
    assert origin_of(xr.Dataset()) is None


def test_a_damaged_file_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """HDF5 finds wrong checksums in the middle of a file only when it gets there."""
    path = tmp_path / "damaged.nc"
    xr.Dataset({"a": ("x", [1.0])}).to_netcdf(path, engine="h5netcdf")

    def fail(*_: object, **__: object) -> None:
        raise RuntimeError("incorrect metadata checksum after all read attempts")

    monkeypatch.setattr(xr, "open_dataset", fail)
    with pytest.raises(InputError, match=r"damaged\.nc cannot be read .*checksum"):
        read_sweep(path)


def test_netcdf_of_another_program_is_refused(tmp_path: Path) -> None:
    xr.Dataset({"a": ("x", [1.0])}).to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
    with pytest.raises(InputError, match="run the sweep again"):
        read_sweep(tmp_path / "other.nc")
