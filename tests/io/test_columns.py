"""Columns of a cloud with the measured points: declared by names, the ending, or chosen."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.cloud_write import save_cloud
from iriftrace.io.clouds import read_cloud

POINTS = np.random.default_rng(1).uniform(-100, 100, (20, 10))
"""Coordinates in the first three columns, other quantities in the rest."""


def write(path: Path, header: str, columns: list[int], mark: str = ",") -> Path:
    """A table of some columns of `POINTS` under a header."""
    np.savetxt(path, POINTS[:, columns], "%.17g", mark, header=header, comments="")
    return path


@pytest.mark.parametrize(
    ("header", "columns", "mark"),
    [
        ('"error_normal","gap","Points:0","Points:1","Points:2"', [3, 4, 0, 1, 2], ","),
        ("true_x,true_y,true_z,Points_0,Points_1,Points_2", [3, 4, 5, 0, 1, 2], ","),
        ("id,x_mm,y_mm,z_mm", [3, 0, 1, 2], ","),
        ("# exported 2024\n# id x y z", [3, 0, 1, 2], " "),
        ("id X [mm] Y [mm] Z [mm]", [3, 0, 1, 2], " "),
        ('"i", "x", "y", "z"', [3, 0, 1, 2], ","),
        ("x_true,y_true,z_true,x,y,z", [3, 4, 5, 0, 1, 2], ","),
        ("id;Z [mm];Y [mm];X [mm]", [9, 2, 1, 0], ";"),
        ("//X Y Z", [0, 1, 2], " "),
        (",x,y,z", [9, 0, 1, 2], ","),
    ],
)
def test_coordinates_are_read_by_their_names(
    header: str, columns: list[int], mark: str, tmp_path: Path
) -> None:
    cloud = write(tmp_path / "cloud.csv", header, columns, mark)
    assert_array_equal(read_cloud(cloud).points, POINTS[:, :3])


@pytest.mark.parametrize(
    ("header", "count"),
    [
        ("Nominal X,Nominal Y,Nominal Z,Actual X,Actual Y,Actual Z", 6),
        ("true_x,true_y,true_z", 3),
        ("X-Koordinate;Y-Koordinate;Z-Koordinate", 3),
        ("x,y,z,x,y,z", 6),
        ("x,y,z,Points:0,Points:1,Points:2", 6),
        ("range,azimuth,elevation", 3),
        ("Northing,Easting,Height", 3),
        ("u,v,disparity", 3),
        ("id,x,y,z\n,[mm],[mm],[mm]", 4),
        ("# id x y z\n# exported 2024", 4),
    ],
)
@pytest.mark.parametrize("ending", ["csv", "xyz"])
def test_other_names_are_refused_with_what_was_found(
    header: str, count: int, ending: str, tmp_path: Path
) -> None:
    mark = next((mark for mark in ";," if mark in header), " ")
    cloud = write(tmp_path / f"cloud.{ending}", header, list(range(count)), mark)
    with pytest.raises(InputError) as error:
        read_cloud(cloud)
    last = header.splitlines()[-1].removeprefix("# ").split(mark)[-1]
    assert last in str(error.value)
    assert_array_equal(read_cloud(cloud, columns=["1", "2", "3"]).points, POINTS[:, :3])


@pytest.mark.parametrize("ending", ["xyz", "asc", "pts"])
def test_endings_whose_convention_is_x_y_z(ending: str, tmp_path: Path) -> None:
    cloud = write(tmp_path / f"a.{ending}", "# unit: m", [0, 1, 2, 3], " ")
    read = read_cloud(cloud)
    assert_array_equal(read.points, 1e3 * POINTS[:, :3])
    assert_array_equal(read.columns["column_4"], POINTS[:, 3])


@pytest.mark.parametrize("ending", ["txt", "csv"])
def test_other_endings_need_names_or_chosen_columns(ending: str, tmp_path: Path) -> None:
    np.savetxt(tmp_path / f"a.{ending}", POINTS, "%.17g", ",")
    with pytest.raises(InputError, match="10 columns"):
        read_cloud(tmp_path / f"a.{ending}")
    found = read_cloud(tmp_path / f"a.{ending}", columns=["4", "2", "1"]).points
    assert_array_equal(found, POINTS[:, [3, 1, 0]])


def test_columns_are_chosen_by_name_or_number(tmp_path: Path) -> None:
    names = "Nominal X;Nominal Y;Nominal Z;Actual X [mm];Actual Y [mm];Actual Z [mm]"
    cloud = write(tmp_path / "cloud.csv", names, [3, 4, 5, 0, 1, 2], ";")
    for chosen in (["Actual X [mm]", " Actual Y [mm]", "Actual Z [mm]"], ["4", "5", "6"]):
        assert_array_equal(read_cloud(cloud, columns=chosen).points, POINTS[:, :3])
    with pytest.raises(InputError, match=r"no column 'Actual X'; it has the columns Nominal X"):
        read_cloud(cloud, columns=["Actual X", "Actual Y", "Actual Z"])
    for chosen in (["4", "5"], ["4", "5", "5"]):
        with pytest.raises(InputError) as error:
            read_cloud(cloud, columns=chosen)
        assert (error.value.code, error.value.argument) == ("cloud.columns", "columns")


@pytest.mark.parametrize("ending", ["vtp", "ply"])
def test_columns_of_meshes_are_chosen_too(ending: str, tmp_path: Path) -> None:
    columns = {f"mean_{axis}": POINTS[:, i] for i, axis in enumerate("xyz")}
    values = {"schema": "", "assumptions": {"field_origin": ""}}
    cloud, _ = save_cloud(tmp_path / f"cloud.{ending}", POINTS[:, 3:6], columns, values)
    assert_array_equal(read_cloud(cloud).points, POINTS[:, 3:6])
    assert_array_equal(read_cloud(cloud, columns=list(columns)).points, POINTS[:, :3])
    with pytest.raises(InputError, match=r"no column 'true_x'; .*mean_x, mean_y, mean_z"):
        read_cloud(cloud, columns=("true_x", "mean_y", "mean_z"))


@pytest.mark.parametrize(
    "header", ["x [m],y [m],z [m]", "x (m),y (m),z (m)", "x_m,y_m,z_m", "# unit: m\n# x y z"]
)
def test_a_unit_beside_the_names_is_that_of_the_numbers(header: str, tmp_path: Path) -> None:
    mark = "," if "," in header else " "
    cloud = write(tmp_path / "cloud.csv", header, [0, 1, 2], mark)
    assert_array_equal(read_cloud(cloud).points, 1e3 * POINTS[:, :3])
    assert_array_equal(read_cloud(cloud, length_unit="m").points, 1e3 * POINTS[:, :3])
    with pytest.raises(InputError) as error:
        read_cloud(cloud, length_unit="mm")
    assert (error.value.code, error.value.argument) == ("units.contradict", "length_unit")


@pytest.mark.parametrize(("unit", "factor"), [("meters", 1e3), ("centimeters", 10.0)])
def test_an_obj_states_its_unit_in_a_comment(tmp_path: Path, unit: str, factor: float) -> None:
    """Its points are the vertices, those of no face too, and those of a texture's seam once."""
    rows = "".join(f"v {x!r} {y!r} {z!r} 1.0\n" for x, y, z in POINTS[:, :3].tolist())
    faces = "vt 0 0\nvt 1 1\nf 1/1 2/2 3/1\nf 1/2 3/2 2/1\n"
    (tmp_path / "cloud.obj").write_text(f"# File units = {unit}\n{rows}{faces}")
    assert_array_equal(read_cloud(tmp_path / "cloud.obj").points, factor * POINTS[:, :3])


def test_a_count_is_obeyed_or_refused(tmp_path: Path) -> None:
    cloud = tmp_path / "a.pts"
    cloud.write_text("2\n1.5555 2.5 3.5\n4.5 5.5 6.5\n")
    assert_array_equal(read_cloud(cloud).points, [(1.5555, 2.5, 3.5), (4.5, 5.5, 6.5)])
    for text in (
        "3\n1.5 2.5 3.5\n4.5 5.5 6.5\n",
        "1\n1.5 2.5 3.5\n4.5 5.5 6.5\n",
        "1\n1.5 2.5 3.5\n1\n4.5 5.5 6.5\n",
    ):
        cloud.write_text(text)
        with pytest.raises(InputError):
            read_cloud(cloud)


def test_columns_of_words_are_left_out(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("Name,x,y,z\nP1,1.5555,2,3\nP2,4,5,6\n")
    with pytest.warns(IriftraceWarning, match="columns of words, which are left out: Name"):
        cloud = read_cloud(tmp_path / "a.csv")
    assert cloud.columns == {}
    assert len(cloud.points) == 2


@pytest.mark.parametrize("row", [";;;", "\t\t\t", ",,,"])
def test_a_row_of_empty_cells_keeps_its_place(tmp_path: Path, row: str) -> None:
    """In an organised cloud a point's number is its pixel; those at the end are no rows."""
    mark, file = row[0], tmp_path / "cloud.csv"
    lines = ["x;y;z;i", "1.12345;2;3;", row, "4;5;6;7", row, row]
    file.write_text("\n".join(lines).replace(";", mark) + "\n")
    with pytest.warns(IriftraceWarning, match="1 of 3 points"):
        cloud = read_cloud(file)
    assert cloud.measured.tolist() == [True, False, True]
    assert_array_equal(cloud.points, [(1.12345, 2.0, 3.0), (4.0, 5.0, 6.0)])
    assert_array_equal(cloud.columns["i"], [np.nan, np.nan, 7.0])


@pytest.mark.parametrize(("value", "are"), [(0.0, r"exactly \(0, 0, 0\)"), (np.nan, "not finite")])
def test_pixels_without_a_point_are_left_out(tmp_path: Path, value: float, are: str) -> None:
    """Organised clouds have a row for every pixel; sensors write their own origin, or NaN."""
    rows = POINTS[:, :3].copy()
    rows[[2, 5]] = value
    rows[7, :2] = 0.0
    np.savetxt(tmp_path / "cloud.xyz", rows, "%.17g")
    with pytest.warns(IriftraceWarning, match=f"2 of 20 points .* {are}.*left out"):
        read = read_cloud(tmp_path / "cloud.xyz").points
    assert_array_equal(read, np.delete(rows, [2, 5], axis=0))
    np.savetxt(tmp_path / "empty.xyz", np.full((4, 3), value))
    with pytest.raises(InputError, match="No point was measured: 4 of 4"):
        read_cloud(tmp_path / "empty.xyz")


@pytest.mark.parametrize(
    ("name", "marks"),
    [
        ("valid", ("1", "0")),
        ("scalar_is_valid", ("255", "0")),
        ("Mask", ("True", "False")),
        ("invalid", ("0", "1")),
    ],
)
def test_points_that_a_column_marks_are_left_out(
    tmp_path: Path, name: str, marks: tuple[str, str]
) -> None:
    rows = [f"{x},{y},{z},{marks[k == 3]}" for k, (x, y, z) in enumerate(POINTS[:, :3].tolist())]
    (tmp_path / "cloud.csv").write_text("\n".join([f"x,y,z,{name}", *rows]))
    with pytest.warns(IriftraceWarning, match=f"1 of 20 points .* not valid by the column {name}"):
        cloud = read_cloud(tmp_path / "cloud.csv")
    assert_array_equal(cloud.points, np.delete(POINTS[:, :3], 3, axis=0))
    assert np.isnan(cloud.rows[3]).all()


@pytest.mark.parametrize(
    ("unit", "decimals", "single", "warned"),
    [("mm", 3, False, True), ("mm", 3, True, True), ("m", 6, False, True), ("mm", 4, True, False)],
)
def test_rounding_to_a_micrometre_is_noticed(
    unit: str, decimals: int, single: bool, warned: bool, tmp_path: Path
) -> None:
    """In whatever unit, and behind the rounding of single precision."""
    points = (POINTS[:, :3] / (1000.0 if unit == "m" else 1.0)).round(decimals)
    cloud = tmp_path / "cloud.xyz"
    np.savetxt(cloud, points.astype(np.float32) if single else points, "%.17g")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        read_cloud(cloud, length_unit=unit)
    assert bool(said) is warned


def test_pixels_are_those_of_the_measured_points(tmp_path: Path) -> None:
    """In the columns that `iriftrace measure` writes; both, or none."""
    file = tmp_path / "cloud.txt"
    rows = "1.1111 2 3 40 50\nnan nan nan 41 50\n4.1111 5 6 42.5 51\n"
    file.write_text(f"x y z pixel_u pixel_v\n{rows}")
    with pytest.warns(IriftraceWarning, match="1 of 3 points"):
        pixels = read_cloud(file).pixels
    assert_array_equal(pixels, [(40, 50), (42.5, 51)])
    file.write_text("x y z pixel_u quality\n1.1111 2 3 40 50\n")
    assert read_cloud(file).pixels is None


def test_a_binary_pcd_with_more_points_than_stated_is_refused(tmp_path: Path) -> None:
    rows = POINTS[:, :3].copy()
    head = "FIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {}\nHEIGHT 1\nDATA binary\n"
    path = tmp_path / "cloud.pcd"
    path.write_bytes(head.format(20).encode() + rows.tobytes() + b"\n")
    assert_array_equal(read_cloud(path).points, rows)
    path.write_bytes(head.format(15).encode() + rows.tobytes())
    with pytest.raises(InputError, match="states 15 points of 24 bytes and is shorter or longer"):
        read_cloud(path)


def test_a_ply_states_its_unit_in_a_comment_that_is_known(tmp_path: Path) -> None:
    names = "".join(f"property double {axis}\n" for axis in "xyz")
    header = "ply\nformat ascii 1.0\ncomment unit: furlong\nelement vertex 20\n"
    rows = POINTS[:, :3]
    np.savetxt(tmp_path / "a.ply", rows, "%.17g", header=f"{header}{names}end_header", comments="")
    with pytest.warns(IriftraceWarning, match="furlong"):
        read_cloud(tmp_path / "a.ply")
