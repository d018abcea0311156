"""Numbers in text files that are not points: statistics, other formats, heights, nominal values."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from iriftrace.io.clouds import read_cloud
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.geometry.ply import write_ply_points

POINTS = np.random.default_rng(3).uniform(-50, 50, (20, 3)).round(6)


def rows(*columns: object, mark: str = ",") -> str:
    """A row for each point, with further columns before it."""
    return "".join(
        mark.join((*map(str, first), *(f"{value:.6f}" for value in point))) + "\n"
        for *first, point in zip(*columns, POINTS, strict=True)
    )


@pytest.mark.parametrize("mark", [",", ";", "\t", " "])
@pytest.mark.parametrize("words", [("Mean", "Std. dev."), ("Mittelwert:", "Max"), ("avg", "min")])
def test_rows_of_statistics_are_not_points(mark: str, words: tuple[str, str], tmp_path: Path):
    foot = "\n".join(mark.join((word, "1.5", "2.5", "3.5")) for word in words)
    for header, table in (
        (("x", "y", "z"), rows(mark=mark)),
        (("nr", "x", "y", "z"), rows(range(len(POINTS)), mark=mark)),
    ):
        (tmp_path / "a.txt").write_text(f"{mark.join(header)}\n{table}\n{foot}\n")
        with pytest.warns(IriftraceWarning, match=f"2 rows of statistics.*{words[0]}"):
            cloud = read_cloud(tmp_path / "a.txt")
        assert_allclose(cloud.points, POINTS)


def test_names_of_columns_are_no_statistics(tmp_path: Path):
    table = "".join(f"{row},0.5,0.25\n" for row in rows().splitlines())
    (tmp_path / "a.csv").write_text(f"z,y,x,std1,max2\n{table}")
    assert_allclose(read_cloud(tmp_path / "a.csv").points, POINTS[:, ::-1])


@pytest.mark.parametrize(
    ("beginning", "kind"),
    [
        ("OFF\n20 0 0\n", "an .off"),
        ("ply\nformat ascii 1.0\n", "a .ply"),
        ("# .PCD v0.7\nFIELDS x y z\n", "a .pcd"),
        ("ncols 3\nnrows 20\ncellsize 0.1\n", "a map of heights"),
    ],
)
def test_text_of_another_format_is_refused_by_its_name(beginning: str, kind: str, tmp_path: Path):
    (tmp_path / "a.txt").write_text(beginning + rows(mark=" "))
    with pytest.raises(InputError, match=f"begins like {kind} and not like a table of points"):
        read_cloud(tmp_path / "a.txt")


def test_a_narrow_map_of_heights_is_refused(tmp_path: Path):
    y, x = np.mgrid[0:40, 0:12]
    np.savetxt(tmp_path / "a.txt", 10 + 2 * np.sin(y / 9) + 0.5 * np.cos(x / 3), "%.5f")
    with pytest.raises(InputError, match="12 columns without names, as a map of heights"):
        read_cloud(tmp_path / "a.txt")
    # A sphere with grey values of any size is none.
    sphere = POINTS / np.linalg.norm(POINTS, axis=1)[:, None]
    for largest in (1.0, 65535.0):
        grey = np.random.default_rng(4).gamma(0.2, 0.03 * largest, (len(POINTS), 1))
        np.savetxt(tmp_path / "a.txt", np.hstack((40.1234567 * sphere, grey)), "%.7f")
        assert len(read_cloud(tmp_path / "a.txt").points) == len(POINTS)


def test_nominal_values_are_warned_of(tmp_path: Path):
    table = "".join(f"{row};0;0;0\n" for row in rows(mark=";").splitlines())
    (tmp_path / "a.csv").write_text(f"Nominal;;;Abweichung;;\nX;Y;Z;dX;dY;dZ\n{table}")
    with pytest.warns(IriftraceWarning, match="'Nominal;;;Abweichung;;' above its columns"):
        assert_allclose(read_cloud(tmp_path / "a.csv").points, POINTS)


def test_nominal_and_measured_points_side_by_side_must_be_chosen_from(tmp_path: Path):
    measured = POINTS + np.random.default_rng(5).normal(0.0, 0.1, POINTS.shape).round(6)
    np.savetxt(tmp_path / "a.asc", np.hstack((POINTS, measured)), "%.6f")
    with pytest.raises(InputError, match="1 to 3 are nearly 4 to 6, as nominal and measured"):
        read_cloud(tmp_path / "a.asc")
    assert_allclose(read_cloud(tmp_path / "a.asc", columns=("4", "5", "6")).points, measured)
    names = ("x", "y", "z", "x_meas", "y_meas", "z_meas")
    columns = dict(zip(names[3:], measured.T, strict=True))
    write_ply_points(tmp_path / "a.ply", POINTS, columns)
    with pytest.raises(InputError, match=f"has the columns {', '.join(names)}, which do not say"):
        read_cloud(tmp_path / "a.ply")
    assert_allclose(read_cloud(tmp_path / "a.ply", columns=names[3:]).points, measured)


def test_infinite_coordinates_are_not_measured(tmp_path: Path):
    table = np.hstack((POINTS, np.ones((len(POINTS), 3))))
    table[3] = np.inf
    np.savetxt(tmp_path / "a.csv", table, "%.6f", ",")
    with pytest.warns(IriftraceWarning, match="1 of 20 points in a.csv are not finite"):
        assert len(read_cloud(tmp_path / "a.csv").points) == len(POINTS) - 1
