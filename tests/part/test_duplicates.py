"""Triangles that lie on others are left out of a part, with a warning that counts them."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from iriftrace.core.errors import IriftraceWarning
from iriftrace.io.part_files import read_part
from iriftrace.part.part import Part

BOX = trimesh.creation.box(extents=(40, 30, 20))
SIDES = {"plane -x", "plane +x", "plane -y", "plane +y", "plane -z", "plane +z"}
rng = np.random.default_rng(5)

TWICE = {
    "copied": np.concatenate((BOX.faces, BOX.faces)),
    "copied three times": np.concatenate((BOX.faces,) * 3),
    "copied in part": np.concatenate((BOX.faces, BOX.faces[3:7])),
    "each next to its copy": np.repeat(BOX.faces, 2, axis=0),
    "shuffled": rng.permutation(np.concatenate((BOX.faces, np.roll(BOX.faces, 1, axis=1)))),
    "both sides": np.concatenate((BOX.faces, BOX.faces[:, ::-1])),
    "both sides in part": np.concatenate((BOX.faces, BOX.faces[2:5, ::-1])),
    "copied and both sides": np.concatenate((BOX.faces, BOX.faces, BOX.faces[:, ::-1])),
}


def read(path: Path, count: int) -> Part:
    """The part, read with a warning of so many triangles."""
    with pytest.warns(IriftraceWarning, match=f"{count} triangles that lie exactly on others"):
        return read_part(path)


@pytest.mark.parametrize("suffix", ["stl", "ply", "obj"])
@pytest.mark.parametrize("name", TWICE)
def test_a_box_whose_triangles_are_there_twice_is_the_box(
    tmp_path: Path, name: str, suffix: str
) -> None:
    faces = TWICE[name]
    path = tmp_path / f"box.{suffix}"
    trimesh.Trimesh(BOX.vertices, faces, process=False).export(path)
    part = read(path, len(faces) - len(BOX.faces))
    assert part.closed
    assert part.volume == pytest.approx(24_000.0)
    assert part.area == pytest.approx(5200.0)
    assert set(part.region_names) == SIDES


def test_the_wall_between_two_bodies_that_touch_is_no_surface(tmp_path: Path) -> None:
    # The mirror image has the same diagonal on its side of the wall.
    mirrored = trimesh.Trimesh(BOX.vertices * (-1, 1, 1) + (40, 0, 0), BOX.faces[:, ::-1])
    trimesh.util.concatenate([BOX, mirrored]).export(tmp_path / "two.stl")
    part = read(tmp_path / "two.stl", 4)
    assert part.closed
    assert part.volume == pytest.approx(48_000.0)
    assert part.area == pytest.approx(2 * (80 * 30 + 80 * 20 + 30 * 20))
    assert np.abs(part.face_centres[:, 0] - 20.0).min() > 1.0


def test_regions_follow_the_triangles_that_stay(tmp_path: Path) -> None:
    path = tmp_path / "box.ply"
    lines = ["ply", "format ascii 1.0", "comment region 0 lower", "comment region 1 upper"]
    lines += ["element vertex 8", *(f"property float {axis}" for axis in "xyz")]
    lines += ["element face 24", "property list uchar int vertex_indices", "property int region"]
    lines += ["end_header", *(" ".join(map(str, vertex)) for vertex in BOX.vertices)]
    upper = (BOX.triangles_center[:, 2] > 0).astype(int)
    rows = [f"3 {a} {b} {c} {r}" for (a, b, c), r in zip(BOX.faces, upper, strict=True)]
    path.write_text("\n".join([*lines, *(row for row in rows for _ in range(2)), ""]))
    part = read(path, 12)
    np.testing.assert_array_equal(part.region_of_face, upper)
