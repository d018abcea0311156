"""Tables of text: every cell as written, names with units, and one refusal for all else."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from iriftrace.core.errors import InputError
from iriftrace.io.states import Column
from iriftrace.io.table import Table, read_table, table_in

ROWS = ((-1.5, 0.0, 3e-7), (40.25, 5.0, 6.5))


def table(text: str) -> Table:
    return table_in(text, Path("a.csv"))


def columns(header: str) -> list[Column]:
    """Of a header above a row of as many numbers between semicolons."""
    return table(f"{header}\n" + ";".join("1" * (header.count(";") + 1))).columns


@pytest.mark.parametrize(
    "text",
    [
        "x,y,z\n-1.5,0,3e-7\n40.25,5,6.5\n",
        "x;y;z\n-1,5;0;3e-7\n40,25;5;6,5\n",
        "x\ty\tz\r\n-1,5\t0\t3E-07\r\n40,25\t5\t6,5\r\n",
        "# x y z\n-1.5 0 3e-7\n  40.25  5.0 6.5\n",
        "// x y z\n-1,5 0 3e-7\n40,25 5 6,5\n",
        "sep=;\nx;y;z\n-1,5;0;3e-7\n40,25;5;6,5\n",
        '"x";"y";"z"\n"-1,5";"0";"3e-7"\n"40,25";"5";"6,5"\n',
        "x,y,z,\n-1.5,0,3e-7,\n40.25,5,6.5,\n",
        "x,   y,   z\n  -1.5, 0,3e-7\n  40.25, 5, 6.5\n",
        "% made by hand\n\nx,y,z\n-1.5,0,3e-7\n\n40.25,5,6.5\n;;;\n# end\n",
    ],
)
def test_rows_come_back_whatever_separates_them(text: str) -> None:
    read = table(text)
    assert read.names == ("x", "y", "z")
    assert read.coordinates == [0, 1, 2]
    assert_array_equal(read.numbers([0, 1, 2]), ROWS)


def test_numbers_are_exact() -> None:
    values = np.random.default_rng(1).normal(size=2000) * 10.0 ** np.arange(-100, 100).repeat(10)
    points = [repr(value) for value in values.tolist()]
    assert_array_equal(table("\n".join(["v", *points])).numbers([0])[:, 0], values)
    commas = [f"{value!r};1".replace(".", ",") for value in values.tolist()]
    assert_array_equal(table("\n".join(["v;w", *commas])).numbers([0])[:, 0], values)


@pytest.mark.parametrize("gap", ["", "NaN", "nan", "null", "#N/A", "1.#QNAN", "-1.#IND"])
def test_what_is_missing_is_nan(gap: str) -> None:
    read = table(f"x,y,z\n1,{gap},2\n3,4,{gap}\n").numbers([0, 1, 2])
    assert_array_equal(read, [(1, np.nan, 2), (3, 4, np.nan)])


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        ("T", Column("T", None, "")),
        ("T [K]", Column("T", "K", "")),
        ("X [ m ]", Column("X", "m", "")),
        ("X[mm]", Column("X", "mm", "")),
        ("Temperature (degC)", Column("Temperature", "degC", "")),
        ("x_mm", Column("x", "mm", "")),
        ("T_degC", Column("T", "degC", "")),
        ("T_in", Column("T_in", None, "")),
        ("T/K", Column("T/K", None, "")),
        ("T(K)", Column("T(K)", None, "")),
    ],
)
def test_names_with_units(header: str, expected: Column) -> None:
    assert columns(f"{header};p")[0] == expected


def test_names_between_blanks_keep_their_units() -> None:
    read = table("id X [mm] Y [mm] Z [mm] Cp (J/(kg*K))\n1 2 3 4 5\n")
    assert [column.unit for column in read.columns] == [None, "mm", "mm", "mm", "J/(kg*K)"]
    assert read.coordinates == [1, 2, 3]


@pytest.mark.parametrize(
    ("header", "places"),
    [
        ("T;Z [mm];x;Y", [2, 3, 1]),
        ("a;Points:2;Points:0;Points:1", [2, 3, 1]),
        ("a;Points_2;Points_0;Points_1", [2, 3, 1]),
        ("nodenumber;z-coordinate;x-coordinate;y-coordinate", [2, 3, 1]),
    ],
)
def test_coordinates_by_their_names(header: str, places: list[int]) -> None:
    assert table(f"{header}\n1;2;3;4\n").coordinates == places


@pytest.mark.parametrize(
    "header",
    ["x;y;T", "x;x;y;z", "x;y;z;Points:0", "X-Koordinate;Y-Koordinate;Z-Koordinate", "nx;ny;nz"],
)
def test_other_names_are_refused_with_what_was_found(header: str) -> None:
    row = ";".join("1" * (header.count(";") + 1))
    with pytest.raises(InputError) as error:
        _ = table(f"{header}\n{row}\n").coordinates
    assert header.replace(";", ", ") in str(error.value)


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("x [m],y [m],z [m]\n1,2,3\n", "m"),
        ("x_mm,y_mm,z_mm\n1,2,3\n", "mm"),
        ("# unit: m\nx,y,z\n1,2,3\n", "m"),
        ("# x y z\n# length unit = inch\n1 2 3\n", "inch"),
        ("# coordinates in m\nx,y,z\n1,2,3\n", ""),
        ("x,y,z\n1,2,3\n", ""),
    ],
)
def test_units_of_length(text: str, unit: str) -> None:
    assert table(text).length_unit([0, 1, 2]) == unit


@pytest.mark.parametrize(
    "text",
    [
        "x [m],y [mm],z [mm]\n1,2,3\n",
        "# unit: m\nx [mm],y [mm],z [mm]\n1,2,3\n",
        "x [ft],y [ft],z [ft]\n1,2,3\n",
    ],
)
def test_units_that_contradict_or_are_not_known_are_refused(text: str) -> None:
    with pytest.raises(InputError) as error:
        table(text).length_unit([0, 1, 2])
    assert error.value.code in ("units.two", "units.unknown")


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("", "no row of numbers"),
        ("x,y,z\n", "no row of numbers"),
        ("x,y,z\n1,2,3\n4,5\n", "line 3"),
        ("x,y,z\n1,2,3\n4,5,6,7\n", "line 3"),
        ("x,y,z\n1,2,3\nEND\n", "'END'"),
        ("x,y,z\n1,2,3\nMean,2,3\n", "'Mean'"),
        ("x,y,z\n1,2,3\n4,oops,6\n", "line 3: 'oops'"),
        ("x,y,z\n1,2,3\n4,300+2i,6\n", r"'300\+2i'"),
        ("x y z\n1 2 3 # first\n", "3 columns|5 columns"),
        ('x;y;z\n1,5;2;"1.012"\n', "points and commas"),
        ('x,y,z\n1.5,2,"1,012"\n', "'1,012'"),
        ("x;y;z\n1.5;2;3\n1,5;2;3\n", "points and commas"),
        ("# a b c\n1 2 3\n# a b c\n4 5 6\n", "comment between rows, in line 3: '# a b c'"),
        ("x,y,z\n1,2,3\n\0\n", "not text"),
        ('x,y,z\n1,"2\n3",4\n', "cell of several lines"),
        ("Width;3\n1;2;3\n4;5;6\n", "line 2"),
        ("a b\n1 2 3\n", "rows of 3 columns.*'a b'.*matrix of pixels"),
        ("1 2 3\n", "rows of 3 columns.*matrix of pixels"),
    ],
)
def test_everything_else_is_refused(text: str, found: str) -> None:
    def read() -> None:
        read = table(text)
        assert read.columns
        read.numbers(range(read.width))

    with pytest.raises(InputError, match=found):
        read()


def test_a_column_of_words_is_only_refused_where_it_is_needed() -> None:
    read = table("name,x,found\nP1,1.5,True\nP2,2.5,False\n")
    assert [read.has_words(place) for place in range(3)] == [True, False, False]
    assert_array_equal(read.numbers([1, 2]), [(1.5, 1.0), (2.5, 0.0)])


def test_rows_by_a_mask_keep_their_lines() -> None:
    read = table("a;b\n1,5;x\n2,5;-1,25\n3,5;y\n")
    assert_array_equal(read.where(np.array([False, True, False])).numbers([1]), [(-1.25,)])
    with pytest.raises(InputError, match="line 4: 'y'"):
        read.where(np.array([False, True, True])).numbers([1])


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "cp1252"])
def test_encodings(encoding: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("x [µm];y [µm];z [µm]\n1;2;3\n", encoding=encoding)
    assert read_table(tmp_path / "a.csv").length_unit([0, 1, 2]) == "um"
