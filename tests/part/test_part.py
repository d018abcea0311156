"""Reading a part: the order of faces, regions, orientation, units, expansion, and refusals."""

import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.part_files import read_part, save_part
from iriftrace.io.reading import ReadPart
from iriftrace.part.part import Part, part_of_mesh

CYLINDER = Path(__file__).parents[2] / "scenes" / "cylinder" / "part.ply"


@pytest.fixture
def box(tmp_path: Path) -> Path:
    path = tmp_path / "box.stl"
    trimesh.creation.box(extents=(10, 20, 30)).export(path)
    return path


def test_bundled_cylinder_has_its_size_and_regions() -> None:
    """Diameter 27 mm, length 170 mm; 60 segments make the surface a little smaller than round."""
    part = read_part(CYLINDER)
    assert part.closed
    assert set(part.region_names) == {"head -x", "head +x", "lateral"}
    np.testing.assert_allclose(part.bounds, [[-85, -13.5, -13.5], [85, 13.5, 13.5]])
    np.testing.assert_allclose(part.centre, 0, atol=1e-9)
    round_areas = {"head -x": np.pi * 13.5**2, "lateral": np.pi * 27 * 170}
    for name, expected in round_areas.items():
        faces = part.region_of_face == part.region_names.index(name)
        assert 0.995 * expected < part.face_areas[faces].sum() < expected
    heads = part.face_normals[part.region_of_face == part.region_names.index("head -x")]
    np.testing.assert_allclose(heads, np.tile([-1.0, 0, 0], (len(heads), 1)), atol=1e-6)


def test_areas_normals_and_volume_of_a_box(box: Path) -> None:
    part = read_part(box)
    assert part.area == pytest.approx(2 * (10 * 20 + 20 * 30 + 30 * 10), rel=1e-6)
    assert part.volume == pytest.approx(10 * 20 * 30, rel=1e-6)
    corners = part.vertices[part.faces]
    outward = np.einsum("ij,ij->i", corners.mean(axis=1) - part.centre, part.face_normals)
    assert (outward > 0).all()
    np.testing.assert_allclose(np.linalg.norm(part.face_normals, axis=1), 1)


def test_face_order_is_that_of_the_file(tmp_path: Path) -> None:
    """``part.face`` of the EXR counts faces as Mitsuba does, which reads them in file order."""
    source = trimesh.creation.icosphere(subdivisions=2, radius=20)
    order = np.random.default_rng(3).permutation(len(source.faces))
    source = trimesh.Trimesh(source.vertices, source.faces[order], process=False)
    for suffix in ("ply", "stl", "obj", "off", "glb"):
        source.export(tmp_path / f"ball.{suffix}")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", IriftraceWarning)  # glTF declares metres
            part = read_part(tmp_path / f"ball.{suffix}", ReadPart(length_unit="mm"))
        np.testing.assert_allclose(
            part.vertices[part.faces], source.vertices[source.faces], atol=1e-5
        )
        assert part.closed, f"{suffix}: vertices stored several times must be welded"


def test_save_and_read_keep_faces_regions_and_names(tmp_path: Path, box: Path) -> None:
    part = read_part(box)
    save_part(part, tmp_path / "part.ply")
    again = read_part(tmp_path / "part.ply")
    assert again.region_names == part.region_names
    np.testing.assert_array_equal(again.region_of_face, part.region_of_face)
    np.testing.assert_array_equal(again.faces, part.faces)
    np.testing.assert_array_equal(again.vertices, part.vertices.astype(np.float32))
    np.testing.assert_array_equal(again.smooth_group, part.smooth_group)
    foreign = trimesh.load_mesh(tmp_path / "part.ply", process=False)
    np.testing.assert_array_equal(foreign.faces, part.faces)


def test_mitsuba_reads_a_saved_part_as_it_is(
    variant: str, tmp_path: Path, box: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """The same faces in the same order, regions as a mesh attribute, and no line in its log."""
    import mitsuba as mi

    part = read_part(box)
    save_part(part, tmp_path / "part.ply")
    shape = mi.load_dict({"type": "ply", "filename": str(tmp_path / "part.ply")})
    faces = np.array(shape.faces_buffer()).reshape(-1, 3)
    np.testing.assert_array_equal(faces, part.faces)
    regions = np.array(mi.traverse(shape)["face_region"])
    np.testing.assert_array_equal(regions, part.region_of_face)
    assert "WARN" not in "".join(capfd.readouterr())


@pytest.mark.usefixtures("variant")
@pytest.mark.parametrize(("vertices", "corner"), [(65_536, b"ushort"), (65_537, b"int")])
def test_a_saved_part_of_any_size_is_read_as_it_is(
    tmp_path: Path, vertices: int, corner: bytes
) -> None:
    """16 bits name a corner where they can."""
    import mitsuba as mi

    part = part_of_mesh(*_fan(vertices), name="fan")
    path = tmp_path / "part.ply"
    save_part(part, path)
    assert b"property list uchar %s vertex_indices" % corner in path.read_bytes()
    np.testing.assert_array_equal(read_part(path).faces, part.faces)
    shape = mi.load_dict({"type": "ply", "filename": str(path)})
    np.testing.assert_array_equal(np.array(shape.faces_buffer()).reshape(-1, 3), part.faces)


def _fan(vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """A closed double cone with so many vertices."""
    rim = np.arange(vertices - 2)
    angle = 2 * np.pi * rim / len(rim)
    places = np.column_stack((100 * np.cos(angle), 100 * np.sin(angle), np.zeros(len(rim))))
    following = (rim + 1) % len(rim)
    low, high = vertices - 2, vertices - 1
    faces = np.concatenate(
        (
            np.column_stack((rim, following, np.full(len(rim), high))),
            np.column_stack((following, rim, np.full(len(rim), low))),
        )
    )
    return np.vstack((places, [(0, 0, -50)], [(0, 0, 50)])), faces


@pytest.mark.parametrize("binary", [True, False])
def test_regions_of_a_foreign_ply(tmp_path: Path, binary: bool) -> None:
    """Numbers need not be consecutive, and unnamed ones are called by their number."""
    source = trimesh.creation.box(extents=(10, 10, 10))
    numbers = np.repeat([7, 3, -1], 4)
    header = (
        f"ply\nformat {'binary_little_endian' if binary else 'ascii'} 1.0\n"
        "comment region 7 left jaw\ncomment region 3  bore \n"
        "element vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 12\nproperty list uchar int vertex_indices\nproperty int region\nend_header\n"
    )
    path = tmp_path / "jaw.ply"
    if binary:
        rows = np.zeros(12, [("n", "u1"), ("v", "<i4", 3), ("r", "<i4")])
        rows["n"], rows["v"], rows["r"] = 3, source.faces, numbers
        path.write_bytes(header.encode() + source.vertices.astype("<f4").tobytes() + rows.tobytes())
    else:
        lines = [" ".join(map(str, vertex)) for vertex in source.vertices]
        for face, number in zip(source.faces, numbers, strict=True):
            lines.append(f"3 {' '.join(map(str, face))} {number}")
        path.write_text(header + "\n".join(lines) + "\n")
    part = read_part(path)
    assert part.region_names == ("region -1", "bore", "left jaw")
    names = [part.region_names[i] for i in part.region_of_face]
    assert names == ["left jaw"] * 4 + ["bore"] * 4 + ["region -1"] * 4


def test_units_expansion_and_transform_act_in_this_order(box: Path) -> None:
    """10 mm read as 10 cm is 100 mm; 0.1 % growth makes 100.1 mm; then it moves by 5 mm."""
    shift = np.eye(4)
    shift[0, 3] = 5.0
    part = read_part(
        box,
        ReadPart(
            length_unit="cm",
            transform=shift,
            expansion=1e-6,
            reference_temperature=293.15,
            hot_temperature=1293.15,
        ),
    )
    np.testing.assert_allclose(part.bounds[:, 0], [5 - 50.05, 5 + 50.05], rtol=1e-7)
    assert part.length_unit == "cm"


@given(angles=st.tuples(*[st.floats(-3, 3)] * 3), mirror=st.booleans())
def test_moving_keeps_areas_and_outward_normals(
    angles: tuple[float, float, float], mirror: bool
) -> None:
    """A rigid motion, also a mirroring one, changes neither area nor inside and outside."""
    part = read_part(CYLINDER)
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler("xyz", angles).as_matrix() @ np.diag(
        [-1.0 if mirror else 1.0, 1, 1]
    )
    matrix[:3, 3] = (3, -7, 11)
    moved = part.transformed(matrix)
    np.testing.assert_allclose(moved.face_areas, part.face_areas, rtol=1e-9)
    np.testing.assert_allclose(moved.face_normals, part.face_normals @ matrix[:3, :3].T, atol=1e-9)
    np.testing.assert_allclose(moved.centre, moved.vertices[moved.faces].mean((0, 1)), atol=0.5)


def test_rotation_names_the_heads_in_the_world(tmp_path: Path) -> None:
    trimesh.creation.cylinder(radius=10, height=40).export(tmp_path / "c.stl")
    upright = read_part(tmp_path / "c.stl")
    assert set(upright.region_names) == {"lateral", "head -z", "head +z"}
    lie = np.eye(4)
    lie[:3, :3] = Rotation.from_euler("y", 90, degrees=True).as_matrix()
    assert set(read_part(tmp_path / "c.stl", ReadPart(transform=lie)).region_names) == {
        "lateral",
        "head -x",
        "head +x",
    }


def test_inside_out_and_mixed_faces_are_repaired_with_a_warning(tmp_path: Path) -> None:
    good = trimesh.creation.icosphere(subdivisions=2, radius=20)
    volume = 0.999 * good.volume
    turned = good.faces[:, ::-1]
    mixed = good.faces.copy()
    mixed[::3] = mixed[::3, ::-1]
    for faces, message in ((turned, "inward-facing normals"), (mixed, "face the other way")):
        trimesh.Trimesh(good.vertices, faces, process=False).export(tmp_path / "ball.ply")
        with pytest.warns(IriftraceWarning, match=message):
            part = read_part(tmp_path / "ball.ply")
        a, b, c = part.vertices[part.faces].transpose(1, 0, 2)
        assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 > volume


def test_two_sided_strip_passes_and_one_sided_strip_is_refused(tmp_path: Path) -> None:
    """A Moebius strip has no outside; the same strip with a full twist has two sides."""
    count, width = 40, 5.0

    def strip(half_twists: int) -> trimesh.Trimesh:
        turn = np.arange(count) * 2 * np.pi / count
        lean = turn * half_twists / 2
        rim = [
            np.stack(
                (
                    (30 + side * width * np.cos(lean)) * np.cos(turn),
                    (30 + side * width * np.cos(lean)) * np.sin(turn),
                    side * width * np.sin(lean),
                ),
                axis=1,
            )
            for side in (-1, 1)
        ]
        faces = []
        for i in range(count):
            a, b = i, i + count
            c, d = (i + 1) % count, (i + 1) % count + count
            if i == count - 1 and half_twists % 2:
                c, d = d, c
            faces += [(a, b, c), (b, d, c)]
        return trimesh.Trimesh(np.concatenate(rim), faces, process=False)

    strip(2).export(tmp_path / "full.ply")
    with pytest.warns(IriftraceWarning, match="not closed"):
        assert not read_part(tmp_path / "full.ply").closed
    strip(1).export(tmp_path / "half.ply")
    with pytest.raises(InputError, match="one-sided"):
        read_part(tmp_path / "half.ply")


def test_open_surface_is_legitimate_but_says_what_suffers(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=20)
    open_ball = trimesh.Trimesh(ball.vertices, ball.faces[1:], process=False)
    open_ball.export(tmp_path / "scan.ply")
    with pytest.warns(IriftraceWarning, match=r"3 open edges.*coverage") as caught:
        part = read_part(tmp_path / "scan.ply")
    assert len(caught) == 1
    assert not part.closed
    assert len(part.faces) == len(ball.faces) - 1


def test_doubtful_units_are_named(tmp_path: Path, box: Path) -> None:
    trimesh.creation.box(extents=(0.01, 0.02, 0.03)).export(tmp_path / "metres.stl")
    with pytest.warns(IriftraceWarning, match=r"0\.0374 mm across") as caught:
        read_part(tmp_path / "metres.stl")
    assert [one.message.argument for one in caught] == ["length_unit"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert read_part(tmp_path / "metres.stl", ReadPart(length_unit="m")).bounds[
            1, 0
        ] == pytest.approx(5)


@pytest.mark.parametrize("suffix", ["glb", "gltf"])
def test_gltf_is_in_metres_by_its_standard(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"box.{suffix}"
    scene = trimesh.Scene(trimesh.creation.box(extents=(0.01, 0.02, 0.03)))
    if suffix == "glb":
        scene.export(path)
    else:
        for name, data in trimesh.exchange.gltf.export_gltf(scene).items():
            (tmp_path / name.replace("model", "box")).write_bytes(data)
    for unit in (None, "m", "Meters"):
        part = read_part(path, ReadPart(length_unit=unit))
        np.testing.assert_allclose(np.ptp(part.bounds, axis=0), (10, 20, 30), rtol=1e-6)
        assert part.length_unit == "m"
    with pytest.warns(IriftraceWarning, match="declares its unit as m but is read as mm"):
        assert read_part(path, ReadPart(length_unit="mm")).length_unit == "mm"


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("name", ["inch", "in"])
def test_an_stl_states_its_unit_in_its_header(tmp_path: Path, binary: bool, name: str) -> None:
    mesh = trimesh.creation.box((2.0, 3.0, 4.0))
    path = tmp_path / "box.stl"
    content = mesh.export(file_type="stl" if binary else "stl_ascii")
    header = f"solid UNITS={name}".encode()
    if binary:
        path.write_bytes(header.ljust(80) + content[80:])
    else:
        path.write_bytes(header + b"\n" + content.encode().split(b"\n", 1)[1])
    part = read_part(path)
    assert part.length_unit == "inch"
    np.testing.assert_allclose(np.ptp(part.bounds, axis=0), (50.8, 76.2, 101.6), rtol=1e-6)


@pytest.mark.parametrize("remark", ["File units = meters", "Units: m"])
def test_an_obj_states_its_unit_in_a_comment(tmp_path: Path, remark: str) -> None:
    text = trimesh.exchange.obj.export_obj(trimesh.creation.box(extents=(0.01, 0.02, 0.03)))
    (tmp_path / "box.obj").write_text(f"# {remark}\n{text}")
    part = read_part(tmp_path / "box.obj")
    assert part.length_unit == "m"
    np.testing.assert_allclose(np.ptp(part.bounds, axis=0), (10, 20, 30), rtol=1e-6)


def _ply(path: Path, vertices: list[tuple[float, ...]], faces: list[tuple[int, ...]]) -> Path:
    lines = ["ply", "format ascii 1.0", f"element vertex {len(vertices)}"]
    lines += [f"property float {axis}" for axis in "xyz"]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    lines += [" ".join(map(str, vertex)) for vertex in vertices]
    lines += [f"{len(face)} {' '.join(map(str, face))}" for face in faces]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_unusable_files_are_refused(tmp_path: Path) -> None:
    triangle = [(0.0, 0, 0), (10.0, 0, 0), (0, 10.0, 0)]
    line = [(0.0, 0, 0), (10.0, 0, 0), (20.0, 0, 0)]
    nan = [(float("nan"), 0, 0), (10.0, 0, 0), (0, 10.0, 0)]
    cases = {
        "There is no file": tmp_path / "missing.stl",
        "cannot be read": _ply(tmp_path / "part.docx", triangle, [(0, 1, 2)]),
        "no triangles": _ply(tmp_path / "points.ply", triangle, []),
        "NaN": _ply(tmp_path / "nan.ply", nan, [(0, 1, 2)]),
        "no area": _ply(tmp_path / "line.ply", line, [(0, 1, 2)]),
    }
    (tmp_path / "text.stl").write_text("hello")
    (tmp_path / "cut.ply").write_bytes(CYLINDER.read_bytes()[:5000])
    cases[r"text.stl cannot be read \(it has no triangles"] = tmp_path / "text.stl"
    cases["cut.ply cannot be read"] = tmp_path / "cut.ply"
    cases[r"cannot be read \(a triangle names vertex 7, but there are 3"] = _ply(
        tmp_path / "far.ply", triangle, [(0, 1, 7)]
    )
    cases[r"cannot be read \(a triangle names vertex -1"] = _ply(
        tmp_path / "below.ply", triangle, [(0, -1, 2)]
    )
    save_part(read_part(CYLINDER), tmp_path / "region.ply")
    whole = (tmp_path / "region.ply").read_bytes()
    (tmp_path / "region.ply").write_bytes(whole[:-4] + np.float32("nan").tobytes())
    cases[r"region.ply cannot be read \(a triangle's region"] = tmp_path / "region.ply"
    for message, path in cases.items():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", IriftraceWarning)
            with pytest.raises(InputError, match=message):
                read_part(path)


def test_unusable_arguments_are_refused(box: Path) -> None:
    with pytest.raises(InputError, match="hot temperature"):
        read_part(box, ReadPart(expansion=14e-6))
    with pytest.raises(InputError, match="steel"):
        read_part(box, ReadPart(expansion=14.0, hot_temperature=1373.15))
    with pytest.raises(InputError, match="region angle"):
        read_part(box, ReadPart(region_angle=0))
    with pytest.raises(InputError, match="invertible"):
        read_part(box, ReadPart(transform=np.diag([1.0, 1, 0, 1])))
    with pytest.raises(InputError, match="4 x 4"):
        read_part(box, ReadPart(transform=np.eye(3)))
    with pytest.raises(InputError, match="does not exist"):
        save_part(read_part(box), box.parent / "nowhere" / "part.ply")


def test_more_faces_than_the_exr_can_number_are_refused(
    box: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("iriftrace.part.part.MOST_FACES", 11)
    with pytest.raises(InputError, match="12 triangles, but at most 11"):
        read_part(box)


def test_parts_are_immutable() -> None:
    part: Part = read_part(CYLINDER)
    with pytest.raises(AttributeError):
        part.closed = False  # type: ignore[misc]


def test_decimal_commas_are_named(tmp_path: Path) -> None:
    text = trimesh.exchange.stl.export_stl_ascii(trimesh.creation.box((2, 3, 4)))
    (tmp_path / "a.stl").write_text(text.replace(".", ","))
    with pytest.raises(InputError, match="has decimal commas"):
        read_part(tmp_path / "a.stl")
