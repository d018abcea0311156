"""Clouds in .ply: units in comments, names in capitals, files that were cut."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from iriftrace.clouds.read import read_cloud
from iriftrace.core.errors import InputError

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
    with pytest.raises(InputError, match="states 21 vertices, and it has 20"):
        read_cloud(tmp_path / "a.ply")


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
