"""Scene folders: what is written is loaded, the XML can be edited, wrong files are named."""

import gc
import json
import re
import shutil
import warnings
import weakref
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st

from iriftrace.camera.camera import Camera
from iriftrace.camera.pose import look_at
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.medium.shells.stack import ShellStack
from iriftrace.medium.shells.table import AirStatement
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.scenes.analytic import concentric_cylinders, slab
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.render import render_scene
from iriftrace.tracing.scene import Scene
from iriftrace.tracing.write import write_scene
from iriftrace.tracing.xml import SceneSettings
from validation.inputs.small_scenes import sphere

pytestmark = pytest.mark.usefixtures("variant")

CAMERA = Camera(
    focal_length_mm=10.123456789,
    sensor_mm=(6.7, 5.6),
    resolution=(152, 128),
    principal_point_px=(74.75, 66.0),
    focus_mm=(50.0, 260.0),
    matrix=look_at((37.123456789, -120.987654321, 80.333333333), (1.25, -2.5, 0.75)),
)

Edit = Callable[[str, str], None]
"""Replaces a pattern, which must be there, in the scene's file."""


@pytest.fixture(scope="module")
def contents() -> tuple[Part, ShellStack]:
    return concentric_cylinders(4, sections=60)


@pytest.fixture
def xml(tmp_path: Path, contents: tuple[Part, ShellStack]) -> Path:
    return write_scene(tmp_path / "scene", *contents, CAMERA, paraview=False)


@pytest.fixture
def edit(xml: Path) -> Edit:
    def replace(old: str, new: str) -> None:
        text, count = re.subn(old, new, xml.read_text(), flags=re.DOTALL)
        assert count
        xml.write_text(text)

    return replace


def camera_of(loaded: Scene) -> Camera:
    return Camera.from_dict(loaded.compiled.mitsuba_scene.sensors()[0].description())


def assert_equal(found: Camera, expected: Camera, tolerance: float = 1e-9) -> None:
    np.testing.assert_allclose(found.matrix, expected.matrix, atol=tolerance)
    for name in ("focal_length_mm", "sensor_mm", "resolution", "principal_point_px", "focus_mm"):
        assert getattr(found, name) == getattr(expected, name), name


def test_camera_in_is_camera_out(xml: Path) -> None:
    """To 1e-9, through a lookat in a text file; the pixels' rays to 1e-9 px then."""
    found = camera_of(load_scene(xml))
    assert_equal(found, CAMERA)
    pixels = found.project(CAMERA.origin + 150 * CAMERA.rays()[1])
    centres = np.stack(np.meshgrid(np.arange(152), np.arange(128)), axis=-1)
    np.testing.assert_allclose(pixels, centres.reshape(-1, 2), atol=1e-7)


COORDINATE = st.floats(-900, 900)
POSITION = st.tuples(COORDINATE, COORDINATE, COORDINATE)


@given(POSITION, POSITION)
def test_any_pose_survives_the_xml(
    tmp_path_factory: pytest.TempPathFactory,
    variant: str,
    origin: tuple[float, ...],
    target: tuple[float, ...],
) -> None:
    """Also one that looks straight down, or stands at the origin."""
    import mitsuba as mi

    if np.linalg.norm(np.subtract(origin, target)) < 1e-2:
        return
    camera = evolve(CAMERA, matrix=look_at(origin, target))
    folder = tmp_path_factory.getbasetemp() / "poses"
    part, shells = slab(1)
    xml = write_scene(folder, part, shells, camera, paraview=False)
    sensor = re.search(r"<sensor.*?</sensor>", xml.read_text(), flags=re.DOTALL)
    assert sensor
    text = sensor[0].replace("<sensor", '<sensor version="3.0.0"').replace("$scale", "1")
    loaded = Camera.from_dict(mi.load_string(text).description())
    assert_equal(loaded, camera)


def test_unlimited_focus_stays_unlimited(tmp_path: Path, contents: tuple[Part, ShellStack]) -> None:
    camera = evolve(CAMERA, focus_mm=(0.0, np.inf))
    xml = write_scene(tmp_path, *contents, camera, paraview=False)
    assert "focus_far" not in xml.read_text()
    assert camera_of(load_scene(xml)).focus_mm == (0.0, np.inf)


def test_part_and_shells_in_are_part_and_shells_out(
    xml: Path, contents: tuple[Part, ShellStack]
) -> None:
    """Faces in the file's order, regions by name, indices in double precision."""
    part, shells = contents
    loaded = load_scene(xml)
    np.testing.assert_array_equal(loaded.part.faces, part.faces)
    np.testing.assert_allclose(loaded.part.vertices, part.vertices, atol=1e-5)
    assert loaded.part.region_names == part.region_names
    np.testing.assert_array_equal(loaded.part.region_of_face, part.region_of_face)
    np.testing.assert_array_equal(loaded.part_to_world, np.eye(4))
    found = {
        shape.id(): (shape.bsdf().ext_ior, shape.bsdf().int_ior, shape.face_count())
        for shape in loaded.compiled.mitsuba_scene.shapes()
        if shape.id() != "part"
    }
    assert found == {
        f"shell_{s.layer:02d}": (1 + s.ext, 1 + s.int_, len(s.faces)) for s in shells.shells
    }
    assert loaded.compiled.stated.rule == "rim"
    assert loaded.compiled.normals == "gradient"


def test_parameters_of_the_file(xml: Path) -> None:
    """-D scale and normals, as numbers or as text."""
    loaded = load_scene(xml, {"scale": 0.25, "normals": "facet"})
    assert camera_of(loaded).resolution == (38, 32)
    assert loaded.compiled.normals == "facet"
    assert camera_of(load_scene(xml, {"scale": "0.5"})).resolution == (76, 64)


def test_parameters_are_those_of_the_xml_and_not_of_its_text(xml: Path, edit: Edit) -> None:
    """Attributes in any order and quotes; a comment has no parameters and uses none."""
    edit('<default name="scale" value="1.0"/>', "<default value='1.0'\n name='scale'/>")
    edit("</scene>", '<!-- <default name="member" value="1"/> $other --></scene>')
    assert load_scene(xml, {"scale": 0.5}).camera.resolution == (
        CAMERA.resolution[0] // 2,
        CAMERA.resolution[1] // 2,
    )
    with pytest.raises(InputError, match="has no parameter member"):
        load_scene(xml, {"member": 1})
    edit("</scene>", '<default name="other" value="1"/></scene>')
    with pytest.raises(InputError, match=r"nothing in it uses \$other"):
        load_scene(xml)


def test_defaults_of_the_parameters_are_written(
    tmp_path: Path, contents: tuple[Part, ShellStack]
) -> None:
    xml = write_scene(
        tmp_path,
        *contents,
        CAMERA,
        SceneSettings(scale=0.5, normals="facet"),
        name="half.xml",
        paraview=False,
    )
    assert xml == tmp_path / "half.xml"
    loaded = load_scene(xml)
    assert camera_of(loaded).resolution == (76, 64)
    assert loaded.compiled.normals == "facet"
    names = re.findall(r'<default name="(\w+)" value="(\w+)"/>', xml.read_text())
    assert dict(names) == {"normals": "facet", "bending": "layers"}
    assert loaded.compiled.integrator.bending == "layers"


def test_a_scene_is_freed_with_the_last_that_has_it(xml: Path) -> None:
    """Mitsuba's scene and its integrator hold each other; a notebook loads many."""
    loaded = load_scene(xml)
    tables = weakref.ref(loaded.compiled.integrator.prepare(loaded.compiled.mitsuba_scene))
    copy = evolve(loaded, second=loaded.camera)
    del loaded
    gc.collect()
    assert tables() is not None
    del copy
    gc.collect()
    assert tables() is None


def test_camera_can_be_moved_by_hand(xml: Path, edit: Edit) -> None:
    """Through the lookat that the file shows."""
    edit('origin="[^"]*"', 'origin="0, -150, 90"')
    edit('target="[^"]*"', 'target="0, 0, 0"')
    edit('up="[^"]*"', 'up="0, 0, 1"')
    expected = look_at((0, -150, 90), (0, 0, 0))
    np.testing.assert_allclose(camera_of(load_scene(xml)).matrix, expected, atol=1e-12)


def test_rays_beyond_a_shell_that_was_dropped_by_hand_are_lost(xml: Path, edit: Edit) -> None:
    """One crossing less for every ray, and one step less than the field has."""
    whole = render_scene(load_scene(xml, {"scale": 0.25})).image
    edit('<shape type="ply" id="shell_02">.*?</shape>', "")
    with pytest.warns(IriftraceWarning, match="that were made for it"):
        edited = load_scene(xml, {"scale": 0.25})
    assert edited.compiled.index_rule.startswith("edited")
    with pytest.warns(IriftraceWarning, match="inconsistent deflection"):
        fewer = render_scene(edited, include=(0, 5)).image
    beyond = (whole.status == 0) & (whole.channels["path.crossings"] == 4)
    assert beyond.sum() > 50
    np.testing.assert_array_equal(fewer.channels["path.crossings"][beyond], 3)
    np.testing.assert_array_equal(fewer.status[beyond], 5)


def test_shells_and_parts_of_other_scenes_are_noticed(xml: Path, tmp_path: Path) -> None:
    """A finer cylinder fits the air and has as many shells, so nothing else would tell."""
    finer = concentric_cylinders(4, sections=80)
    other = write_scene(tmp_path / "other", *finer, CAMERA, paraview=False).parent
    with warnings.catch_warnings():
        warnings.simplefilter("error", IriftraceWarning)
        rule = load_scene(xml).compiled.index_rule
    shutil.copy(other / "shells" / "shell_02.ply", xml.parent / "shells")
    with pytest.warns(IriftraceWarning, match=r"shell_02\.ply is not among the shells"):
        assert load_scene(xml).compiled.index_rule == f"edited: 1 of 4 {rule} shells changed"
    text = xml.read_text()
    xml.write_text(text.replace('"part.ply"', '"../other/part.ply"'))
    with pytest.warns(IriftraceWarning) as told:
        load_scene(xml)
    assert not any("is not the part" in str(one.message) for one in told), (
        "another file, chosen on purpose"
    )
    xml.write_text(text)
    shutil.copy(other / "part.ply", xml.parent)
    with pytest.warns(IriftraceWarning) as told:
        load_scene(xml)
    assert sum("is not the part" in str(one.message) for one in told) == 1


def test_a_shell_of_another_folder_is_noticed(xml: Path, tmp_path: Path, edit: Edit) -> None:
    """Though it has the same name, the same indices and a table of its own."""
    finer = concentric_cylinders(4, sections=80)
    other = write_scene(tmp_path / "other", *finer, CAMERA, paraview=False).parent
    edit('"shells/shell_02.ply"', f'"{other}/shells/shell_02.ply"')
    with pytest.warns(
        IriftraceWarning, match=r"other/shells/shell_02\.ply is not among the shells"
    ):
        assert load_scene(xml).compiled.index_rule.startswith("edited: 1 of 4")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("part", "part.ply"),
        ("part", {"file": 5, "sha256": "0"}),
        ("air", [1]),
        ("shells", "none"),
        ("shells", [1]),
        ("shells", [{"file": "shell_01.ply", "sha256": "0"}]),
    ],
)
def test_a_damaged_table_is_named(xml: Path, key: str, value: object) -> None:
    table = xml.parent / "shells" / "shells.json"
    table.write_text(json.dumps({**json.loads(table.read_text()), key: value}))
    with pytest.raises(InputError, match=r"shells\.json cannot be read \(.*write the scene again"):
        load_scene(xml)


def test_part_can_be_placed_by_hand(xml: Path, edit: Edit) -> None:
    """The part that the metrics use moves with Mitsuba's."""
    placed = '<transform name="to_world"><translate x="1" y="2" z="3"/></transform>'
    before = load_scene(xml).part
    edit('"part.ply"/>', f'"part.ply"/>{placed}')
    loaded = load_scene(xml)
    np.testing.assert_allclose(
        loaded.part.vertices, before.vertices + np.array((1, 2, 3)), atol=1e-9
    )
    np.testing.assert_array_equal(loaded.part_to_world[:3, 3], (1, 2, 3))


def test_writing_again_replaces_and_removes_what_is_stale(
    tmp_path: Path, contents: tuple[Part, ShellStack]
) -> None:
    part, shells = contents
    write_scene(tmp_path, part, shells, CAMERA, paraview=False)
    fewer = evolve(shells, shells=shells.shells[:2])
    loaded = load_scene(write_scene(tmp_path, part, fewer, CAMERA, paraview=False))
    assert len(loaded.compiled.mitsuba_scene.shapes()) == 3
    files = sorted(path.name for path in (tmp_path / "shells").iterdir())
    assert files == ["shell_01.ply", "shell_02.ply", "shells.json"]


def test_folder_can_be_moved(tmp_path: Path, xml: Path) -> None:
    """All names in the file are relative to it."""
    moved = xml.parent.rename(tmp_path / "else where")
    assert str(tmp_path) not in (moved / "scene.xml").read_text()
    assert len(load_scene(moved / "scene.xml").compiled.mitsuba_scene.shapes()) == 5


def test_orthographic_cameras_are_refused(
    tmp_path: Path, contents: tuple[Part, ShellStack]
) -> None:
    flat = Camera(projection="orthographic", sensor_mm=(60, 50), resolution=(6, 5))
    with pytest.raises(InputError, match="pinhole camera; put an orthographic sensor"):
        write_scene(tmp_path / "scene", *contents, flat)
    assert not (tmp_path / "scene").exists()


def test_folder_that_cannot_be_made_is_named(
    tmp_path: Path, contents: tuple[Part, ShellStack]
) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"cannot make the folder .*file.scene: Not a directory"):
        write_scene(tmp_path / "file" / "scene", *contents, CAMERA)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("</scene>", "", r"scene\.xml is no longer XML \(no element found"),
        ('type="calibrated_camera"', 'type="calibrated_camra"', "calibrated_camra"),
        ("shells/shell_03.ply", "shells/shell_33.ply", "shell_33.ply is not next to"),
        ('<string name="filename" value="part.ply"/>', "", '"filename"|mesh file'),
        (
            '<shape type="ply" id="shell_03">',
            '<shape type="ply" id="part">',
            '2 shapes with id="part"|part',
        ),
        ('name="focus_near"', 'name="focus_ner"', 'unreferenced property.*"focus_ner"'),
        ('origin="[^"]*"', 'origin="nan, 0, 0"', "invalid lookat"),
    ],
)
def test_broken_files_are_refused_in_one_line(
    xml: Path, edit: Edit, old: str, new: str, message: str
) -> None:
    edit(old, new)
    with pytest.raises(InputError, match=message) as caught:
        load_scene(xml)
    assert "\n" not in str(caught.value)
    assert "Traceback" not in str(caught.value)
    assert ".cpp" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "unused", "message"),
    [
        (
            "<integrator.*?</integrator>",
            '<integrator type="path"/>',
            '<default name="(normals|bending)".*?/>',
            'PathIntegrator.*<integrator type="first_hit"/>',
        ),
        ("<sensor.*?</sensor>", "", '<default name="scale".*?/>', "has no sensor"),
        (
            '<shape type="ply" id="part">.*?</shape>',
            '<shape type="cube" id="part"/>',
            "Lengths in mm",
            'id="part".*is a cube.*use type ply',
        ),
    ],
)
def test_scenes_that_cannot_be_traced_are_refused(
    xml: Path, edit: Edit, old: str, new: str, unused: str, message: str
) -> None:
    """`unused` are parameters of what was replaced."""
    edit(old, new)
    edit(unused, "")
    with pytest.raises(InputError, match=message):
        load_scene(xml)


def test_scene_without_shells_loads(xml: Path, edit: Edit) -> None:
    """A part alone is a legitimate scene: nothing is displaced."""
    edit('<shape type="ply" id="shell_.*?</shape>', "")
    loaded = load_scene(xml, {"scale": 0.25})
    assert loaded.compiled.stated == AirStatement()
    assert loaded.compiled.normals == "facet"
    assert render_scene(loaded).image.channels["displacement.norm"].max() < 1e-9


def test_part_of_any_mesh_round_trips(tmp_path: Path) -> None:
    """A sphere has one region; Mitsuba's faces keep their numbers."""
    mesh = sphere(12.0, 2)
    ball = part_of_mesh(mesh.vertices, mesh.faces, name="ball")
    loaded = load_scene(write_scene(tmp_path, ball, slab(1)[1], CAMERA, paraview=False))
    vertices, faces = loaded.compiled.tables.part_arrays()
    np.testing.assert_allclose(vertices[faces], mesh.triangles, atol=1e-5)
