"""Parts with fewer or more triangles: how far they moved is known of spheres, regions stay."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.io.part_files import read_part
from iriftrace.part.part import part_of_mesh
from iriftrace.part.standards import cylinder
from iriftrace.part.tessellation import decimate_part, subdivide_part


def test_the_stated_deviation_is_that_of_the_surfaces() -> None:
    """Of a fine sphere: the radius less that of the centres and corners of the coarse one."""
    fine = trimesh.creation.icosphere(subdivisions=5, radius=20.0)
    part = part_of_mesh(fine.vertices, fine.faces, name="sphere")
    found, deviation_mm = decimate_part(part, 2000)
    assert len(found.faces) == pytest.approx(2000, rel=0.01)
    assert found.closed
    centres = np.linalg.norm(found.face_centres, axis=1)
    assert deviation_mm.max() == pytest.approx(20.0 - centres.min(), rel=0.15)
    assert found.volume == pytest.approx(part.volume, rel=0.01)


def test_regions_keep_their_names_and_areas() -> None:
    part = cylinder()
    found, _ = decimate_part(part, 800)
    assert found.region_names == part.region_names
    np.testing.assert_allclose(found.region_areas, part.region_areas, rtol=0.02)


def test_more_triangles_than_there_are_is_refused() -> None:
    with pytest.raises(InputError, match="give a number from 4 to one below"):
        decimate_part(cylinder(), 10**6)


def test_subdivided_parts_are_the_same_surface() -> None:
    """Closed, without a corner in the middle of an edge, and with the regions' areas."""
    part = cylinder()
    found = subdivide_part(part, 5.0)
    corners = found.vertices[found.faces]
    assert np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max() <= 5.0
    assert len(found.faces) > 2 * len(part.faces)
    assert found.closed
    assert found.region_names == part.region_names
    np.testing.assert_allclose(found.region_areas, part.region_areas, rtol=1e-9)
    np.testing.assert_allclose(part.surface.distance(found.vertices), 0.0, atol=1e-6)


def test_slivers_are_cut_across_and_not_along() -> None:
    """A prism of 100 mm by 1 mm: 32 pieces along each edge, two triangles between two of them."""
    angles = 2.0 * np.pi * np.arange(200) / 200
    outline = np.stack((np.cos(angles), np.sin(angles)), axis=1) / (2.0 * np.sin(np.pi / 200))
    prism = trimesh.creation.extrude_triangulation(
        np.vstack((outline, (0.0, 0.0))),
        np.array([(k, (k + 1) % 200, 200) for k in range(200)]),
        100.0,
    )
    part = part_of_mesh(prism.vertices, prism.faces, name="prism")
    found = subdivide_part(part, 4.0)
    assert found.closed
    assert found.volume == pytest.approx(part.volume, rel=1e-12)
    lateral = np.abs(found.face_normals[:, 2]) < 0.5
    assert lateral.sum() == 200 * 32 * 2
    # With the heads, whose fans are slivers too; VTK's adaptive subdivision gives 108,800.
    assert len(found.faces) < 25_000


def test_triangles_without_area_are_left_out() -> None:
    """Two of them: corners at one place, and one corner twice."""
    box = trimesh.creation.box((20.0, 20.0, 20.0))
    vertices = np.vstack((box.vertices, box.vertices[:1]))
    faces = np.vstack((box.faces, [[0, 8, 1], [2, 2, 3]]))
    part = part_of_mesh(vertices, faces, name="box")
    found = subdivide_part(part, 5.0)
    assert found.closed
    assert found.area == pytest.approx(part.area)
    assert len(found.region_names) == 6


@pytest.mark.parametrize(("edge", "why"), [(0.0, "positive length"), (1e-3, "give a longer edge")])
def test_impossible_edges_are_refused(edge: float, why: str) -> None:
    with pytest.raises(InputError, match=why):
        subdivide_part(cylinder(), edge)


def test_the_command_says_what_longer_edges_give(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    box, fine = tmp_path / "box.stl", tmp_path / "fine.ply"
    trimesh.creation.box((20.0, 20.0, 20.0)).export(box)
    assert main(["part", "subdivide", str(box), "-o", str(fine), "--edge=5 mm"]) == 0
    count = len(subdivide_part(read_part(box), 10.0).faces)
    said = f"12 triangles before, {len(read_part(fine).faces) / 12:.3g} times as many now; --edge"
    assert f'{said} "10 mm" gives {count}.' in " ".join(capsys.readouterr().out.split())


def test_the_command_says_how_far_the_surface_moved(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fine, coarse = tmp_path / "fine.stl", tmp_path / "coarse.ply"
    trimesh.creation.icosphere(subdivisions=4, radius=20.0).export(fine)
    assert main(["part", "decimate", str(fine), "-o", str(coarse), "--faces=600"]) == 0
    assert "um apart, at 95 % of the places" in " ".join(capsys.readouterr().out.split())
    assert len(read_part(coarse).faces) == pytest.approx(600, rel=0.01)
    assert main(["part", "decimate", str(fine), "-o", str(tmp_path / "c.obj"), "--faces=600"]) == 2
