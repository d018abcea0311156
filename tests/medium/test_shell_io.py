"""Shells on disk: what other programs read, what comes back, and that nothing is half written."""

import json

import numpy as np
import pytest
import pyvista as pv
import trimesh
from attrs import evolve
from numpy.testing import assert_allclose, assert_array_equal

from iriftrace.core.errors import InputError
from iriftrace.io.shells import load_shells, read_shell, save_shells, write_shell
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.medium.shells.report import report_shells
from iriftrace.medium.shells.stack import ShellStack
from validation.inputs.shell_fields import sphere_field


@pytest.fixture(scope="module")
def stack() -> ShellStack:
    return contour_shells(sphere_field(12), layers=3)


def test_stack_comes_back_bit_for_bit(stack, tmp_path):
    """But for the length of the gradient, which the files keep as a vector."""
    save_shells(stack, tmp_path / "new" / "folder", notes={"time": "mean"})
    back = load_shells(tmp_path / "new" / "folder")
    assert (back.rule, back.air, back.small_components) == (
        stack.rule,
        stack.air,
        stack.small_components,
    )
    assert back.source.sha256 == stack.source.sha256
    for a, b in zip(stack.shells, back.shells, strict=True):
        assert (a.layer, a.refractivity, a.ext, a.int_) == (b.layer, b.refractivity, b.ext, b.int_)
        assert_array_equal(a.vertices, b.vertices)
        assert_array_equal(a.faces, b.faces)
        assert_array_equal(a.normals, b.normals)
        assert_allclose(a.derivatives[:, 0], b.derivatives[:, 0], rtol=4e-7)
        assert_array_equal(a.derivatives[:, 1:], b.derivatives[:, 1:])


def test_files_are_named_by_layer_and_complete(stack, tmp_path):
    files = save_shells(evolve(stack, shells=stack.shells[1:]), tmp_path)
    names = ["shell_02.ply", "shell_03.ply", "shells.vtm", "shells.json"]
    assert [f.name for f in files] == names
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([*names, "shells"])


def test_ply_is_what_other_programs_expect(stack, tmp_path):
    path = save_shells(stack, tmp_path)[0]
    mesh = trimesh.load(path, process=False)
    assert_array_equal(mesh.vertices, stack.shells[0].vertices)
    assert_array_equal(mesh.faces, stack.shells[0].faces)
    assert_allclose(mesh.vertex_normals, stack.shells[0].normals, atol=1e-6)
    assert_array_equal(pv.read(path).regular_faces, stack.shells[0].faces)
    header = path.read_bytes().split(b"end_header")[0]
    assert b"property list uchar ushort vertex_indices" in header
    # Names of this kind are what Mitsuba takes for attributes of the vertices.
    known = ["gradient_1", "gradient_2", "gradient_3"]
    known += [f"hessian_{axes}_1" for axes in ("xx", "yy", "zz", "yz", "xz", "xy")]
    lines = "".join(f"property float {name}\n" for name in known)
    assert f"property float nz\n{lines}element face".encode() in header
    assert b"double" not in header
    raw = mesh.metadata["_ply_raw"]["vertex"]["data"]
    columns = np.stack([np.ravel(raw[name]) for name in known], axis=1)
    length, second = np.split(stack.shells[0].derivatives, [1], axis=1)
    assert_allclose(columns[:, :3], length * stack.shells[0].normals, rtol=1e-6)
    assert_array_equal(columns[:, 3:], second)


def test_shell_without_normals_says_so(stack, tmp_path):
    bare = evolve(stack, shells=[evolve(s, normals=None, derivatives=None) for s in stack.shells])
    path = save_shells(bare, tmp_path)[0]
    assert b"nx" not in path.read_bytes()[:400]
    assert not load_shells(tmp_path).has_normals


def test_shell_without_derivatives_keeps_its_normals(stack, tmp_path):
    bare = evolve(stack, shells=[evolve(s, derivatives=None) for s in stack.shells])
    path = save_shells(bare, tmp_path)[0]
    header = path.read_bytes().split(b"end_header")[0]
    assert not any(name in header for name in (b"gradient", b"hessian"))
    back = load_shells(tmp_path)
    assert back.has_normals
    assert [s.derivatives for s in back.shells] == [None] * 3
    assert list(pv.read(tmp_path / "shells.vtm")[0].point_data) == ["Normals"]


def test_paraview_file_has_all_shells_with_their_values(stack, tmp_path):
    save_shells(stack, tmp_path)
    blocks = pv.read(tmp_path / "shells.vtm")
    assert blocks.keys() == ["shell_01", "shell_02", "shell_03"]
    for block, shell, kelvin in zip(blocks, stack.shells, stack.temperature_k, strict=True):
        assert_array_equal(block.points, shell.vertices)
        assert_array_equal(block.regular_faces, shell.faces)
        assert_array_equal(block.cell_data["refractivity"], shell.refractivity)
        assert_array_equal(block.cell_data["temperature_k"], kelvin)
        assert_array_equal(block.cell_data["layer"], shell.layer)
        assert_array_equal(block.point_data["Normals"], shell.normals)
        assert_array_equal(block.point_data["gradient_magnitude_1_mm"], shell.derivatives[:, 0])
        second = block.point_data["hessian_1_mm2"]
        assert_array_equal(second, shell.derivatives[:, 1:])


def test_table_tells_provenance_and_the_report(stack, tmp_path):
    save_shells(stack, tmp_path, report_shells(stack), notes={"time": "snapshot"})
    table = json.loads((tmp_path / "shells.json").read_text(encoding="utf-8"))
    assert table["schema"] == "iriftrace.shells/1"
    assert table["notes"] == {"time": "snapshot"}
    assert table["rule"] == "rim"
    assert table["air"]["wavelength_nm"] == 633.0
    assert table["source"]["array"] == "T"
    first = table["shells"][0]
    assert first["file"] == "shell_01.ply"
    assert first["triangles"] == len(stack.shells[0].faces)
    assert first["closed"] is True
    assert first["gap_next_mm"] > 0
    assert 1.0 + first["ext"] == 1.0 + stack.shells[0].ext


def test_report_of_other_shells_is_refused(stack, tmp_path):
    with pytest.raises(InputError, match="does not list"):
        save_shells(stack, tmp_path, report_shells(stack)[1:])
    assert list(tmp_path.iterdir()) == []


def test_smaller_stack_leaves_no_old_shells_behind(stack, tmp_path):
    save_shells(stack, tmp_path)
    save_shells(evolve(stack, shells=stack.shells[:1]), tmp_path)
    assert [p.name for p in tmp_path.glob("*.ply")] == ["shell_01.ply"]
    assert [p.name for p in (tmp_path / "shells").iterdir()] == ["shell_01.vtp"]
    save_shells(stack, tmp_path, paraview=False)
    assert not (tmp_path / "shells.vtm").exists()
    assert list((tmp_path / "shells").iterdir()) == []
    assert len(load_shells(tmp_path).shells) == 3


def test_folder_that_cannot_be_made_is_refused(stack, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot make the folder"):
        save_shells(stack, tmp_path / "file")


@pytest.mark.parametrize(("vertices", "corner"), [(65_536, b"ushort"), (65_537, b"int")])
def test_corners_have_as_many_bits_as_the_last_vertex_needs(vertices, corner, tmp_path):
    path = tmp_path / "shell.ply"
    places = np.random.default_rng(1).random((vertices, 3), dtype=np.float32)
    faces = np.array([[0, 1, vertices - 1], [vertices - 1, 2, 3]])
    write_shell(path, places, faces)
    assert b"property list uchar %s vertex_indices" % corner in path.read_bytes()
    read = read_shell(path)
    assert_array_equal(read[0], places)
    for found in (read[1], trimesh.load(path, process=False).faces, pv.read(path).regular_faces):
        assert_array_equal(found, faces)


def test_file_with_wide_corners_is_read_too(stack, tmp_path):
    """As earlier versions and other programs write them."""
    path = save_shells(stack, tmp_path)[0]
    shell = stack.shells[0]
    header, _, body = path.read_bytes().partition(b"end_header\n")
    rows = np.empty(len(shell.faces), [("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, shell.faces
    vertices = body[: -7 * len(shell.faces)]
    header = header.replace(b"ushort", b"int") + b"end_header\n"
    path.write_bytes(header + vertices + rows.tobytes())
    assert_array_equal(load_shells(tmp_path).shells[0].faces, shell.faces)


@pytest.mark.parametrize(
    ("text", "code"),
    [
        (None, "file.missing"),
        ("{", "file.damaged"),
        ("[1]", "file.schema"),
        ('{"schema": "iriftrace.shells/0"}', "file.schema"),
        ('{"schema": "iriftrace.shells/1", "shells": [{}]}', "file.damaged"),
    ],
)
def test_damaged_table_is_refused(stack, tmp_path, text, code):
    save_shells(stack, tmp_path)
    (tmp_path / "shells.json").unlink()
    if text is not None:
        (tmp_path / "shells.json").write_text(text)
    with pytest.raises(InputError) as error:
        load_shells(tmp_path)
    assert error.value.code == code


def test_damaged_mesh_is_refused(stack, tmp_path):
    path = save_shells(stack, tmp_path)[0]
    whole = path.read_bytes()
    renamed = whole.replace(b"hessian_xx_1", b"straight_1", 1)
    for content in (whole[:-1], b"", whole.replace(b"binary", b"ascii!", 1), renamed):
        path.write_bytes(content)
        with pytest.raises(InputError) as error:
            read_shell(path)
        assert error.value.code == "file.damaged"
    path.unlink()
    with pytest.raises(InputError, match="There is no file"):
        load_shells(tmp_path)


@pytest.mark.parametrize("key", ["layer", "refractivity", "ext", "int"])
@pytest.mark.parametrize("value", ["0.0002", None, float("nan"), True])
def test_numbers_of_the_table_are_numbers(stack, tmp_path, key, value):
    save_shells(stack, tmp_path)
    table = json.loads((tmp_path / "shells.json").read_text())
    table["shells"][0][key] = value
    (tmp_path / "shells.json").write_text(json.dumps(table))
    with pytest.raises(InputError, match=rf"is not an? .*number @ \$\.shells\[0\]\.{key}"):
        load_shells(tmp_path)
