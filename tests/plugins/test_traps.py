"""Traps of Mitsuba, each of which once spoilt a result in silence."""

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import iriftrace
from iriftrace.core.errors import InputError, IriftraceWarning, SetupError
from iriftrace.core.runtime import variant as runtime
from iriftrace.io.shells import read_shell, write_shell
from iriftrace.medium.shells.stack import Shell, ShellStack
from iriftrace.scenes.analytic import slab
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.rays import trace_rays
from iriftrace.tracing.write import write_scene
from validation.inputs.scene_rays import ANY_CAMERA
from validation.inputs.small_scenes import (
    channels,
    nested_spheres,
    part,
    scene,
    shell,
    sphere,
    vector,
)

pytestmark = pytest.mark.usefixtures("variant")

Edit = Callable[[str, str], None]


@pytest.fixture
def xml(tmp_path: Path) -> Path:
    """The layered slab with three shells, written by write_scene."""
    return write_scene(tmp_path / "scene", *slab(3), ANY_CAMERA, paraview=False)


@pytest.fixture
def edit(xml: Path) -> Edit:
    def replace(old: str, new: str) -> None:
        text = xml.read_text()
        assert old in text
        xml.write_text(text.replace(old, new))

    return replace


def test_plain_load_file_keeps_matched_shells_apart(tmp_path: Path) -> None:
    """Mitsuba merges shapes of equal bsdfs by default; each shell's layer name prevents it."""
    body, stack = slab(4)
    matched = ShellStack(
        [
            Shell(s.layer, s.refractivity, 2e-4, 2e-4, s.vertices, s.faces, s.normals)
            for s in stack.shells
        ],
        stack.air,
        "custom",
    )
    xml = write_scene(tmp_path, body, matched, ANY_CAMERA, paraview=False)
    loaded = mi.load_file(str(xml))
    ids = {shape.id() for shape in loaded.shapes()}
    assert ids == {"part", "shell_01", "shell_02", "shell_03", "shell_04"}
    pixels = channels(loaded)
    assert (pixels["path.crossings"][pixels["part.face"] > 0] == 4).any()


def test_part_that_was_merged_away_is_missed_by_name(tmp_path: Path) -> None:
    """Part and fixture of one bsdf become one shape without id; the message names the cause."""
    described = {
        "type": "scene",
        "integrator": {"type": "first_hit"},
        "part": part(tmp_path, sphere(5.0)),
        "fixture": {**part(tmp_path, sphere(5.0))},
    }
    merged = mi.load_dict(described)
    with pytest.raises(InputError, match=r"0 shapes with id 'part'.*optimize=False"):
        merged.integrator().prepare(merged)
    kept = mi.load_dict(described, optimize=False)
    assert kept.integrator().prepare(kept).tables.part.id() == "part"


def test_scene_file_without_part_is_refused(xml: Path, edit: Edit) -> None:
    edit('id="part"', 'id="target"')
    with pytest.raises(InputError, match='0 shapes with id="part"'):
        load_scene(xml)


@pytest.mark.parametrize("kind", ["sphere", "shell"])
def test_part_must_be_an_opaque_mesh(tmp_path: Path, kind: str) -> None:
    shapes = {
        "sphere": {"type": "sphere"},
        "shell": shell(tmp_path, "part", sphere(5.0), 1.0002, 1.0001),
    }
    loaded = scene({"part": shapes[kind]})
    with pytest.raises(InputError, match="must be an opaque triangle mesh"):
        loaded.integrator().prepare(loaded)


def test_shell_must_be_a_mesh(tmp_path: Path) -> None:
    bsdf = {"type": "iso_shell", "ext_ior": 1.0002, "int_ior": 1.0001}
    loaded = scene({"part": part(tmp_path, sphere(5.0)), "air": {"type": "sphere", "bsdf": bsdf}})
    with pytest.raises(InputError, match="Shell 'air' is not a triangle mesh"):
        loaded.integrator().prepare(loaded)


def without_normals(xml: Path, name: str = "shell_02.ply") -> None:
    path = xml.parent / "shells" / name
    vertices, faces, normals, _ = read_shell(path)
    assert normals is not None
    write_shell(path, vertices, faces)


def test_ply_without_normals_is_refused_for_gradient_normals(xml: Path, edit: Edit) -> None:
    """Mitsuba would make angle-weighted normals of its own, which know nothing of grad(n)."""
    without_normals(xml)
    with pytest.raises(InputError, match=r"shell_02\.ply.* has no vertex normals.*face_normals"):
        load_scene(xml)
    edit(
        'shells/shell_02.ply"/>',
        'shells/shell_02.ply"/><boolean name="face_normals" value="true"/>',
    )
    with pytest.warns(IriftraceWarning, match=r"shell_02\.ply is not among the shells"):
        assert load_scene(xml).compiled.normals == "gradient, but facet for 1 of the shells"


def test_shells_without_normals_get_face_normals(tmp_path: Path) -> None:
    """What write_scene makes of facet-only shells loads, and says facet."""
    body, stack = slab(3)
    flat = [
        Shell(s.layer, s.refractivity, s.ext, s.int_, s.vertices, s.faces) for s in stack.shells
    ]
    xml = write_scene(
        tmp_path, body, ShellStack(flat, stack.air, "midpoint"), ANY_CAMERA, paraview=False
    )
    loaded = load_scene(xml)
    assert loaded.compiled.normals == "facet"
    assert not loaded.compiled.tables.has_normals


def test_zero_normals_take_the_facets(tmp_path: Path) -> None:
    """Mitsuba turns a (0, 0, 0) normal into NaN, which would spread over the ray."""
    mesh = sphere(20.0)
    body = {"part": part(tmp_path, sphere(10.0))}
    air = {
        kind: scene(
            {**body, "air": shell(tmp_path, kind, mesh, 1.0003, 1.0001, normals)},
            normals="gradient",
        )
        for kind, normals in (("zero", np.zeros_like(mesh.vertices)), ("facet", None))
    }
    zero, facet = (channels(loaded) for loaded in air.values())
    np.testing.assert_array_equal(zero["status.code"], facet["status.code"])
    np.testing.assert_allclose(
        vector(zero, "displacement"), vector(facet, "displacement"), atol=1e-9
    )
    assert zero["displacement.norm"].max() > 1e-3


def test_flipped_normals_are_refused(xml: Path, edit: Edit) -> None:
    """They turn Mitsuba's normals but leave the faces, so outside and inside would disagree."""
    edit(
        'shells/shell_02.ply"/>',
        'shells/shell_02.ply"/><boolean name="flip_normals" value="true"/>',
    )
    with pytest.raises(InputError, match=r"Shell 'shell_02' has flip_normals.*swap ext_ior"):
        load_scene(xml)


@pytest.mark.parametrize(
    ("mesh", "what"), [("shells/shell_02.ply", "Shell 'shell_02'"), ("part.ply", "The part")]
)
def test_mirroring_placement_is_refused(xml: Path, edit: Edit, mesh: str, what: str) -> None:
    placed = '<transform name="to_world"><scale x="-1" y="1" z="1"/></transform>'
    edit(f'{mesh}"/>', f'{mesh}"/>{placed}')
    with pytest.raises(InputError, match=f"{what} has a to_world that mirrors"):
        load_scene(xml)


def test_mirrored_shell_of_a_plain_script_is_refused(tmp_path: Path) -> None:
    """There no XML can be read; the triangles' order contradicts the vertex normals."""
    mesh = sphere(20.0)
    air = shell(tmp_path, "air", mesh, 1.0003, 1.0001, mesh.vertices / 20)
    air["to_world"] = mi.ScalarTransform4f().scale([-1, 1, 1])
    loaded = scene({"part": part(tmp_path, sphere(10.0)), "air": air})
    with pytest.raises(InputError, match="triangles of shell 'air' face against"):
        channels(loaded)


def test_rotated_shells_and_part_are_fine(xml: Path, edit: Edit) -> None:
    """A placement without mirroring turns the whole arrangement; so do the hits."""
    plain = trace_rays(load_scene(xml), [(3.0, 2.0, 30.0)], [(0.3, 0.1, -1.0)])
    turn = '<transform name="to_world"><rotate z="1" angle="90"/></transform>'
    for mesh in ("part.ply", *(f"shells/shell_0{k}.ply" for k in (1, 2, 3))):
        edit(f'"{mesh}"/>', f'"{mesh}"/>{turn}')
    turned = trace_rays(load_scene(xml), [(-2.0, 3.0, 30.0)], [(-0.1, 0.3, -1.0)])
    quarter = np.array(((0, -1, 0), (1, 0, 0), (0, 0, 1)))
    np.testing.assert_allclose(turned.displacement, plain.displacement @ quarter.T, atol=1e-9)
    assert np.linalg.norm(plain.displacement) > 1e-4


def test_unneeded_default_is_an_error_of_the_file(xml: Path, edit: Edit) -> None:
    edit('value="$scale"', 'value="0.5"')
    with pytest.raises(InputError, match=r'<default name="scale">, but nothing in it uses \$scale'):
        load_scene(xml)


def test_misspelt_variable_is_refused(xml: Path, edit: Edit) -> None:
    """Mitsuba reads $scales as the value of $scale and an s."""
    edit("$scale", "$scales")
    with pytest.raises(InputError, match=r'line 2[0-9].*"1\.0s"'):
        load_scene(xml)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            '<float name="focal_length" value="10.0"/>',
            '<string name="focal_length" value="10.0"/>',
            'is \'10.0\', not a number; write <float name="focal_length" value="..."/>.',
        ),
        (
            '<float name="focal_length" value="10.0"/>',
            '<float name="focal_length" value="0"/>',
            "Focal length is 0.0 mm, so no picture forms; give a positive length.",
        ),
        (
            '<string name="normals" value="$normals"/>',
            '<string name="normals" value="$normals"/><string name="max_crossings" value="9"/>',
            'is \'9\', not a number; write <float name="max_crossings" value="..."/>.',
        ),
        (
            '<string name="layer" value="2"/>',
            '<string name="label" value="2"/>',
            'unreferenced property in bsdf plugin of type "iso_shell": - string "label": "2"',
        ),
    ],
)
def test_wrong_values_in_the_file_become_one_line_that_says_where(
    xml: Path, edit: Edit, old: str, new: str, message: str
) -> None:
    """Mitsuba's loader takes a string where a number belongs, and wraps a plugin's refusal into a
    traceback; the user sees file, line and the refusal."""
    edit(old, new)
    with pytest.raises(InputError) as caught:
        load_scene(xml)
    text = str(caught.value)
    assert text.endswith(message)
    assert re.search(r"scene\.xml \(line \d+", text)
    assert "Traceback" not in text
    assert "\n" not in text


def test_stock_dielectric_counts_as_shell_and_warns(xml: Path, edit: Edit) -> None:
    """It bends as iso_shell does, but for its single precision."""
    ray = ([(3.0, 2.0, 30.0)], [(0.6, 0.1, -1.0)])
    exact = trace_rays(load_scene(xml, {"bending": "shells"}), *ray)
    edit('type="iso_shell"', 'type="dielectric"')
    own = r'\s*<(string name="layer"|float name="iso_ior") value="[^"]*"/>'
    xml.write_text(re.sub(own, "", xml.read_text()))
    with pytest.warns(IriftraceWarning, match="dielectric, whose single-precision index ratio"):
        loaded = load_scene(xml)
    with pytest.warns(
        IriftraceWarning, match=r"^Your mi\.Scene has shells with Mitsuba's dielectric"
    ):
        iriftrace.from_mitsuba(loaded.compiled.mitsuba_scene)
    rough = trace_rays(loaded, *ray)
    assert rough.crossings[0] == exact.crossings[0] == 3
    assert rough.status[0] == 0
    error = np.linalg.norm(rough.displacement - exact.displacement)
    assert error < 0.01 * np.linalg.norm(exact.displacement)


def test_missing_embree_flag_warns(xml: Path, edit: Edit) -> None:
    """It cannot be asked of a loaded scene, so it is read from the file."""
    edit('<boolean name="embree_use_robust_intersections" value="true"/>', "")
    with pytest.warns(IriftraceWarning, match="embree_use_robust_intersections.*slip between"):
        load_scene(xml)


def test_order_of_the_shapes_does_not_matter(tmp_path: Path) -> None:
    """Mitsuba sorts shapes as it likes; each triangle must keep its own shell's indices."""
    spheres = nested_spheres(tmp_path, (20.0, 16.0, 13.0), (1.0003, 1.00025, 1.0002, 1.0001))
    body = {"part": part(tmp_path, sphere(10.0))}
    forward = channels(scene({**body, **spheres}))
    backward = channels(scene({**dict(reversed(spheres.items())), **body}))
    for name, values in forward.items():
        np.testing.assert_array_equal(values, backward[name])


def test_part_that_is_read_in_two_ways_is_refused(xml: Path) -> None:
    """iriftrace turns an inward mesh outward and Mitsuba does not: face numbers would agree, but
    not the sides. The part must be written anew."""
    mesh = sphere(5.0, 1)
    write_shell(xml.parent / "part.ply", mesh.vertices, mesh.faces[:, ::-1])
    with (
        pytest.warns(IriftraceWarning),
        pytest.raises(InputError, match=r"other triangles than iriftrace does.*iriftrace scene"),
    ):
        load_scene(xml)


def test_scalar_variants_are_refused_in_one_sentence(variant: str) -> None:
    import iriftrace.plugins

    try:
        mi.set_variant("scalar_rgb")
        with pytest.raises(SetupError, match=r"variant is scalar_rgb.*llvm_ad_mono") as caught:
            iriftrace.plugins.register()
        assert "\n" not in str(caught.value)
    finally:
        mi.set_variant(variant)


def test_plugins_survive_switching_the_variant_and_back(tmp_path: Path, variant: str) -> None:
    """They are registered per variant; results before and after are the same."""
    shapes = {
        "part": part(tmp_path, sphere(10.0)),
        **nested_spheres(tmp_path, (15.0,), (1.0003, 1.0001)),
    }
    before = channels(scene(shapes))
    try:
        mi.set_variant("scalar_rgb")
        mi.set_variant("llvm_ad_rgb")
        between = channels(scene(shapes))
    finally:
        mi.set_variant(variant)
    after = channels(scene(shapes))
    assert runtime.current_variant() == variant
    for name, values in before.items():
        np.testing.assert_array_equal(after[name], values)
        np.testing.assert_allclose(between[name], values, atol=1e-9)


SCRIPT = """
import sys
import mitsuba as mi
mi.set_variant("llvm_ad_mono")
import iriftrace.plugins
iriftrace.plugins.register()
scene = mi.load_file(sys.argv[1], scale="0.1")
tensor = mi.render(scene)
names = [field.name for field in scene.sensors()[0].film().bitmap().struct_()]
print(tensor.shape, names[0], names[-1], len(names))
mi.set_variant("llvm_ad_rgb")
print(type(mi.load_dict({"type": "first_hit"})).__name__)
"""


def test_plugins_in_a_plain_mitsuba_script(xml: Path, tmp_path: Path) -> None:
    """In a fresh process, from another folder, without iriftrace's own loading and rendering."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(xml)], capture_output=True, text=True, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    lines = [line for line in done.stdout.splitlines() if "WARN" not in line and line.strip()]
    # 153 x 128 pixels times 0.1; Y and the seventeen channels.
    assert lines[0] == "(13, 15, 18) Y status.code 18"
    assert lines[-1] == "FirstHit"


def test_registering_without_a_variant_says_what_to_call(tmp_path: Path) -> None:
    script = "import iriftrace.plugins; iriftrace.plugins.register()"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, cwd=tmp_path
    )
    assert done.returncode == 1
    assert "SetupError: Mitsuba's variant is None" in done.stderr
    assert 'mitsuba.set_variant("llvm_ad_mono")' in done.stderr
