"""A scene of files is a value: what it reads, what stays and what changes with it."""

from pathlib import Path

import numpy as np
import pytest
from attrs import evolve

import iriftrace
from iriftrace.core.errors import InputError
from iriftrace.image.aov_image import AovImage
from iriftrace.scenes import folder_of

pytestmark = [
    pytest.mark.usefixtures("variant"),
    pytest.mark.filterwarnings("ignore:Hits of"),
    pytest.mark.filterwarnings("ignore:.*rays fall on each visible face"),
]

SMALL = {"scale": 0.06}


@pytest.fixture(scope="module")
def cylinder() -> iriftrace.Scene:
    return iriftrace.load_scene(folder_of("cylinder") / "scene.xml", SMALL, engine="shells")


def picture(scene: iriftrace.Scene) -> AovImage:
    return iriftrace.render_scene(scene, empty=True).image


def assert_same(one: iriftrace.Scene, other: iriftrace.Scene) -> None:
    first, second = picture(one), picture(other)
    for name, channel in first.channels.items():
        np.testing.assert_array_equal(channel, second.channels[name], err_msg=name)


@pytest.mark.parametrize(
    ("values", "changes", "engine"),
    [
        ({"wavelength": "450 nm"}, {"wavelength_nm": 450.0}, "shells"),
        ({}, {"engine": "cells"}, "cells"),
        ({"wavelength": "450 nm"}, {"engine": "cells", "wavelength_nm": 450.0}, "cells"),
    ],
)
def test_a_parameter_is_an_attribute(
    cylinder: iriftrace.Scene, values: dict[str, str], changes: dict[str, object], engine: str
) -> None:
    path = folder_of("cylinder") / "scene.xml"
    loaded = iriftrace.load_scene(path, {**SMALL, **values}, engine=engine)
    changed = evolve(cylinder, **changes)
    assert changed.path == loaded.path
    assert changed.variables == loaded.variables
    assert_same(changed, loaded)


def test_devices_change_without_another_compilation(cylinder: iriftrace.Scene) -> None:
    compiled = cylinder.compiled
    camera = cylinder.camera.at(iriftrace.look_at((150.0, 30.0, 120.0), (0.0, 0.0, 0.0)))
    moved = evolve(cylinder, camera=camera, second=cylinder.camera)
    assert moved.compiled is compiled
    assert moved.path == cylinder.path
    np.testing.assert_array_equal(
        picture(moved).channels["shift.px.X"],
        iriftrace.render_scene(cylinder, camera=camera).image.channels["shift.px.X"],
    )


def test_another_part_or_air_is_not_that_of_the_file(cylinder: iriftrace.Scene) -> None:
    """What is traced is the value, and results do not name the file."""
    block = iriftrace.read_part(folder_of("fringe_cylinder") / "part.ply")
    other = evolve(cylinder, part=block.transformed(np.diag((0.5, 0.5, 0.5, 1.0))))
    assert other.path is None
    seen, whole = ((picture(one).channels["part.face"] > 0).sum() for one in (other, cylinder))
    assert 0 < seen < 0.5 * whole
    bare = evolve(cylinder, air=iriftrace.HotAir(shells=cylinder.air.states[0].shells))
    assert bare.path is None
    first, second = (picture(one).channels["displacement.norm"] for one in (bare, cylinder))
    # The gradient in the file is split into normal and length, in single precision.
    np.testing.assert_allclose(first, second, atol=1e-6 * second.max())


def test_other_air_of_a_loaded_scene_is_checked(cylinder: iriftrace.Scene) -> None:
    """A field 1 m away bends nothing, which looks like a good result."""
    field = iriftrace.read_field(folder_of("cylinder") / "field.vtu")
    grid = field.grid.copy()
    grid.points = grid.points + np.array((1000.0, 0.0, 0.0))
    elsewhere = iriftrace.HotAir(evolve(field, grid=grid), layers=3)
    own = iriftrace.from_mitsuba(cylinder.compiled.mitsuba_scene)
    for scene in (cylinder, own):
        with pytest.raises(InputError) as caught:
            picture(evolve(scene, air=elsewhere))
        assert caught.value.code == "field.not_at_part"
    there = evolve(cylinder, air=iriftrace.HotAir(field, layers=3))
    assert picture(there).channels["displacement.norm"].max() > 0.0
    inside = cylinder.camera.at(iriftrace.look_at(np.mean(cylinder.part.bounds, axis=0), (1, 0, 0)))
    with pytest.raises(InputError) as caught:
        _ = evolve(there, camera=inside).ready
    assert caught.value.code == "camera.inside"


def test_hits_are_those_of_the_devices_of_the_scene(cylinder: iriftrace.Scene) -> None:
    """Of those that were loaded by Mitsuba's own sensor, to which derivatives are attached."""
    camera = cylinder.camera.at(iriftrace.look_at((150.0, 30.0, 120.0), (0.0, 0.0, 0.0)))
    moved = evolve(cylinder, camera=camera, second=cylinder.camera)
    expected = picture(moved)
    hits = iriftrace.hits(moved)
    for name, found in (("straight.X", hits.straight.x), ("shift.px.X", hits.shift_px[0])):
        shown = expected.channels[name].ravel()[np.array(hits.ray)]
        np.testing.assert_array_equal(np.float32(found), shown)
    second, own = iriftrace.hits(moved, sensor=1), iriftrace.hits(cylinder)
    np.testing.assert_array_equal(np.array(second.refracted), np.array(own.refracted))


def test_the_full_resolution_is_that_of_the_camera(cylinder: iriftrace.Scene) -> None:
    """The film's belongs to the pictures of the scale with which the file was loaded."""
    full = list(cylinder.compiled.full_resolution)
    assert full != list(cylinder.camera.resolution)
    moved = cylinder.camera.at(iriftrace.look_at((150.0, 30.0, 120.0), (0.0, 0.0, 0.0)))
    own = evolve(cylinder.camera, resolution=(90, 75), principal_point_px=None)
    for camera, expected in ((moved, full), (own, [90, 75])):
        for image in (
            picture(evolve(cylinder, camera=camera)),
            iriftrace.render_scene(cylinder, camera=camera).image,
        ):
            assert image.header["full_resolution"] == expected


def test_air_and_bodies_are_those_of_the_folder(cylinder: iriftrace.Scene) -> None:
    (state,) = cylinder.air.states
    assert len(state.shells.shells) == len(cylinder.compiled.stated.shells)
    assert state.source == state.shells.source
    assert len(state.cells.celltypes) > 1000
    plate = iriftrace.load_scene(folder_of("hot_plate") / "scene.xml", SMALL)
    (blocker,) = plate.blockers
    shape = next(s for s in plate.compiled.mitsuba_scene.shapes() if s.id() == "blocker_1")
    box = shape.bbox()
    np.testing.assert_allclose(blocker.bounds, [np.array(box.min), np.array(box.max)], rtol=1e-6)


def test_the_air_of_a_mitsuba_scene_is_known_to_mitsuba_alone(cylinder: iriftrace.Scene) -> None:
    own = iriftrace.from_mitsuba(cylinder.compiled.mitsuba_scene)
    assert_same(own, cylinder)
    with pytest.raises(InputError):
        picture(evolve(own, engine="cells"))


def test_a_path_is_no_scene(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="load_scene"):
        iriftrace.render_scene(tmp_path / "scene.xml")  # type: ignore[arg-type]


def test_a_scene_of_files_is_not_written_again(cylinder: iriftrace.Scene, tmp_path: Path) -> None:
    """Its folder holds a field and shells that would be lost, or rounded a second time."""
    with pytest.raises(InputError, match="copy its folder"):
        cylinder.save(tmp_path / "again" / "scene.xml")
    assert not list(tmp_path.iterdir())
