"""Which columns of a table are the measured points: read by their names, or refused with them."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from iriftrace.clouds.columns import axis_of
from iriftrace.io.clouds import read_cloud
from iriftrace.core.errors import InputError, IriftraceWarning

POINTS = np.random.default_rng(1).uniform(-100, 100, (20, 10))
"""Coordinates in the first three columns, other quantities in the rest."""


def write(
    path: Path, header: str, columns: list[int], mark: str = ",", encoding: str = "utf-8"
) -> Path:
    """A table of some columns of `POINTS` under a header."""
    np.savetxt(
        path, POINTS[:, columns], "%.17g", mark, header=header, comments="", encoding=encoding
    )
    return path


@pytest.mark.parametrize(
    ("header", "columns", "mark"),
    [
        ('"error_normal","gap","Points:0","Points:1","Points:2"', [3, 4, 0, 1, 2], ","),
        ("true_x,true_y,true_z,Points_0,Points_1,Points_2", [3, 4, 5, 0, 1, 2], ","),
        ("id,x_mm,y_mm,z_mm", [3, 0, 1, 2], ","),
        ("Nr;X-Koordinate;Y-Koordinate;Z-Koordinate", [3, 0, 1, 2], ";"),
        ("id,x,y,z\n,[mm],[mm],[mm]", [3, 0, 1, 2], ","),
        ("# id x y z\n# exported 2024", [3, 0, 1, 2], " "),
        ("#x,#y,#z,i", [0, 1, 2, 3], ","),
        ("Nr\tX Axis (mm)\tY Axis (mm)\tZ Axis (mm)", [3, 0, 1, 2], "\t"),
        ("id X [mm] Y [mm] Z [mm]", [3, 0, 1, 2], " "),
        ("Point ID   X/mm   Z/mm   Y/mm", [3, 0, 2, 1], " "),
        ("# Columns: i x y z", [3, 0, 1, 2], " "),
        ('"i", "x", "y", "z"', [3, 0, 1, 2], ","),
        ("n;cartesianX;cartesianY;cartesianZ;nx;ny;nz", [3, 0, 1, 2, 4, 5, 6], ";"),
        ("x_true,y_true,z_true,x,y,z", [3, 4, 5, 0, 1, 2], ","),
        ("x,y,z,x.1,y.1,z.1", [0, 1, 2, 3, 4, 5], ","),
        ("POINT_X;POINT_Y;POINT_Z;", [0, 1, 2], ";"),
        ("Координата Y;Координата X;Posición Z", [1, 0, 2], ";"),
        ("id;Z [mm];Y [mm];X [mm]", [9, 2, 1, 0], ";"),
        ('"Y","X","Z"', [1, 0, 2], ","),
        ("//X Y Z", [0, 1, 2], " "),
        (",x,y,z", [9, 0, 1, 2], ","),
        ("z,y,x\n", [2, 1, 0], ","),
        ("Z: Y: X:", [2, 1, 0], " "),
        ('"Z\n[mm]";"Y\n[mm]";"X\n[mm]"', [2, 1, 0], ";"),
        ("\uff3a\uff08mm\uff09,\uff39\uff08\u339c\uff09,\uff38\uff08mm\uff09", [2, 1, 0], ","),
        ("x,y,z,offset 2", [0, 1, 2, 3], ","),
        ("Z=;Y=;X=", [2, 1, 0], ";"),
        ("Scan 12 January", [0, 1, 2], " "),
        ("# created by ATOS", [0, 1, 2], " "),
        ("measured on Tuesday by the night shift", [0, 1, 2, 3], " "),
    ],
)
def test_coordinates_are_read_by_their_names(
    header: str, columns: list[int], mark: str, tmp_path: Path
) -> None:
    cloud = write(tmp_path / "cloud.csv", header, columns, mark)
    np.testing.assert_array_equal(read_cloud(cloud).points, POINTS[:, :3])


def test_cells_may_be_quoted_or_empty_and_a_count_may_come_first(tmp_path: Path) -> None:
    """Empty coordinates are not measured; a wrong count is warned of."""
    tables = {
        "quoted.csv": '"x","y","z","i"\n"1.5","2.5","3.5",""\n"4.5","5.5","6.5","7"\n',
        "empty.csv": "x;y;z;i\n1,5;2,5;3,5;\n;;;\n4,5;5,5;6,5;7\n",
        "tabs.txt": "x\ty\tz\ti\n1.5\t2.5\t3.5\t\n\t\t\t9\n4.5\t5.5\t6.5\t7\n",
        "count.xyz": "2\n1.5 2.5 3.5\n4.5 5.5 6.5\n",
        "comma.csv": "2\n1.5,2.5,3.5\n4.5,5.5,6.5\n",
        "wrong.asc": "3\n1.5 2.5 3.5\n4.5 5.5 6.5\n",
    }
    for name, text in tables.items():
        (tmp_path / name).write_text(text)
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            read = read_cloud(tmp_path / name)
        np.testing.assert_array_equal(read.points, [(1.5, 2.5, 3.5), (4.5, 5.5, 6.5)])
        texts = " ".join(str(one.message) for one in said)
        assert ("1 of 3 points" in texts) is (name in ("empty.csv", "tabs.txt"))
        assert ("states 3 points and holds 2" in texts) is (name == "wrong.asc")
        if "i" in read.columns:
            np.testing.assert_array_equal(read.columns["i"][[0, -1]], [np.nan, 7.0])


@pytest.mark.filterwarnings("ignore:.*(rounded to|words or dates)")
@pytest.mark.parametrize(
    "text",
    [
        '"1,5","2,5","-3,5"\n"4,5","5,5","6,5"\n',
        "[1.5, 2.5, -3.5]\n[4.5, 5.5, 6.5]\n",
        "1,5, 2,5, -3,5\n4,5, 5,5, 6,5\n",
        "1.5 2.5 -3.5 # first\n4.5 5.5 6.5  // second\n",
        "Time,x,y,z\n12:00:01,1.5,2.5,-3.5\n12:00:02,4.5,5.5,6.5\n",
        "2024-01-31;1,5;2,5;-3,5\n2024-01-31;4,5;5,5;6,5\n",
        "1.5 2.5 \N{MINUS SIGN}3.5\n4.5 5.5 6.5\n",
        "***End_of_Header***\t\nTime\tX\tY\tZ\tComment\n0\t1,5\t2,5\t-3,5\t\n1\t4,5\t5,5\t6,5\t\n",
        "x;y;z;\n1,5;2,5;-3,5;\n4,5;5,5;6,5;\n",
        "x;y;z\n1,5;2,5;(3,5)\n4,5;5,5;6,5\n",
        '"1.5","2.5","(3.5)"\n"4.5","5.5","6.5"\n',
    ],
)
def test_quotes_brackets_remarks_and_dates_are_no_part_of_numbers(
    text: str, tmp_path: Path
) -> None:
    cloud = tmp_path / "cloud.csv"
    cloud.write_text(text, encoding="utf-8")
    columns = ("2", "3", "4") if text.startswith("2024") else None
    read = read_cloud(cloud, columns=columns).points
    np.testing.assert_array_equal(read, [(1.5, 2.5, -3.5), (4.5, 5.5, 6.5)])


def test_a_map_of_heights_is_refused(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "map.csv", np.tile(POINTS, (1, 3)), delimiter=",")
    with pytest.raises(InputError, match="30 columns without names, as a map of heights"):
        read_cloud(tmp_path / "map.csv")
    assert len(read_cloud(tmp_path / "map.csv", columns=("1", "2", "3")).points) == len(POINTS)


def test_decimal_commas_between_commas_are_refused(tmp_path: Path) -> None:
    cloud = tmp_path / "cloud.csv"
    cloud.write_text("1,5,2,5,-3,5\n4,5,5,5,6,5\n")
    with pytest.raises(InputError, match="6 columns of whole numbers between commas"):
        read_cloud(cloud)


def test_quoted_signs_between_thousands_are_refused(tmp_path: Path) -> None:
    cloud = tmp_path / "cloud.csv"
    cloud.write_text('x,y,z\n"1,012",2.5,3.5\n"1,013",5.5,6.5\n')
    with pytest.raises(InputError, match="over 4 columns"):
        read_cloud(cloud)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_marks_of_the_byte_order_are_no_part_of_a_name(encoding: str, tmp_path: Path) -> None:
    cloud = write(tmp_path / "cloud.txt", "z;y;x", [2, 1, 0], ";", encoding)
    np.testing.assert_array_equal(read_cloud(cloud).points, POINTS[:, :3])


@pytest.mark.parametrize(
    ("header", "count", "said"),
    [
        ("Nominal X,Nominal Y,Nominal Z,Actual X,Actual Y,Actual Z", 6, "Nominal X, Nominal Y"),
        ("true_x,true_y,true_z", 3, "true_x, true_y, true_z, which do not say"),
        ("Ist X;Ist Y;Ist Z;Abweichung", 4, "Ist X, Ist Y"),
        ("nx ny nz", 3, "nx, ny, nz"),
        ("x,y,intensity", 3, "x, y, intensity"),
        ("x,y,z,x,y,z", 6, "x, y, z, x, y, z"),
        ("x,y,z,x_meas,y_meas,z_meas", 6, "x_meas, y_meas"),
        ("x,y,z,Points:0,Points:1,Points:2", 6, "Points:0"),
        ("u,v,depth,grey", 4, "u, v, depth, grey"),
        ("Z=mm,Y=mm,X=mm", 3, "Z=mm, Y=mm"),
        ("Point ID X Y Z", 4, "Point, ID, X, Y, Z over 4 columns"),
        ("x y z", 4, "x, y, z over 4 columns"),
        ("Nominal X Nominal Y Nominal Z Actual X Actual Y Actual Z", 6, "over 6 columns"),
    ],
)
def test_names_that_do_not_tell_are_refused(
    header: str, count: int, said: str, tmp_path: Path
) -> None:
    mark = next((mark for mark in ";," if mark in header), " ")
    cloud = write(tmp_path / "cloud.csv", header, list(range(count)), mark)
    with pytest.raises(InputError, match=f"{said}.*--columns A,B,C"):
        read_cloud(cloud)


def test_a_first_column_that_counts_the_rows_is_no_coordinate(tmp_path: Path) -> None:
    rows = np.column_stack((np.arange(1, 21), POINTS[:, :3]))
    np.savetxt(tmp_path / "cloud.xyz", rows, "%.17g")
    with pytest.raises(InputError, match=r"counts the rows.*--columns 2,3,4"):
        read_cloud(tmp_path / "cloud.xyz")
    read = read_cloud(tmp_path / "cloud.xyz", columns=("2", "3", "4")).points
    np.testing.assert_array_equal(read, POINTS[:, :3])


def test_columns_are_chosen_by_name_or_number(tmp_path: Path) -> None:
    names = "Nominal X;Nominal Y;Nominal Z;Actual X [mm];actual y [mm];Actual Z [mm]"
    cloud = write(tmp_path / "cloud.csv", names, [3, 4, 5, 0, 1, 2], ";")
    for chosen in (["Actual X [mm]", " Actual Y [mm]", "actual z [mm]"], ["4", "5", "6"]):
        np.testing.assert_array_equal(read_cloud(cloud, columns=chosen).points, POINTS[:, :3])
    with pytest.raises(InputError, match=r"no column 'Actual X' .*; it has the columns Nominal X"):
        read_cloud(cloud, columns=["Actual X", "Actual Y", "Actual Z"])
    for chosen in (["4", "5"], ["4", "5", "5"]):
        with pytest.raises(InputError, match="are not three"):
            read_cloud(cloud, columns=chosen)


@pytest.mark.parametrize("ending", ["vtp", "ply"])
def test_columns_of_meshes_are_chosen_too(ending: str, tmp_path: Path) -> None:
    from iriftrace.io.cloud_write import save_cloud

    columns = {f"mean_{axis}": POINTS[:, i] for i, axis in enumerate("xyz")}
    values = {"schema": "", "assumptions": {"field_origin": ""}}
    cloud, _ = save_cloud(tmp_path / f"cloud.{ending}", POINTS[:, 3:6], columns, values)
    np.testing.assert_array_equal(read_cloud(cloud).points, POINTS[:, 3:6])
    np.testing.assert_array_equal(read_cloud(cloud, columns=list(columns)).points, POINTS[:, :3])
    with pytest.raises(InputError, match=r"no column 'true_x' .*mean_x, mean_y, mean_z"):
        read_cloud(cloud, columns=("true_x", "mean_y", "mean_z"))


@pytest.mark.parametrize(
    "header",
    [
        *("x [m],y [m],z [m]", "x_m,y_m,z_m", "x,y,z\nm,m,m", "# unit: m\n# x y z"),
        *("Maßeinheit,m\nx,y,z", "# Unité : m\nx,y,z", '"Units","meters"\n"x","y","z"'),
    ],
)
def test_a_unit_beside_the_names_is_that_of_the_numbers(header: str, tmp_path: Path) -> None:
    mark = "," if "," in header else " "
    cloud = write(tmp_path / "cloud.csv", header, [0, 1, 2], mark)
    np.testing.assert_allclose(read_cloud(cloud).points, 1e3 * POINTS[:, :3], rtol=1e-15)
    np.testing.assert_allclose(
        read_cloud(cloud, length_unit="m").points, 1e3 * POINTS[:, :3], rtol=1e-15
    )
    with pytest.raises(InputError, match=r"states its coordinates in m, but .* in mm"):
        read_cloud(cloud, length_unit="mm")


def test_inches_by_their_sign(tmp_path: Path) -> None:
    cloud = write(tmp_path / "cloud.csv", '"X ("")","Y ("")","Z ("")"', [0, 1, 2])
    np.testing.assert_allclose(read_cloud(cloud).points, 25.4 * POINTS[:, :3], rtol=1e-15)
    cloud = write(tmp_path / "cloud.txt", 'X (") Y (") Z (")', [0, 1, 2], " ")
    np.testing.assert_allclose(read_cloud(cloud).points, 25.4 * POINTS[:, :3], rtol=1e-15)


@pytest.mark.parametrize(("unit", "factor"), [("meters", 1e3), ("centimeters", 10.0)])
def test_an_obj_states_its_unit_in_a_comment(tmp_path: Path, unit: str, factor: float) -> None:
    cloud = tmp_path / "cloud.obj"
    cloud.write_text(
        f"# File units = {unit}\n" + "".join(f"v {x} {y} {z}\n" for x, y, z in POINTS[:, :3])
    )
    np.testing.assert_allclose(read_cloud(cloud).points, factor * POINTS[:, :3], rtol=1e-6)


def test_units_that_are_not_read_are_refused(tmp_path: Path) -> None:
    cloud = write(tmp_path / "cloud.csv", "x [ft],y [ft],z [ft]", [0, 1, 2])
    with pytest.raises(InputError, match=r"are in ft, which is not read; export them in mm"):
        read_cloud(cloud)
    cloud = write(tmp_path / "cloud.csv", "x [1/10 mm],y [1/10 mm],z [1/10 mm]", [0, 1, 2])
    with pytest.raises(InputError, match=r"are in 1/10 mm, which is not read"):
        read_cloud(cloud)


@pytest.mark.parametrize("first", [np.linspace(1.7e9, 1.8e9, 20), 3.5 - 0.04 * np.arange(20)])
def test_a_first_column_of_times_is_no_coordinate(tmp_path: Path, first: np.ndarray) -> None:
    np.savetxt(tmp_path / "cloud.xyz", np.column_stack((first, POINTS[:, :3])), "%.17g")
    with pytest.raises(InputError, match=r"(rise|fall) from row to row.*--columns 2,3,4, or 1,2,3"):
        read_cloud(tmp_path / "cloud.xyz")
    sorted_by_x = POINTS[np.argsort(POINTS[:, 0]), :3]
    np.savetxt(tmp_path / "cloud.xyz", sorted_by_x, "%.17g")
    np.testing.assert_array_equal(read_cloud(tmp_path / "cloud.xyz").points, sorted_by_x)


def test_homogeneous_coordinates_are_refused(tmp_path: Path) -> None:
    cloud = write(tmp_path / "cloud.csv", "x,y,z,W", [0, 1, 2, 3])
    with pytest.raises(InputError, match="has a column W that is not 1, as homogeneous"):
        read_cloud(cloud)
    assert_allclose(read_cloud(cloud, columns=("x", "y", "z")).points, POINTS[:, :3])
    np.savetxt(cloud, np.hstack((POINTS[:, :3], np.ones((20, 1)))), "%.17g", ",", header="x,y,z,w")
    assert_allclose(read_cloud(cloud).points, POINTS[:, :3])


def test_coordinates_that_count_pixels_are_warned_of(tmp_path: Path) -> None:
    pixels = np.indices((4, 5)).reshape(2, -1).T
    np.savetxt(tmp_path / "map.xyz", np.column_stack((pixels, POINTS[:, 2])), "%.17g")
    with pytest.warns(
        IriftraceWarning, match="Two of the coordinates in map.xyz are whole numbers"
    ):
        read_cloud(tmp_path / "map.xyz")
    np.savetxt(tmp_path / "map.xyz", np.column_stack((pixels * (1, 0), POINTS[:, 2])), "%.17g")
    assert len(read_cloud(tmp_path / "map.xyz").points) == 20
    np.savetxt(tmp_path / "map.xyz", np.column_stack((pixels, POINTS[:, 2:4])), "%.17g")
    with pytest.raises(InputError, match=r"in column 1, 2; .* \(--columns A,B,C\)"):
        read_cloud(tmp_path / "map.xyz")


@pytest.mark.parametrize("name", ["index", "intensity", "Deviation[mm]", "R", "Point ID"])
def test_other_quantities_are_no_coordinates_of_points(name: str) -> None:
    axis = axis_of(name)
    assert axis is None or axis.what


@pytest.mark.parametrize(("value", "are"), [(0.0, r"exactly \(0, 0, 0\)"), (np.nan, "not finite")])
def test_pixels_without_a_point_are_left_out(tmp_path: Path, value: float, are: str) -> None:
    """Organised clouds have a row for every pixel; sensors write their own origin, or NaN."""
    rows = POINTS[:, :3].copy()
    rows[[2, 5]] = value
    rows[7, :2] = 0.0
    np.savetxt(tmp_path / "cloud.xyz", rows, "%.17g")
    with pytest.warns(IriftraceWarning, match=f"2 of 20 points .* {are}.*left out"):
        read = read_cloud(tmp_path / "cloud.xyz").points
    np.testing.assert_array_equal(read, np.delete(rows, [2, 5], axis=0))
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
    np.testing.assert_array_equal(cloud.points, np.delete(POINTS[:, :3], 3, axis=0))
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


@pytest.mark.parametrize(
    "header",
    [
        *("range,azimuth,elevation", "r,theta,phi", "u,v,disparity", "Northing,Easting,Height"),
        *("N,E,H", "i,j,value", "East,North,Up", "Rechts [m],Hoch [m],H [m]"),
    ],
)
def test_three_columns_of_other_quantities_are_no_coordinates(tmp_path: Path, header: str) -> None:
    with pytest.raises(InputError, match="do not say which three are the measured x, y and z"):
        read_cloud(write(tmp_path / "a.csv", header, [0, 1, 2]))


def test_pixels_before_the_coordinates_are_not_taken_for_these(tmp_path: Path) -> None:
    pixels = np.indices((4, 5)).reshape(2, -1).T
    table = np.hstack((pixels, POINTS[:, :3]))
    np.savetxt(tmp_path / "a.txt", table, "%.17g")
    with pytest.raises(
        InputError, match=r"whole numbers, as of pixels, in column 1, 2; .*--columns 3,4,5"
    ):
        read_cloud(tmp_path / "a.txt")
    found = read_cloud(tmp_path / "a.txt", columns=["3", "4", "5"])
    assert_allclose(found.points, POINTS[:, :3])


def test_vertices_of_an_obj_are_its_points(tmp_path: Path) -> None:
    """Those of no face too, and those of a texture's seam once."""
    rows = [" ".join(map(repr, row)) for row in POINTS[:, :3].tolist()]
    faces = "vt 0 0\nvt 1 1\nf 1/1 2/2 3/1\nf 1/2 3/2 2/1\n"
    (tmp_path / "cloud.obj").write_text("\n".join([f"v {row} 1.0" for row in rows] + [faces]))
    np.testing.assert_array_equal(read_cloud(tmp_path / "cloud.obj").points, POINTS[:, :3])
    (tmp_path / "cloud.obj").write_text("\n".join(f"v {row} 2.0" for row in rows))
    with pytest.raises(InputError, match="has a column w that is not 1"):
        read_cloud(tmp_path / "cloud.obj")
