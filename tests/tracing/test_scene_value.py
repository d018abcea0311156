"""A scene of objects in memory: the numbers of its files to the last bit, and no file.

Expected values are those of the same scene written and loaded again.
"""

import os
import shutil
import sys
from pathlib import Path

import attrs
import numpy as np
import pytest
import pyvista as pv

import iriftrace
from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.scenes import folder_of
from scenes.generators.bevel_gear import bevel_gear
from validation.inputs import hot_block

pytestmark = [
    pytest.mark.usefixtures("variant"),
    pytest.mark.filterwarnings("ignore:Hits of"),
    pytest.mark.filterwarnings("ignore:.*rays fall on each visible face"),
]


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> iriftrace.Scene:
    """A hot block between two cameras, from files that are then gone."""
    folder = tmp_path_factory.mktemp("user")
    air, block = hot_block.save(folder)
    part, field = iriftrace.read_part(block), iriftrace.read_field(air)
    for file in folder.iterdir():
        file.unlink()
    camera = iriftrace.Camera(
        focal_length_mm=20.0,
        sensor_mm=(6.0, 5.0),
        resolution=(121, 100),
        focus_mm=(50.0, 250.0),
        matrix=iriftrace.look_at(origin=(60.1, -45.3, 70.7), target=(0.2, 0.1, 0.0)),
    )
    second = camera.at(iriftrace.look_at(origin=(70.3, -15.2, 75.9), target=(0.0, 0.3, 0.1)))
    return iriftrace.Scene(part, iriftrace.HotAir(field, layers=9), camera, second, "camera_2")


@pytest.mark.parametrize(("engine", "wavelength"), [("shells", None), ("cells", 450.0)])
def test_same_numbers_as_from_files(
    scene: iriftrace.Scene, tmp_path: Path, engine: str, wavelength: float | None
) -> None:
    path = scene.save(tmp_path / "scene.xml", scale=1.0)
    values = {} if wavelength is None else {"wavelength": wavelength}
    of_files = iriftrace.load_scene(path, values, engine=engine)
    in_memory = attrs.evolve(scene, engine=engine, wavelength_nm=wavelength)

    one, other = iriftrace.render_scene(of_files), iriftrace.render_scene(in_memory)
    assert one.metrics.rays.good > 1000
    for name, values_of_it in one.image.channels.items():
        np.testing.assert_array_equal(other.image.channels[name], values_of_it, err_msg=name)
    assert one.metrics.as_dict()["displacement_mm"] == other.metrics.as_dict()["displacement_mm"]
    assert one.metrics.as_dict()["regions"] == other.metrics.as_dict()["regions"]

    scan, same = iriftrace.measure(of_files), iriftrace.measure(in_memory)
    np.testing.assert_array_equal(scan.points, same.points)
    fixed, alike = (iriftrace.correct(scan.points, one) for one in (of_files, in_memory))
    np.testing.assert_array_equal(fixed.points, alike.points)


@pytest.mark.parametrize("of_files", [False, True])
def test_nothing_is_written_or_read(
    scene: iriftrace.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, of_files: bool
) -> None:
    """From a scene in memory or loaded to its rays and back, no file is opened."""
    moved = attrs.evolve(scene, air=iriftrace.HotAir(scene.air.states[0].field, layers=6))
    if of_files:
        saved = moved.save(tmp_path / "scene" / "scene.xml", scale=1.0)
        moved = iriftrace.load_scene(saved, engine="shells")
        shutil.rmtree(tmp_path / "scene")
    opened: list[str] = []
    watching = True

    def watch(event: str, arguments: tuple[object, ...]) -> None:
        if watching and event == "open" and isinstance(arguments[0], str | Path):
            opened.append(str(arguments[0]))

    monkeypatch.chdir(tmp_path)
    tmp_path.chmod(0o500)
    sys.addaudithook(watch)
    rendering = iriftrace.render_scene(moved)
    watching = False
    tmp_path.chmod(0o700)
    assert rendering.metrics.rays.good > 1000
    # Python's own modules and the machine's limits may be read.
    theirs = (
        sys.prefix,
        sys.base_prefix,
        str(Path(iriftrace.__file__).parents[1]),
        "/sys",
        "/proc",
    )
    assert [path for path in opened if not path.startswith(theirs)] == []
    assert list(tmp_path.iterdir()) == []


def test_ensemble_of_fields(scene: iriftrace.Scene, tmp_path: Path) -> None:
    field = scene.air.states[0].field
    assert field is not None
    weaker = attrs.evolve(
        field,
        refractivity=field.ambient_refractivity
        + 0.9 * (field.refractivity - field.ambient_refractivity),
    )
    ensemble = attrs.evolve(
        scene,
        air=iriftrace.HotAir(
            [field, weaker], layers=9, labels=["as it is", "weaker"], weights=(3, 1)
        ),
    )
    in_memory = iriftrace.render_scene(ensemble)
    saved = ensemble.save(tmp_path / "scene.xml", scale=1.0)
    written = iriftrace.render_scene(iriftrace.load_scene(saved))
    assert in_memory.metrics.ensemble is not None
    assert [m["weight"] for m in written.image.header["ensemble"]["members"]] == [0.75, 0.25]
    for name, values in written.image.channels.items():
        np.testing.assert_array_equal(in_memory.image.channels[name], values, err_msg=name)


def test_members_have_the_names_of_their_files(scene: iriftrace.Scene) -> None:
    """Without folders, unless two files have the same name."""
    field = scene.air.states[0].field
    assert field is not None

    def labels(*paths: str) -> list[str]:
        fields = [attrs.evolve(field, source=attrs.evolve(field.source, path=p)) for p in paths]
        return [state.label for state in iriftrace.HotAir(fields).states]

    assert labels("hall/still.vtu", "hall/draught.vtu") == ["still.vtu", "draught.vtu"]
    assert labels("day 1/air.vtu", "day 2/air.vtu") == ["day 1/air.vtu", "day 2/air.vtu"]


def test_shells_alone_have_no_cells(scene: iriftrace.Scene) -> None:
    shells = scene.air.states[0].shells
    alone = attrs.evolve(scene, air=iriftrace.HotAir(shells=shells))
    assert iriftrace.render_scene(alone).metrics.rays.good > 1000
    with pytest.raises(InputError, match="no field, so there are no cells"):
        iriftrace.render_scene(attrs.evolve(alone, engine="cells"))


def test_what_cannot_be_a_scene_is_refused(scene: iriftrace.Scene, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="needs air"):
        iriftrace.HotAir()
    with pytest.raises(InputError, match=r'give iriftrace\.read_field\("air\.vtu"\)'):
        iriftrace.HotAir("air.vtu")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"'part\.stl' is no Part; give .*read_part"):
        attrs.evolve(scene, part="part.stl")
    field, shells = scene.air.states[0].field, scene.air.states[0].shells
    with pytest.raises(InputError, match="Ready-made shells belong to one field"):
        iriftrace.HotAir([field, field], shells=shells)
    with pytest.raises(InputError, match="1 labels for 2 fields"):
        iriftrace.HotAir([field, field], labels=["one"])
    with pytest.raises(InputError, match="3 weights for 2 fields"):
        iriftrace.HotAir([field, field], weights=(1, 1, 1))
    with pytest.raises(InputError, match="no engine 'fast'"):
        attrs.evolve(scene, engine="fast")
    inside = scene.camera.at(iriftrace.look_at((0.0, 0.0, 0.1), (10.0, 0.0, 0.0)))
    with pytest.raises(InputError, match="stands in the part"):
        iriftrace.render_scene(attrs.evolve(scene, camera=inside))
    poses = iriftrace.PoseSet(scene.camera.matrix[None], np.zeros(1), np.zeros(1))
    with pytest.raises(InputError, match="write the scene first"):
        iriftrace.run_sweep(scene, poses, tmp_path / "sweep.nc")


def gear_under_its_plume() -> iriftrace.Scene:
    part = bevel_gear(teeth=8, module_mm=7.0)
    mesh = iriftrace.AirMesh(cell_mm=6.0, sides_mm=30.0, height_mm=60.0)
    air = iriftrace.HotAir(
        iriftrace.synthetic_field(iriftrace.synthetic_air(part), mesh), layers=21
    )
    camera = iriftrace.load_scene(folder_of("cylinder") / "scene.xml", {"scale": 0.03}).camera
    camera = attrs.evolve(camera, focus_mm=(20.0, 600.0))
    camera, second = (camera.at(iriftrace.look_at((1, y, 220), (0, 0, 0))) for y in (2.0, 42.0))
    return iriftrace.Scene(part, air, camera, second, "camera_2")


# The mesh is too coarse for a gear, which is said and does not matter here.
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*off the field's wall")
@pytest.mark.parametrize(("of_gear", "engine"), [(False, "shells"), (True, "cells")])
def test_commands_and_python_give_the_same_numbers(
    tmp_path: Path, scene: iriftrace.Scene, of_gear: bool, engine: str
) -> None:
    """Picture, points, correction and sweep, whichever engine is chosen."""
    fine = iriftrace.HotAir(scene.air.states[0].field, layers=25)
    scene = gear_under_its_plume() if of_gear else attrs.evolve(scene, air=fine)
    path, place = scene.save(tmp_path / "scene.xml", scale=1.0), scene.camera.origin

    def command(*words: str | os.PathLike[str]) -> None:
        assert main([os.fspath(word) for word in words]) == 0

    command("render", path, "-o", tmp_path / "one.exr", "--no-figures")
    picture = iriftrace.render_scene(scene).image
    written = iriftrace.read_exr(tmp_path / "one.exr")
    assert written.header["engine"] == picture.header["engine"] == engine
    for name, values in written.channels.items():
        np.testing.assert_array_equal(picture.channels[name], values, err_msg=name)

    command("measure", path, "-o", tmp_path / "scan.vtp", "--no-figures")
    scan = iriftrace.measure(scene)
    cloud = pv.read(tmp_path / "scan.vtp")
    np.testing.assert_array_equal(cloud.points, scan.points)

    np.savetxt(tmp_path / "cloud.xyz", scan.points, fmt="%.17g")
    words = ("correct", tmp_path / "cloud.xyz", path, "-o", tmp_path / "fixed.vtp")
    command(*words, "--no-figures")
    fixed = pv.read(tmp_path / "fixed.vtp")
    np.testing.assert_array_equal(fixed.points, iriftrace.correct(scan.points, scene).points)

    matrices = [
        iriftrace.look_at(np.add(place, (10.0 * k, 5.0, 0.0)), (0.0, 0.0, 0.0)) for k in range(2)
    ]
    np.save(tmp_path / "poses.npy", matrices)
    command("sweep", path, "--poses", tmp_path / "poses.npy", "-o", tmp_path / "sweep.nc")
    swept = iriftrace.run_sweep(scene, iriftrace.PoseSet(np.array(matrices)))
    kept = iriftrace.read_sweep(tmp_path / "sweep.nc")
    for name in ("displacement_p95", "coverage", "through_cells", "engine_test_p95"):
        np.testing.assert_array_equal(swept[name].values, kept[name].values, err_msg=name)
