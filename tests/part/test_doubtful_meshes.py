"""Mesh files as programs write them: units in words, packed files, concave polygons, far parts."""

import gzip
import json
import warnings
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from iriftrace.cli import reading
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.part_files import read_part
from iriftrace.io.reading import ReadPart

BOX = trimesh.creation.box((4.0, 3.0, 2.0))
OBJ = trimesh.exchange.obj.export_obj(BOX)


def test_a_unit_that_is_not_known_is_warned_of(tmp_path: Path) -> None:
    """Where a comment states one; other words of a comment are no statement."""
    path = tmp_path / "part.obj"
    path.write_text(f"# units: feet\n{OBJ}")
    with pytest.warns(IriftraceWarning, match="units: feet"):
        assert read_part(path).length_unit == "mm"
    path.write_text(f"# Exported from Rhino in centimeters\n{OBJ}")
    assert read_part(path).length_unit == "mm"


def test_an_off_file_states_its_unit_in_a_comment(tmp_path: Path) -> None:
    text = BOX.export(file_type="off")
    (tmp_path / "part.off").write_text(text.replace("OFF\n", "OFF\n# units: cm\n", 1))
    assert read_part(tmp_path / "part.off").length_unit == "cm"


@pytest.mark.parametrize("name", ["part.stl", "part.stl.gz", "part.zip"])
def test_packed_files_are_named(tmp_path: Path, name: str) -> None:
    """Bodies of a zip would all be combined, without their units."""
    if name.endswith("zip"):
        with zipfile.ZipFile(tmp_path / name, "w") as archive:
            archive.writestr("part.stl", BOX.export(file_type="stl"))
    else:
        (tmp_path / name).write_bytes(gzip.compress(BOX.export(file_type="stl")))
    with pytest.raises(InputError, match=r"is packed \(gzip, bzip2 or zip\); unpack it"):
        read_part(tmp_path / name)


@pytest.mark.parametrize(
    ("extension", "read"), [("KHR_mesh_quantization", False), ("KHR_materials_unlit", True)]
)
def test_extensions_of_gltf_that_are_required(tmp_path: Path, extension: str, read: bool) -> None:
    """Quantized coordinates would be read 65,535 times too large; colours do not matter."""
    files = trimesh.exchange.gltf.export_gltf(trimesh.Scene(BOX))
    content = json.loads(files.pop("model.gltf"))
    content["extensionsRequired"] = [extension]
    (tmp_path / "part.gltf").write_text(json.dumps(content))
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
    if read:
        assert read_part(tmp_path / "part.gltf").closed
        return
    with pytest.raises(InputError, match="has the extension KHR_mesh_quantization"):
        read_part(tmp_path / "part.gltf")


L_SHAPE = [(0, 0), (40, 0), (40, 10), (10, 10), (10, 30), (0, 30)]


@pytest.mark.parametrize("start", range(6))
def test_fans_of_concave_polygons_are_warned_of(tmp_path: Path, start: int) -> None:
    """They cover the corner between the arms, with an area of 4600 or 5200 instead of 4000 mm^2."""
    outline = L_SHAPE[start:] + L_SHAPE[:start]
    lines = [f"v {x} {y} {z}" for z in (0, 20) for x, y in outline]
    lines += ["f 6 5 4 3 2 1", "f 7 8 9 10 11 12"]
    lines += [f"f {k + 1} {(k + 1) % 6 + 1} {(k + 1) % 6 + 7} {k + 7}" for k in range(6)]
    path = tmp_path / "part.obj"
    path.write_text("\n".join(lines) + "\n")
    with pytest.warns(IriftraceWarning, match="folded back onto their neighbours"):
        assert read_part(path).area > 4500.0
    sound = trimesh.creation.extrude_triangulation(
        np.array(L_SHAPE, dtype=float), np.array([(0, 1, 2), (0, 2, 3), (0, 3, 5), (3, 4, 5)]), 20.0
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sound.export(tmp_path / "part.ply")
        assert read_part(tmp_path / "part.ply").area == pytest.approx(4000.0)


def test_a_part_far_from_the_origin_is_warned_of(tmp_path: Path) -> None:
    """As of a plant's drawing: single precision has steps of 0.03 mm at 500 m."""
    path = tmp_path / "part.obj"
    far = np.asarray(BOX.vertices) + np.array((5e5, 0.0, 0.0))
    trimesh.Trimesh(far, BOX.faces, process=False).export(path)
    back = np.eye(4)
    with pytest.warns(IriftraceWarning, match=r"5e\+05 mm from the origin.*steps of 0\.031 mm"):
        read_part(path)
    back[0, 3] = -5e5
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_allclose(read_part(path, ReadPart(transform=back)).centre, 0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "turn"), [("a.glb", None), ("a.glb", "rotate x 90"), ("a.stl", None)]
)
def test_the_axis_that_is_up_in_gltf_is_said(
    tmp_path: Path, name: str, turn: str | None, capsys: pytest.CaptureFixture[str]
) -> None:
    trimesh.Scene(BOX).export(tmp_path / name)
    reading.read_part(tmp_path / name, ReadPart(transform=turn))
    said = " ".join(capsys.readouterr().out.split())
    assert ("up is y in glTF, but z here" in said) == (name == "a.glb" and turn is None)
    reading.read_part(tmp_path / name, ReadPart(expansion=14e-6, hot_temperature=["1050 K"]))
    assert "mm at 776.85 degC, read in" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("outer", [1, -1])
@pytest.mark.parametrize("cavity", [1, -1])
@pytest.mark.parametrize("beside", [1, -1])
def test_each_of_several_bodies_faces_outward(
    tmp_path: Path, outer: int, cavity: int, beside: int
) -> None:
    """A box with a cavity next to another box; a mirrored component is often inside out.

    The cavity's triangles are turned with those of the bodies, unless these are right (then it may
    be a body in another one), or all have negative volumes.
    """
    hollow = 0.5 * BOX.vertices
    vertices = np.vstack((BOX.vertices, hollow, BOX.vertices + np.array((8.0, 0.0, 0.0))))
    signs = (outer, -cavity, beside)
    faces = np.vstack([BOX.faces[:, ::sign] + 8 * k for k, sign in enumerate(signs)])
    trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "part.ply")
    wrong = outer < 0 or beside < 0
    with (
        pytest.warns(IriftraceWarning, match="inward-facing normals")
        if wrong
        else warnings.catch_warnings(action="error")
    ):
        part = read_part(tmp_path / "part.ply")
    body_in_it = (cavity < 0 and not wrong) or signs == (-1, -1, -1)
    assert part.volume == pytest.approx(51.0 if body_in_it else 45.0)
    middle = np.where(part.face_centres[:, :1] > 4.0, (8.0, 0.0, 0.0), 0.0)
    outward = np.einsum("ij,ij->i", part.face_centres - middle, part.face_normals) > 0.0
    assert outward[:12].all()
    assert outward[24:].all()


def test_bodies_that_touch_with_other_triangles_are_not_taken_apart(tmp_path: Path) -> None:
    """Their common edges have four triangles, so each wall would be a body of its own."""
    low, high = trimesh.creation.box((4.0, 3.0, 2.0)), trimesh.creation.box((4.0, 3.0, 1.0))
    other = np.asarray(high.vertices) + np.array((0.0, 0.0, 1.5))
    mesh = trimesh.Trimesh(
        np.vstack((low.vertices, other)), np.vstack((low.faces, high.faces + 8)), process=False
    )
    mesh.export(tmp_path / "part.ply")
    part = read_part(tmp_path / "part.ply")
    assert part.closed
    assert part.volume == pytest.approx(36.0)


def test_slivers_next_to_a_part_are_no_bodies(tmp_path: Path) -> None:
    sliver = 1e-3 * np.asarray(BOX.vertices) + 9.0
    vertices = np.vstack((BOX.vertices, sliver))
    faces = np.vstack((BOX.faces, BOX.faces[:, ::-1] + 8))
    trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "part.ply")
    np.testing.assert_array_equal(read_part(tmp_path / "part.ply").faces, faces)
