"""Points that were not measured, and that numbers such as -9999 stand for."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from iriftrace.clouds.read import read_cloud
from iriftrace.core.errors import InputError, IriftraceWarning

POINTS = np.random.default_rng(1).uniform((-20, 5, 600), (20, 30, 640), (50, 3))


def read(folder: Path, rows: np.ndarray) -> np.ndarray:
    np.savetxt(folder / "cloud.xyz", rows, "%.17g")
    return read_cloud(folder / "cloud.xyz").points


@pytest.mark.parametrize(
    ("axes", "mark", "said"),
    [
        ([0, 1, 2], -9999, "x = -9999"),
        ([2], -999, "z = -999"),
        ([2], 99999, "z = 99999"),
        ([1], -1e10, "y = -1e\\+10"),
        ([0, 1, 2], -1, "z = -1"),
    ],
)
def test_marks_are_left_out_and_counted(
    tmp_path: Path, axes: list[int], mark: float, said: str
) -> None:
    rows = np.concatenate((POINTS, POINTS[:4]))
    rows[-4:, axes] = mark
    with pytest.warns(IriftraceWarning, match=f"4 of {len(rows)} points in .* at {said}, far from"):
        points = read(tmp_path, rows)
    np.testing.assert_array_equal(points, POINTS)


@pytest.mark.parametrize("place", [-9999.0, 100.0])
def test_points_far_away_are_no_marks(tmp_path: Path, place: float) -> None:
    """Two of them, and a plane that is far from small parts."""
    rows = POINTS.copy()
    rows[: 2 if place < 0.0 else 10, 2] = place
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(read(tmp_path, rows), rows)


def test_a_cloud_of_marks_alone_is_refused_by_no_guess(tmp_path: Path) -> None:
    rows = np.full((5, 3), -9999.0)
    with pytest.warns(IriftraceWarning, match="rounded"):
        np.testing.assert_array_equal(read(tmp_path, rows), rows)


def test_lines_between_points_are_named(tmp_path: Path) -> None:
    text = "".join(f"{x} {y} {z}\n" for x, y, z in POINTS)
    path = tmp_path / "cloud.xyz"
    for line in ("Scan 2", "# Scan 2", "x y z"):
        path.write_text(f"x y z\n{text}{line}\n{text}")
        with pytest.warns(IriftraceWarning, match=f"none, such as '{line}', and are left out"):
            assert len(read_cloud(path).points) == 2 * len(POINTS)
    path.write_text(f"x y z\n{text}\n\n{text}# end\n")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(read_cloud(path).points) == 2 * len(POINTS)


def test_a_binary_pcd_with_more_points_than_stated_is_refused(tmp_path: Path) -> None:
    head = "FIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {}\nHEIGHT 1\nDATA binary\n"
    path = tmp_path / "cloud.pcd"
    path.write_bytes(head.format(50).encode() + POINTS.tobytes() + b"\n")
    np.testing.assert_array_equal(read_cloud(path).points, POINTS)
    path.write_bytes(head.format(40).encode() + POINTS.tobytes())
    with pytest.raises(InputError, match="states 40 points of 24 bytes and is shorter or longer"):
        read_cloud(path)
