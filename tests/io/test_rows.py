"""Which rows of a table are points, and what their cells and the remarks above them say."""

import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from iriftrace.io.clouds import read_cloud
from iriftrace.core.errors import InputError, IriftraceWarning

POINTS = np.random.default_rng(1).uniform(-100, 100, (20, 10))
"""Coordinates in the first three columns, other quantities in the rest."""


@pytest.mark.parametrize(
    ("text", "warned"),
    [
        ("{0:.8E} {1:.8E} {2:.8E}\n", ""),
        ("P{3};{0};{1};{2}\n", "columns of words or dates, which are left out: Name"),
        ('"{0}","{1}","{2}","P, {3}"\n', "left out: Name"),
        ("{3},{0},{1},{2},2024-01-01T00:00:0{3}Z\n", "left out: Name"),
    ],
)
def test_exponents_of_fortran_and_cells_of_words(tmp_path: Path, text: str, warned: str) -> None:
    points = np.random.default_rng(1).uniform(-50.0, 50.0, (9, 3)).round(6)
    rows = "".join(text.format(*row, number) for number, row in enumerate(points))
    header = {"P": "Name;x;y;z\n", '"': "x,y,z,Name\n", "{3}": "id,x,y,z,Name\n"}
    names = next((line for start, line in header.items() if text.startswith(start)), "")
    file = tmp_path / "cloud.csv"
    file.write_text(names + (rows if names else rows.replace("E", "D")) + "\x1a")
    if warned:
        with pytest.warns(IriftraceWarning, match=warned):
            cloud = read_cloud(file)
    else:
        cloud = read_cloud(file)
    assert_allclose(cloud.points, points, atol=1e-6)
    assert "Name" not in cloud.columns


def test_units_and_scans_of_a_table(tmp_path: Path) -> None:
    """Micrometres of a Windows program; several units, and several scans in one file."""
    file = tmp_path / "cloud.txt"
    file.write_bytes("# Prüfling\nx (µm)\ty (µm)\tz (µm)\n1000\t2000\t3000.5\n".encode("cp1252"))
    assert_allclose(read_cloud(file).points, [[1.0, 2.0, 3.0005]])
    file.write_text("X [mm],Y [mm],Z [m]\n1.0001,2.0001,3.0001\n")
    with pytest.raises(InputError, match=r"different units \(m, mm\)"):
        read_cloud(file)
    scans = tmp_path / "scans.pts"
    scans.write_text("2\n1.5 2 3\n4 5 6\n2\n7 8 9\n1 2 3\n")
    with pytest.raises(InputError, match="several scans, one after the other"):
        read_cloud(scans)
    scans.write_text("[m]\n# x y z\n0.0123456 2 3\n4 5 6\n# x y z\n7 8 9\n")
    with pytest.warns(
        IriftraceWarning, match="between its points that are none, such as '# x y z'"
    ):
        assert_allclose(read_cloud(scans).points[0], [12.3456, 2000, 3000])


@pytest.mark.parametrize("text", ["1.234;12,5;3,5\n4,5;5,5;6,5\n", "1,5;2;3\n1.005;2;3\n"])
def test_points_and_commas_in_numbers_are_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "cloud.csv").write_text(f"x;y;z\n{text}")
    with pytest.raises(InputError, match="have points and commas, of which either may be the dec"):
        read_cloud(tmp_path / "cloud.csv")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("# Scale factor 0.001", "which is not applied"),
        ("# Global shift: -500 0 0", "which is not applied"),
        ("Unit system: MKS", "of which no unit of length is read"),
        ("units: mm/10", "of which no unit of length is read"),
        ("# Unité: mètre", "of which no unit of length is read"),
        ("Nominal", "above its columns"),
    ],
)
def test_remarks_that_are_not_applied_are_warned_of(tmp_path: Path, line: str, words: str) -> None:
    rows = "\n".join(" ".join(map(repr, row)) for row in POINTS[:, :3].tolist())
    (tmp_path / "cloud.txt").write_text(f"{line}\n{rows}", encoding="utf-8")
    with pytest.warns(IriftraceWarning, match=f"{re.escape(line)}', {words}|{words}"):
        read_cloud(tmp_path / "cloud.txt")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (",0,1,2\n0,{}\n1,{}\n2,{}\n", "counts the rows"),
        ("0,1,2\n{}\n{}\n{}\n", "numbers the columns from 0, and is left out"),
        ("1,2,3\n{}\n{}\n{}\n", "numbers the columns from 1, and is left out"),
        ("P1,{}\nP2,{}\nP3,{}\n", "columns of words or dates, which are left out: column_1"),
        ("x,y,z\n{}\n-,-,-\n{}\n{}\n", "1 of 4 points .* are not finite"),
        ("x,y,z\n{}\n3.402823e38,0,0\n{}\n{}\n", "1 of 4 points .* are not finite"),
    ],
)
def test_rows_of_pandas_and_words_are_no_points(tmp_path: Path, text: str, words: str) -> None:
    points = POINTS[:3, :3]
    rows = [",".join(map(repr, row)) for row in points.tolist()]
    (tmp_path / "cloud.csv").write_text(text.format(*rows))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            np.testing.assert_array_equal(read_cloud(tmp_path / "cloud.csv").points, points)
        except InputError as error:
            said.append(error)  # type: ignore[arg-type]
    assert re.search(words, " ".join(str(getattr(one, "message", one)) for one in said))


def test_a_point_in_each_column_is_refused(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "cloud.txt", POINTS[:, :3].T)
    with pytest.raises(InputError, match=r"has 3 rows of 20 numbers, .* transpose it"):
        read_cloud(tmp_path / "cloud.txt")


def test_pixels_are_those_of_the_measured_points(tmp_path: Path) -> None:
    """In the columns that `iriftrace measure` writes; both, or none."""
    file = tmp_path / "cloud.txt"
    rows = "1.1111 2 3 40 50\nnan nan nan 41 50\n4.1111 5 6 42.5 51\n"
    file.write_text(f"x y z pixel_u pixel_v\n{rows}")
    with pytest.warns(IriftraceWarning, match="1 of 3 points"):
        pixels = read_cloud(file).pixels
    np.testing.assert_array_equal(pixels, [(40, 50), (42.5, 51)])
    file.write_text("x y z pixel_u quality\n1.1111 2 3 40 50\n")
    assert read_cloud(file).pixels is None
