"""Wrong input: exit code 2, one readable message, nothing half written, no traceback."""

from __future__ import annotations

import os
import re
import shlex
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from iriftrace.cli import main
from validation.inputs import hot_block
from validation.inputs.hot_block import HotBlock

Failing = Callable[..., str]


@pytest.fixture
def scene(hot: HotBlock, tmp_path: Path) -> Path:
    """A copy of the scene folder that a test may spoil; returns its XML."""
    shutil.copytree(hot.scene.parent, tmp_path / "scene")
    return tmp_path / "scene" / "scene.xml"


# Options of every kind -----------------------------------------------------------------------

OPTIONS = {
    "no layers": ("--layers=0", "0 layers"),
    "far too many layers": ("--layers=1000000000", "at most 10000"),
    "no number": ("--layers=many", "many"),
    "ambient without value": ("--ambient", "ambient"),
    "unknown unit": ("--ambient='20 degX'", "20 degX"),
    "ambient out of range": ("--ambient='900 degC'", "900|1173"),
    "humidity in percent": ("--humidity=50", "50.*0 to 1|50.*between 0 and 1"),
    "unknown model": ("--air-model=owens", "ciddor"),
    "unknown array": ("--array=U", "'U'.*T"),
    "quantity that is not there": ("--quantity=density", "density"),
    "unknown temperature unit": ("--temperature-unit=F", "degC"),
    "unknown length unit": ("--field-length-unit=parsec", "parsec"),
    "unknown transform": ("--field-transform='turn x 90'", "turn x 90"),
    "index range with one end": ("--index-range=2.7e-4", "OUTSIDE:INSIDE"),
    "index range reversed": ("--index-range='1000 degC:20 degC'", "ambient"),
    "index range of n": ("--index-range=1.00027:1.00006", '"1.00027".*not n - 1'),
    "index range without units": ("--index-range=20:1000", "20 degC"),
    "index range outside the field": ("--index-range='-30 degC:10 degC'", "no surface"),
    "levels out of range": ("--levels=3e-4,1e-4", "0.0003"),
    "levels of words": ("--levels=a,b", "a,b"),
    "unknown rule": ("--rule=inner", "midpoint"),
    "negative size": ("--min-size=-1", "-1"),
    "negative smoothing": ("--smooth=-1", "-1"),
    "unknown option": ("--colour=red", "colour"),
    "surplus word": ("surplus", "surplus"),
    "unknown field time": ("--field-time=now", "snapshot"),
}


@pytest.mark.parametrize(("options", "words"), OPTIONS.values(), ids=OPTIONS.keys())
def test_shell_options(fails: Failing, hot: HotBlock, options: str, words: str) -> None:
    message = fails("shells", hot.field, "-o", "shells", *shlex.split(options))
    assert re.search(words, message)


PART_OPTIONS = {
    "unknown length unit": ("--length-unit=feet", "feet"),
    "unknown transform": ("--part-transform='rotate w 90'", "rotate w 90"),
    "expansion without temperature": ("--expansion=14e-6/K", "hot temperature"),
    "expansion that is none": ("--expansion=14 --hot-temperature=1000", "14"),
    "angle of nothing": ("--region-angle=0", "angle"),
    "part in another place": ("--part-transform='translate 500 0 0'", "translate -500"),
    "part in metres": ("--length-unit=m", "with --length-unit mm"),
    "field in metres": ("--field-length-unit=m", "with --field-length-unit mm"),
    "field elsewhere": ("--field-transform='translate 0 0 90'", "does not reach"),
}


@pytest.mark.parametrize(("options", "words"), PART_OPTIONS.values(), ids=PART_OPTIONS.keys())
def test_part_options(fails: Failing, hot: HotBlock, options: str, words: str) -> None:
    """A field that does not reach the part is refused, and the mistaken unit is named."""
    part = ("--part", hot.part, "-o", "out", "--layers=2")
    assert re.search(words, fails("shells", hot.field, *part, *shlex.split(options)))


def test_a_scene_refuses_a_part_elsewhere(fails: Failing, hot: HotBlock) -> None:
    words = ("scene", hot.field, hot.part, "-o", "out/scene.xml", "--layers=2")
    assert "translate -500" in fails(*words, "--part-transform=translate 500 0 0")


CAMERA_OPTIONS = {
    "no focal length": ("--focal-length=0", "Focal length is 0"),
    "negative sensor": ("--sensor='-6 mm,5 mm'", "-6"),
    "sensor with one side": ("--sensor='6 mm'", "width and height"),
    "resolution with one side": ("--resolution=100", "2 numbers"),
    "no resolution": ("--resolution=0,100", "0 x 100"),
    "focus reversed": ("--focus=250:50", "250"),
    "origin with two numbers": ("--origin=1,2", "3 numbers"),
    "origin is target": ("--origin=1,2,3 --target=1,2,3", "same point"),
    "origin in the part": ("--origin=0,0,3", "part"),
    "origin in hot air": ("--origin=8,0,0", "hot air"),
    "no up": ("--up=0,0,0", "up"),
    "principal point with three numbers": ("--principal-point=1,2,3", "2 numbers"),
    "no scale": ("--scale=0", "cale is 0"),
    "unknown normals": ("--normals=smooth", "gradient"),
}


@pytest.mark.parametrize(("options", "words"), CAMERA_OPTIONS.values(), ids=CAMERA_OPTIONS.keys())
def test_camera_options(fails: Failing, hot: HotBlock, options: str, words: str) -> None:
    output = ("-o", "out/scene.xml", "--layers=2")
    message = fails("scene", hot.field, hot.part, *output, *shlex.split(options))
    assert re.search(words, message)


COMMANDS = {
    "unknown command": ("sing", "sing"),
    "no field": ("shells -o out", "needs FIELD"),
    "no output": ("shells air.vtu", "needs -o"),
    "no scene": ("render", "needs SCENE"),
    "missing field": ("shells gone.vtu -o out", "gone.vtu does not exist"),
    "missing scene": ("render gone.xml", "gone.xml"),
    "missing image": ("metrics gone.exr", "gone.exr"),
    "no name at all": ("render ''", "folder"),
    "folder as field": ("shells . -o out", "folder"),
    "folder as scene": ("render .", "folder"),
    "define unknown": ("demo -D sclae=0.5", "sclae.*scale"),
    "unknown variant": ("demo --variant=fast", "fast"),
    "scalar variant": ("demo --variant=scalar_rgb", "scalar"),
}


@pytest.mark.parametrize(("line", "words"), COMMANDS.values(), ids=COMMANDS.keys())
def test_commands(fails: Failing, line: str, words: str) -> None:
    assert re.search(words, fails(*shlex.split(line)))


# Outputs -------------------------------------------------------------------------------------

OUTPUTS = {
    "scene without name": ("scene {field} {part} -o out", r"\.xml"),
    "scene into a folder": ("scene {field} {part} -o here", "here is a folder"),
    "scene in a file": ("scene {field} {part} -o file/scene.xml", "file is a file"),
    "shells into a file": ("shells {field} -o file", "file is a file"),
    "image into a folder": ("render {scene} -o here", "here is a folder"),
    "image in no folder": ("render {scene} -o gone/out.exr", "gone does not exist"),
    "image that would be the scene": ("render {scene} -o scene.xml", r"\.exr"),
    "image that would be the metrics": ("render {scene} -o out.json", r"\.exr"),
    "metrics in no folder": ("metrics {image} -o gone/out.json", "gone does not exist"),
    "metrics that would be the image": ("metrics {image} -o out.exr", r"\.json"),
    "demo into a file": ("demo -o file", "file is a file"),
    "a name that is too long": (f"render {{scene}} -o {'x' * 250}.exr", "too long"),
    "status that is none": ("render {scene} -o out.exr --include=99", "99.*5 index_mismatch"),
    "status of a word": ("render {scene} -o out.exr --include=good", '"good"'),
}


@pytest.mark.parametrize(("line", "words"), OUTPUTS.values(), ids=OUTPUTS.keys())
def test_outputs(fails: Failing, hot: HotBlock, tmp_path: Path, line: str, words: str) -> None:
    """Found before the work begins, and no output replaces an input."""
    (tmp_path / "here").mkdir()
    (tmp_path / "file").touch()
    (tmp_path / "scene.xml").touch()
    names = {"field": hot.field, "part": hot.part, "scene": hot.scene, "image": hot.image}
    assert re.search(words, fails(*shlex.split(line.format(**names))))


def test_negative_values_need_no_equals_sign(fails: Failing, hot: HotBlock) -> None:
    """A camera at negative coordinates and a cold room are no options of their own."""
    words = ["scene", str(hot.field), str(hot.part), "-o", "out/scene.xml", "--layers=2"]
    assert "stands in the part" in fails(*words, "--origin", "-.5,0,3")
    assert "-300 degC" in fails(*words, "--ambient", "-300 degC")


@pytest.mark.parametrize("command", ["shells", "scene", "render", "metrics", "demo"])
def test_a_folder_that_may_not_be_written(
    fails: Failing, hot: HotBlock, tmp_path: Path, command: str
) -> None:
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o500)
    if os.access(closed, os.W_OK):  # whoever may do everything cannot write here
        closed = Path("/proc")
    arguments = {
        "shells": (hot.field, "-o", closed / "shells", "--layers=1"),
        "scene": (hot.field, hot.part, "-o", closed / "scene.xml", "--layers=1"),
        "render": (hot.scene, "-o", closed / "out.exr"),
        "metrics": (hot.image, "-o", closed / "out.json"),
        "demo": ("-o", closed / "demo", "-D", "scale=0.01"),
    }[command]
    assert str(closed) in fails(command, *arguments)


def test_the_demo_keeps_a_scene_that_was_changed(fails: Failing, tmp_path: Path) -> None:
    """The demo itself proposes to change it; the next `make demo` must not undo that."""
    changed = tmp_path / "out" / "scene" / "scene.xml"
    changed.parent.mkdir(parents=True)
    changed.write_text("<scene/>")
    assert "was edited by hand" in fails("demo", "-o", "out")


def test_the_scene_does_not_replace_the_part(fails: Failing, hot: HotBlock, tmp_path: Path) -> None:
    """Written back in float32 and moved, it would be another part at the next run."""
    trimesh.load(hot.part).export(tmp_path / "part.ply")
    assert "would replace" in fails("scene", hot.field, "part.ply", "-o", "scene.xml")


# Fields --------------------------------------------------------------------------------------


def test_a_volume_as_isosurfaces_and_the_reverse(fails: Failing, hot: HotBlock) -> None:
    assert "triangles" in fails("shells", hot.field, "-o", "shells", "--isosurfaces")
    table = hot.scene.parent / "shells" / "shells.vtm"
    assert "volume" in fails("shells", table, "-o", "shells")
    assert "smaller than 99 mm" in fails(
        "shells", table, "-o", "shells", "--isosurfaces", "--min-size=99"
    )


# Parts ---------------------------------------------------------------------------------------


def test_a_folder_as_part(fails: Failing, hot: HotBlock) -> None:
    assert "folder" in fails("scene", hot.field, ".", "-o", "out/scene.xml")
    assert "folder" in fails("shells", hot.field, "--part", ".", "-o", "out")


def test_a_part_that_is_not_closed_is_legitimate(
    hot: HotBlock, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A scanned surface: one warning says which numbers suffer, and the work goes on."""
    mesh = hot_block.block().subdivide().subdivide().subdivide()
    mesh.update_faces(np.arange(len(mesh.faces)) > 0)
    mesh.export(tmp_path / "open.stl")
    scene = tmp_path / "scene" / "scene.xml"
    arguments = ["scene", str(hot.field), str(tmp_path / "open.stl"), "-o", str(scene)]
    for command in ([*arguments, "--layers=2", *hot_block.CAMERA], ["render", str(scene)]):
        capsys.readouterr()
        assert main(command) == 0
        said = capsys.readouterr().err
        assert said.count("warning:") == 1
        assert "is not closed (3 open edges): coverage" in said
    assert main(["metrics", str(scene.with_suffix(".exr"))]) == 0


# Scenes --------------------------------------------------------------------------------------

SCENES = {
    "broken": ("</scene>", "", "scene.xml"),
    "no integrator": ('<integrator type="first_hit">', '<integrator type="sniff">', "sniff"),
    "no part": ('id="part"', 'id="block"', 'id="part"'),
    "missing part": ("part.ply", "gone.ply", "gone.ply"),
    "missing shell": ("shell_02.ply", "gone.ply", "gone.ply"),
    "unknown plugin": ('"iso_shell"', '"iso_shall"', "iso_shall"),
    "half precision": ('value="float32"', 'value="float16"', "float32"),
    "blurred film": ('rfilter type="box"', 'rfilter type="gaussian"', "box"),
    "no focal length": ('"focal_length" value="20.0"', '"focal_length" value="0"', "focal"),
    "negative sensor": ('"sensor_width" value="6.0"', '"sensor_width" value="-6"', "sensor|Sensor"),
    "focal length of words": ('"focal_length" value="20.0"', '"focal_length" value="f"', '"f"'),
    "unread property": ('"focal_length" value="20.0"', '"focus" value="1"', "focus|focal_length"),
    "out of focus": ('"focus_far" value="250.0"', '"focus_far" value="60"', "in focus.*60 mm"),
    "index of glass": ('"ext_ior" value="1.0002', '"ext_ior" value="-1.0002', "ext_ior"),
}


def replaced(scene: Path, old: str, new: str) -> None:
    text = scene.read_text()
    assert old in text
    scene.write_text(text.replace(old, new))


@pytest.mark.parametrize(("old", "new", "words"), SCENES.values(), ids=SCENES.keys())
def test_scenes(fails: Failing, scene: Path, old: str, new: str, words: str) -> None:
    replaced(scene, old, new)
    assert re.search(words, fails("render", scene, "-o", "out.exr"))


POSES = {
    "in the part": ("0, 0, 3", "0, 0, 0", "inside the part"),
    "in a shell": ("0, 0, 12", "0, 0, 0", "inside the hot air"),
    "looking away": ("60, -45, 70", "120, -90, 140", "No ray of the camera hits the part"),
    "too far": ("600, -450, 700", "0, 0, 0", "in focus"),
    "not a place": ("nan, 0, 0", "0, 0, 0", ""),
}


@pytest.mark.parametrize(("origin", "target", "words"), POSES.values(), ids=POSES.keys())
def test_poses(fails: Failing, scene: Path, origin: str, target: str, words: str) -> None:
    text = scene.read_text()
    posed = re.sub(r'origin="[^"]*"\s*target="[^"]*"', f'origin="{origin}" target="{target}"', text)
    assert posed != text
    scene.write_text(posed)
    assert re.search(words, fails("render", scene, "-o", "out.exr"))


def test_an_integrator_that_computes_light(fails: Failing, scene: Path) -> None:
    text = re.sub(
        r"<integrator.*</integrator>",
        '<integrator type="path"/>',
        scene.read_text(),
        flags=re.DOTALL,
    )
    assert "path" in text
    scene.write_text(re.sub(r'<default name="(normals|bending)".*?/>', "", text))
    assert "first_hit" in fails("render", scene, "-o", "out.exr")


DEFINITIONS = {
    "misspelt": ("sclae=0.5", "sclae.*scale"),
    "nonsense": ("scale=big", "big"),
    "negative": ("scale=-1", "scale"),
    "normals": ("normals=smooth", "smooth"),
    "bending": ("bending=facet", "bending.*facet.*layers, shells"),
    "without value": ("scale", "name=value"),
    "without name": ("=0.5", "name=value"),
}


@pytest.mark.parametrize(("text", "words"), DEFINITIONS.values(), ids=DEFINITIONS.keys())
def test_definitions(fails: Failing, hot: HotBlock, text: str, words: str) -> None:
    assert re.search(words, fails("render", hot.scene, "-o", "out.exr", "-D", text))


def test_a_scene_that_is_no_text(fails: Failing, tmp_path: Path) -> None:
    (tmp_path / "scene.xml").write_bytes(bytes(range(256)))
    assert "scene.xml is not a Mitsuba scene" in fails("render", "scene.xml")


def test_a_field_in_place_of_a_scene(fails: Failing, hot: HotBlock) -> None:
    assert "is not a Mitsuba scene" in fails("render", hot.field)


# Images --------------------------------------------------------------------------------------


def test_another_part(fails: Failing, hot: HotBlock, tmp_path: Path) -> None:
    trimesh.creation.icosphere().export(tmp_path / "ball.stl")
    assert "SHA-256 differs" in fails("metrics", hot.image, "-o", "o.json", "--part", "ball.stl")
    assert "--part" in fails("metrics", hot.image, "-o", "o.json", "--part", "gone.stl")


def test_a_part_that_was_changed_since(
    fails: Failing, hot: HotBlock, scene: Path, tmp_path: Path
) -> None:
    """The numbers of its faces would not fit any more."""
    assert main(["render", str(scene), "--no-figures"]) == 0
    part = scene.parent / "part.ply"
    part.write_bytes(part.read_bytes() + b"\n")
    assert "SHA-256 differs" in fails("metrics", scene.with_suffix(".exr"))
    part.unlink()
    assert "is missing" in fails("metrics", scene.with_suffix(".exr"))
    assert hot.scene.parent.joinpath("part.ply").is_file()


def test_a_scene_in_a_folder_that_is_not_there_is_called_so(fails: Failing) -> None:
    """And not its output, which would lie beside it."""
    message = fails("render", "nowhere/scene.xml")
    assert message == "There is no scene file nowhere/scene.xml; `iriftrace scene` writes one."
