"""PLY files with a texture: their vertices are those of the file, whether the picture is there."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from iriftrace.io.clouds import read_cloud
from iriftrace.io.part_files import read_part

BOX = trimesh.creation.box(extents=(40.12345, 30.12345, 20.12345))

HEADER = f"""ply
format ascii 1.0
comment TextureFile missing.png
element vertex {len(BOX.vertices)}
property float x
property float y
property float z
property float quality
element face {len(BOX.faces)}
property list uchar int vertex_indices
property list uchar float texcoord
end_header
"""


def test_texture_coordinates_of_faces_double_no_vertices(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    rows = [f"{x} {y} {z} {k}" for k, (x, y, z) in enumerate(BOX.vertices.tolist())]
    rows += [f"3 {a} {b} {c} 6 0.{a} 0 0.{b} 1 1 0.{c}" for a, b, c in BOX.faces.tolist()]
    path = tmp_path / "scan.ply"
    path.write_text(HEADER + "\n".join(rows) + "\n")
    cloud = read_cloud(path)
    np.testing.assert_allclose(cloud.rows, BOX.vertices, rtol=1e-6)
    assert cloud.columns["quality"].tolist() == list(range(len(BOX.vertices)))
    assert len(read_part(path).vertices) == len(BOX.vertices)
    assert "Traceback" not in capfd.readouterr().err
