"""Scenes saved from Python are those that the command makes: equal files, hence equal pictures.

Expected values are the command's own files, bit for bit, and folders as they were where work fails.
"""

import gc
import shutil
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from attrs import evolve

import iriftrace
from iriftrace.cli import main
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io import field as field_files
from iriftrace.medium.index_field import IndexField
from iriftrace.tracing.hot_air import HotAir
from iriftrace.tracing.scene import Scene
from validation.inputs import hot_block


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A user's folder with a field and a part."""
    path = tmp_path_factory.mktemp("user")
    hot_block.save(path)
    return path


CAMERA = iriftrace.Camera(
    focal_length_mm=20.0,
    sensor_mm=(6.0, 5.0),
    resolution=(120, 100),
    focus_mm=(50.0, 250.0),
    matrix=iriftrace.look_at(origin=(60.0, -45.0, 70.0), target=(0.0, 0.0, 0.0)),
)


@pytest.mark.usefixtures("variant")
@pytest.mark.filterwarnings("ignore:Hits of this view")
def test_python_and_command_give_the_same_files(folder: Path) -> None:
    field = iriftrace.read_field(folder / "air.vtu")
    part = iriftrace.read_part(folder / "block.stl")
    scene = Scene(part, HotAir(field, layers=5), CAMERA)
    saved = scene.save(folder / "python" / "scene.xml", scale=1.0)
    words = ["scene", str(folder / "air.vtu"), str(folder / "block.stl"), "--layers=5"]
    xml = folder / "command" / "scene.xml"
    assert main([*words, "-o", str(xml), *hot_block.CAMERA, "--target=0,0,0"]) == 0
    files = sorted(path.relative_to(xml.parent) for path in xml.parent.rglob("*.*"))
    assert Path("field.npz") in files
    assert Path("shells/shell_01.ply") in files
    for name in files:
        same = (xml.parent / name).read_bytes() == (saved.path.parent / name).read_bytes()
        # The archive of the field states when it was packed.
        assert same or name == Path("field.npz"), name
    assert saved.fits[0] is not None
    assert saved.fits[0].gap_p95_mm < 0.1
    shells = iriftrace.load_shells(xml.parent)
    assert [len(shell.faces) for shell in shells.shells] == [
        row.triangles for row in saved.reports[0]
    ]


@pytest.mark.usefixtures("variant")
def test_objects_show_themselves_in_one_line(folder: Path, tmp_path: Path) -> None:
    """Sizes with their units, and no array."""
    field = iriftrace.read_field(folder / "air.vtu")
    part = iriftrace.read_part(folder / "block.stl")
    shells = iriftrace.contour_shells(field, 2)
    saved = Scene(part, HotAir(field, shells=shells), CAMERA).save(tmp_path / "s.xml")
    scene = iriftrace.load_scene(saved)
    rendering = iriftrace.render_scene(scene)
    shown = {
        field: "air.vtu: 36 x 36 x 36 mm, 6,734 points, 5,616 cells",
        part: "block.stl: 12 x 12 x 12 mm, 12 triangles, closed, 6 regions",
        shells: "2 shells, ",
        scene: "60 x 50 px, engine auto",
        rendering: "60 x 50 px, PoseMetrics(",
        rendering.image: "60 x 50 px, 17 channels",
    }
    for thing, words in shown.items():
        text = repr(thing)
        assert words in text, text
        assert text.startswith(type(thing).__name__)
        assert "\n" not in text
        assert "array" not in text


@pytest.mark.usefixtures("variant")
@pytest.mark.filterwarnings("ignore:Hits of this view")
def test_what_does_not_fit_is_stated_in_every_result(folder: Path, tmp_path: Path) -> None:
    field = iriftrace.read_field(folder / "air.vtu")
    shift = np.eye(4)
    shift[0, 3] = 0.5
    part = iriftrace.read_part(folder / "block.stl", iriftrace.ReadPart(transform=shift))
    with pytest.warns(IriftraceWarning, match="does not fill the cavity") as caught:
        saved = Scene(part, HotAir(field, layers=3), CAMERA).save(tmp_path / "scene.xml")
    stated = iriftrace.render_scene(iriftrace.load_scene(saved)).metrics.assumptions["field_fit"]
    assert stated in [str(warning.message) for warning in caught]


def test_messages_say_what_to_give_in_python(folder: Path, tmp_path: Path) -> None:
    with pytest.warns(IriftraceWarning, match=r"temperature_k=293\.[12]\) if"):
        field = iriftrace.read_field(folder / "air.vtu", air=iriftrace.Air(temperature_k=350.0))
    assert field.air.temperature_k == 350.0
    with pytest.warns(IriftraceWarning, match=r"unlikely.* check length_unit"):
        large = iriftrace.read_part(folder / "block.stl", iriftrace.ReadPart(length_unit="m"))
    with pytest.raises(InputError, match="with `length_unit` mm") as refused:
        Scene(large, HotAir(field), CAMERA).save(tmp_path / "scene.xml")
    assert (refused.value.code, refused.value.argument) == ("field.not_at_part", "length_unit")


def test_ready_made_shells_need_no_field(folder: Path, tmp_path: Path) -> None:
    part = iriftrace.read_part(folder / "block.stl")
    shells = iriftrace.contour_shells(iriftrace.read_field(folder / "air.vtu"), 2)
    saved = Scene(part, HotAir(shells=shells), CAMERA).save(tmp_path / "scene.xml")
    assert saved.fits == (None,)
    assert not (tmp_path / "field.npz").exists()
    with pytest.raises(InputError, match="give a field, or shells"):
        HotAir()


def test_what_does_not_belong_together_is_refused(folder: Path, tmp_path: Path) -> None:
    """And leaves no file."""
    field = iriftrace.read_field(folder / "air.vtu")
    part = iriftrace.read_part(folder / "block.stl")
    path = tmp_path / "new" / "scene.xml"
    close = CAMERA.at(iriftrace.look_at(origin=(8.0, 0.0, 0.0), target=(0.0, 0.0, 0.0)))
    with pytest.raises(InputError, match="in the hot air"):
        Scene(part, HotAir(field, layers=2), close).save(path)
    with pytest.warns(IriftraceWarning, match="wall"):
        Scene(part, HotAir(field, layers=2, wall_temperature_k=600.0), CAMERA).save(path)
    shutil.rmtree(path.parent)
    away = part.transformed(np.array(((1, 0, 0, 500.0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))))
    with pytest.raises(InputError):
        Scene(away, HotAir(field, layers=2), CAMERA).save(path)
    assert not list(tmp_path.iterdir())


def test_a_full_disk_leaves_the_folder_as_it_was(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    field = iriftrace.read_field(folder / "air.vtu")
    part = iriftrace.read_part(folder / "block.stl")
    older = Scene(part, HotAir(field, layers=2), CAMERA).save(tmp_path / "scene.xml").path
    before = {path: path.read_bytes() for path in tmp_path.rglob("*.*")}

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("iriftrace.tracing.write.save_field_file", full)
    for xml in (older, tmp_path / "a" / "b" / "scene.xml"):
        with pytest.raises(InputError, match="No space left on device"):
            Scene(part, HotAir(field, layers=3), CAMERA).save(xml)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*.*")} == before
    assert not (tmp_path / "a").exists()


def test_a_warning_of_an_ensemble_names_the_members_concerned(folder: Path, tmp_path: Path) -> None:
    """Of two members, the wall of one does not have the temperature of the part."""
    part = iriftrace.read_part(folder / "block.stl")
    cold = iriftrace.read_field(folder / "air.vtu")
    grid = hot_block.air(12)
    grid["T"] = 293.15 + 0.5 * (np.asarray(grid["T"]) - 293.15)
    grid.save(tmp_path / "half.vtu")
    half = iriftrace.read_field(tmp_path / "half.vtu")
    wall = float(np.asarray(cold.temperature_k).max())
    air = HotAir([cold, half], layers=2, labels=("full", "half"), wall_temperature_k=wall)
    with pytest.warns(IriftraceWarning, match="^half: The air at the wall has"):
        Scene(part, air, CAMERA).save(tmp_path / "s" / "scene.xml")


def test_fields_of_an_ensemble_are_in_memory_one_at_a_time(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = field_files.read_field
    earlier: list[weakref.ref[IndexField]] = []
    alive = []

    def counted(*arguments: Any, **options: Any) -> IndexField:
        gc.collect()
        alive.append(sum(field() is not None for field in earlier))
        field = read(*arguments, **options)
        earlier.append(weakref.ref(field))
        return field

    monkeypatch.setattr(field_files, "read_field", counted)
    for name in ("second.vtu", "third.vtu"):
        grid = pv.read(folder / "air.vtu")
        grid.point_data["T"] = grid.point_data["T"] + 0.0
        grid.points = grid.points * 1.001
        grid.save(tmp_path / name)
    words = ["scene", str(folder / "air.vtu"), str(folder / "block.stl"), "--layers=2"]
    words += [f"--member={tmp_path / name}" for name in ("second.vtu", "third.vtu")]
    xml = tmp_path / "scene" / "scene.xml"
    assert main([*words, "-o", str(xml), *hot_block.CAMERA, "--target=0,0,0"]) == 0
    assert alive == [0, 0, 0]


@pytest.mark.usefixtures("variant")
def test_other_light_than_that_of_the_air_is_not_written(folder: Path, tmp_path: Path) -> None:
    """Files have the air's own light; the remedy gives the numbers to the last bit."""
    field = iriftrace.read_field(folder / "air.vtu")
    scene = Scene(iriftrace.read_part(folder / "block.stl"), HotAir(field, layers=4), CAMERA)
    blue = evolve(scene, wavelength_nm=450.0, engine="shells")
    with pytest.raises(InputError, match=r'traced at 450 nm.*\{"wavelength": 450.0\}') as caught:
        blue.save(tmp_path / "blue" / "scene.xml")
    assert caught.value.code == "scene.other_light"
    assert not list(tmp_path.iterdir())
    saved = evolve(scene, wavelength_nm=field.air.wavelength_nm).save(tmp_path / "s" / "scene.xml")
    values = {"scale": 1, "wavelength": 450.0}
    loaded = iriftrace.load_scene(saved, values, engine="shells")
    pictures = [iriftrace.render_scene(one).image.channels for one in (blue, loaded)]
    for name, channel in pictures[0].items():
        np.testing.assert_array_equal(channel, pictures[1][name], err_msg=name)


@pytest.mark.usefixtures("variant")
@pytest.mark.filterwarnings("ignore:.*that were made for it")
def test_the_field_stands_for_its_shells_as_they_were_cut_alone(
    folder: Path, tmp_path: Path
) -> None:
    """Shells that the file moves or leaves out are not those of the field next to it."""
    field = iriftrace.read_field(folder / "air.vtu")
    part = iriftrace.read_part(folder / "block.stl")
    xml = Scene(part, HotAir(field, layers=4), CAMERA).save(tmp_path / "s" / "scene.xml").path
    assert iriftrace.load_scene(xml).through_cells is not None
    text = xml.read_text()
    shell = '<shape type="ply" id="shell_0'
    begin, end = text.index(f'{shell}2">'), text.index(f'{shell}3">')
    xml.write_text(text[:begin] + text[end:])
    assert iriftrace.load_scene(xml).through_cells is None
    named = '<string name="filename" value="shells/'
    placed = '<transform name="to_world"><translate x="5"/></transform>'
    xml.write_text(text.replace(named, placed + named))
    moved = iriftrace.load_scene(xml)
    assert moved.through_cells is None
    for other in ({"engine": "cells"}, {"part": evolve(part)}):
        with pytest.raises(InputError) as caught:
            _ = evolve(moved, **other).compiled
        assert caught.value.code in ("shells.moved", "shells.of_mitsuba")
    with pytest.raises(InputError, match="moves its shells"):
        iriftrace.load_scene(xml, engine="cells")
