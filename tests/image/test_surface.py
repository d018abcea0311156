"""Points on the part for other programs: the numbers are those of the EXR."""

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
import trimesh
from attrs import evolve

from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.image.aov_image import AovImage, Status
from iriftrace.io.exr import read_exr, read_part_of
from iriftrace.io.surface import write_surface
from iriftrace.scenes import folder_of

VECTOR = ("displacement.X", "displacement.Y", "displacement.Z")


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> AovImage:
    """The bundled cylinder, with hits in focus, hits out of focus and misses."""
    exr = tmp_path_factory.mktemp("surface") / "out.exr"
    words = [
        "render",
        str(folder_of("cylinder_paper") / "scene.xml"),
        "-o",
        str(exr),
        "--no-figures",
    ]
    assert main([*words, "-D", "scale=0.05", "--surface", str(exr.with_suffix(".vtp"))]) == 0
    assert exr.with_suffix(".vtp").is_file()
    return read_exr(exr)


def assert_points_are_the_hits(points: np.ndarray, image: AovImage, hit: np.ndarray) -> None:
    """To the rounding of the EXR's float32; and on the part to that of float64."""
    assert points.dtype == np.float64
    straight = image.vector("straight", hit)
    np.testing.assert_allclose(points, straight, rtol=0, atol=np.spacing(np.float32(128.0)))
    face = image.channels["part.face"][hit].astype(int) - 1
    height = np.einsum("ij,ij->i", points, read_part_of(image).face_normals[face])
    np.testing.assert_allclose(height, read_part_of(image).face_offsets[face], rtol=0, atol=1e-11)


def test_vtp_has_the_numbers_of_the_exr(image: AovImage, tmp_path: Path) -> None:
    write_surface(tmp_path / "out.vtp", image, read_part_of(image))
    cloud = pv.read(tmp_path / "out.vtp")
    hit = image.channels["part.face"] > 0
    assert {Status.GOOD, Status.OUT_OF_FOCUS} <= set(image.status[hit].tolist())
    assert_points_are_the_hits(np.asarray(cloud.points), image, hit)
    moved = image.vector("displacement", hit)
    assert np.linalg.norm(moved, axis=1).max() > 1e-3
    np.testing.assert_array_equal(cloud.point_data["displacement"], moved)
    array = cloud.GetPointData().GetAbstractArray("displacement")
    assert [array.GetComponentName(k) for k in range(3)] == ["X", "Y", "Z"]
    scalars = {
        name for name in image.channels if not name.startswith(("straight.", "refracted.", *VECTOR))
    }
    assert set(cloud.point_data.keys()) == {"displacement", *scalars}
    for name in scalars:
        np.testing.assert_array_equal(cloud.point_data[name], image.channels[name][hit])
    remarks = list(cloud.field_data["units and assumptions"])
    assert "displacement.X: mm" in remarks
    assert "incidence.angle: rad" in remarks
    assert any("OpenFOAM" in remark for remark in remarks)


def test_a_field_may_have_any_name(image: AovImage, tmp_path: Path) -> None:
    """Texts of VTK are ASCII."""
    named = evolve(image, header={**image.header, "assumptions": {"field": "Pr\u00fcf.vtu"}})
    write_surface(tmp_path / "out.vtp", named, read_part_of(named))
    assert (
        pv.read(tmp_path / "out.vtp").field_data["units and assumptions"][-1] == "field: Pr?f.vtu"
    )


def test_ply_has_the_numbers_of_the_exr(image: AovImage, tmp_path: Path) -> None:
    write_surface(tmp_path / "out.ply", image, read_part_of(image))
    hit = image.channels["part.face"] > 0
    with (tmp_path / "out.ply").open("rb") as file:
        cloud = trimesh.load(file, file_type="ply", process=False)
    columns = cloud.metadata["_ply_raw"]["vertex"]["data"]
    points = np.stack([columns[axis] for axis in "xyz"], axis=1)
    assert_points_are_the_hits(points, image, hit)
    for name in (*VECTOR, "displacement.norm", "shift.px.X", "incidence.angle", "status.code"):
        np.testing.assert_array_equal(columns[name], image.channels[name][hit])
    head = (tmp_path / "out.ply").read_bytes()[:4000].decode("ascii", "replace")
    assert "comment shift.px.X: px\n" in head


def test_other_endings_are_refused(
    image: AovImage, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(InputError, match=r"give one that ends in \.vtp, \.ply"):
        write_surface(tmp_path / "out.csv", image, read_part_of(image))
    scene = str(folder_of("cylinder") / "scene.xml")
    assert main(["render", scene, "-o", str(tmp_path / "a.exr"), "--surface", "out.csv"]) == 2
    assert "must end in .vtp" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
