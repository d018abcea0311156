"""Clouds in .ply: units in comments, names in capitals, files that were cut."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from iriftrace.core.errors import InputError
from iriftrace.io.clouds import read_cloud

POINTS = np.random.default_rng(1).uniform(-100, 100, (20, 3))


@pytest.mark.parametrize(("remark", "scale"), [("unit: m", 1e-3), ("Units = inches", 1 / 25.4)])
def test_a_ply_states_its_unit_in_a_comment(tmp_path: Path, remark: str, scale: float) -> None:
    names = "".join(f"property double {axis}\n" for axis in "xyz")
    header = f"ply\nformat ascii 1.0\ncomment {remark}\nelement vertex 20\n{names}end_header"
    np.savetxt(tmp_path / "a.ply", POINTS * scale, "%.17g", header=header, comments="")
    assert_allclose(read_cloud(tmp_path / "a.ply").points, POINTS)
    with pytest.raises(InputError, match="states its coordinates in"):
        read_cloud(tmp_path / "a.ply", length_unit="mm")


def test_a_ply_that_was_cut_is_refused(tmp_path: Path) -> None:
    names = "".join(f"property double {axis}\n" for axis in "xyz")
    header = f"ply\nformat ascii 1.0\nelement vertex 21\n{names}end_header"
    np.savetxt(tmp_path / "a.ply", POINTS, header=header, comments="")
    with pytest.raises(InputError, match="states 21 rows, and it has 20"):
        read_cloud(tmp_path / "a.ply")


@pytest.mark.parametrize("vertices", [19, 22])
def test_a_ply_of_text_has_as_many_rows_as_its_header_states(tmp_path: Path, vertices: int) -> None:
    """Rows too many were left out, and faces read as points, from the beginning of the file."""
    names = "".join(f"property double {axis}\n" for axis in "xyz")
    faces = "element face 2\nproperty list uchar int vertex_indices\n"
    path = tmp_path / "a.ply"
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in POINTS) + "3 0 1 2\n3 0 1 2\n\n"
    head = f"ply\nformat ascii 1.0\nelement vertex 20\n{names}{faces}end_header\n"
    path.write_text(head + rows)
    assert len(read_cloud(path).points) == 20
    path.write_text(head.replace("vertex 20", f"vertex {vertices}") + rows)
    with pytest.raises(InputError, match=f"states {vertices + 2} rows, and it has 22"):
        read_cloud(path)


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian"])
def test_a_ply_with_coordinates_in_capitals_is_read(tmp_path: Path, kind: str) -> None:
    rows = POINTS.astype("<f8")
    names = "".join(f"property double {axis}\n" for axis in "XYZ")
    comment = "comment C:\\Prüfung"
    header = f"ply\nformat {kind} 1.0\n{comment}\nelement vertex {len(rows)}\n{names}end_header\n"
    text = "\n".join(" ".join(f"{one:.17g}" for one in row) for row in rows).encode()
    data = text if kind == "ascii" else rows.tobytes()
    (tmp_path / "a.ply").write_bytes(header.encode("cp1252") + data)
    assert_allclose(read_cloud(tmp_path / "a.ply").points, rows)
