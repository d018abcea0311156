"""Tables with missing values, names in several forms, and times in another order."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.field import read_field
from iriftrace.io.members import member_at
from validation.field_files import comsol
from validation.inputs.field_grids import AMBIENT, box

POINTS = np.asarray(box().points, dtype=np.float64)
TETRAHEDRA = np.asarray(box().triangulate().cell_connectivity).reshape(-1, 4)
KELVIN = AMBIENT + 50.0 * POINTS[:, 0]


def table(path: Path, header: list[str], kelvin: list[object], separator: str = ",") -> Path:
    """POINTS in metres with a column T (K)."""
    rows = [[*point, value] for point, value in zip(POINTS / 1e3, kelvin, strict=True)]
    names = separator.join(("x", "y", "z", "T (K)"))
    lines = [separator.join(str(cell) for cell in row) for row in rows]
    path.write_text("\n".join([*header, f"% {names}", *lines]) + "\n", encoding="utf-8")
    return path


def test_a_value_that_is_no_unit_of_length_is_none(tmp_path: Path) -> None:
    header = ["% Description: m", "% Modell: teil.mph"]
    assert read_field(table(tmp_path / "f.csv", header, KELVIN.tolist())).source.length_unit == "mm"


def test_an_empty_comment_below_the_names_is_not_a_row_of_names(tmp_path: Path) -> None:
    path = table(tmp_path / "f.csv", ["% Length unit: m"], KELVIN.tolist())
    path.write_text(path.read_text().replace("T (K)\n", "T (K)\n%\n"))
    assert read_field(path).grid.volume == pytest.approx(1000.0)


@pytest.mark.parametrize("gap", ["null", "#N/A", "", "NaN", "-1.#IND"])
@pytest.mark.parametrize("first", [True, False])
def test_points_without_a_value_are_left_out(tmp_path: Path, gap: str, first: bool) -> None:
    kelvin: list[object] = list(KELVIN.tolist())
    kelvin[0 if first else -1] = gap
    path = table(tmp_path / "f.csv", ["% Length unit: m"], kelvin)
    with pytest.warns(IriftraceWarning, match=rf"NaN\) at 1 of {len(POINTS)} points"):
        field = read_field(path)
    assert field.grid.n_points == len(POINTS) - 1
    assert np.isfinite(field.refractivity).all()


def test_the_latest_time_is_not_the_last_column(tmp_path: Path) -> None:
    columns = {f"T (K) @ t={t}": KELVIN + t for t in (1, 0.5, 0)}
    path = comsol.sectionwise(tmp_path / "f.txt", POINTS, TETRAHEDRA, columns)
    latest = member_at(path, "latest")
    assert latest.time == 1.0
    with pytest.warns(IriftraceWarning, match="the last one, t=1,"):
        assert read_field(path).temperature_k.min() == pytest.approx(AMBIENT + 1)
    field = read_field(path, member=latest.index)
    assert field.temperature_k.min() == pytest.approx(AMBIENT + 1)


@pytest.mark.parametrize(
    "names",
    [
        "x [mm] y [mm] z [mm] T [K]",
        "x (mm) y (mm) z (mm) T (K)",
        "x_mm y_mm z_mm T_K",
        "x_mm y_mm z_mm static-temperature_K",
    ],
)
def test_names_between_blanks(tmp_path: Path, names: str) -> None:
    path = tmp_path / "f.txt"
    rows = np.column_stack([POINTS, KELVIN]).tolist()
    path.write_text("\n".join([names, *(" ".join(map(repr, row)) for row in rows)]))
    field = read_field(path)
    assert field.grid.volume == pytest.approx(1000.0)
    assert field.temperature_k.max() == pytest.approx(KELVIN.max())


def test_static_and_total_temperature(tmp_path: Path) -> None:
    path = tmp_path / "f.csv"
    rows = np.column_stack([POINTS, KELVIN + 5.0, KELVIN]).tolist()
    names = "x_mm,y_mm,z_mm,total-temperature [K],static-temperature [K]"
    path.write_text("\n".join([names, *(",".join(map(repr, row)) for row in rows)]))
    assert read_field(path).temperature_k.max() == pytest.approx(KELVIN.max())


def test_a_function_of_the_temperature_keeps_its_brackets(tmp_path: Path) -> None:
    columns = {"comp1.aveop1(T) (K)": KELVIN + 9.0, "T (K)": KELVIN}
    path = comsol.sectionwise(tmp_path / "f.txt", POINTS, TETRAHEDRA, columns)
    assert read_field(path).source.array == "T"


HEADER = "x [mm];y [mm];z [mm];T [degC]"


def degrees(path: Path, more: str = "", edit: Callable[[list[str]], object] = list) -> Path:
    """The box in degC between semicolons, with its rows edited and text below it."""
    rows = np.column_stack([POINTS, KELVIN - 273.15]).tolist()
    lines = [";".join(f"{value:.9g}" for value in row) for row in rows]
    edit(lines)
    path.write_text("\n".join([HEADER, *lines]) + "\n" + more, encoding="utf-8")
    return path


def test_rows_of_empty_cells_are_none(tmp_path: Path) -> None:
    field = read_field(degrees(tmp_path / "f.csv", ";;;\n"))
    assert field.grid.volume == pytest.approx(1000.0)
    assert field.temperature_k.max() == pytest.approx(KELVIN.max())


@pytest.mark.parametrize("title", [f"# {HEADER}", "# block 2 of 2", HEADER, "[Faces]"])
def test_what_is_between_rows_is_refused(tmp_path: Path, title: str) -> None:
    path = degrees(tmp_path / "f.csv", f"{title}\n20;0;0;20\n30;0;0;20\n")
    with pytest.raises(InputError, match=f"line {len(POINTS) + 2}: "):
        read_field(path)


@pytest.mark.parametrize("hot", ["1,050", "1.050"])
def test_commas_and_points_in_one_table_are_refused(tmp_path: Path, hot: str) -> None:
    def edit(rows: list[str]) -> None:
        other = "," if "." in hot else "."
        rows[:] = [f"{row[: row.rindex(';')]}{other}0;{hot}" for row in rows]

    with pytest.raises(
        InputError, match="points and commas, of which either may be the decimal sign"
    ):
        read_field(degrees(tmp_path / "f.csv", edit=edit))


@pytest.mark.parametrize("number", ["cellnumber", "nodenumber"])
def test_values_of_cells_are_warned_of(tmp_path: Path, number: str) -> None:
    """As Fluent numbers them."""
    path = tmp_path / "f.csv"
    rows = np.column_stack([np.arange(len(POINTS)), POINTS, KELVIN])
    np.savetxt(path, rows, "%.9g", ",", header=f"{number},x,y,z,T (K)", comments="")
    if number == "nodenumber":
        read_field(path)
    else:
        with pytest.warns(IriftraceWarning, match="centres of cells, not those at the wall"):
            read_field(path)


def test_a_last_column_without_values_is_left_out(tmp_path: Path) -> None:
    """With a name, as a note that nobody wrote, or where the header ends with the separator."""
    for name in ("Note", "p [Pa]", ""):
        path = degrees(
            tmp_path / "f.csv",
            edit=lambda rows: rows.__setitem__(slice(None), [f"{row};" for row in rows]),
        )
        path.write_text(path.read_text().replace(HEADER, f"{HEADER};{name}"))
        assert read_field(path).temperature_k.max() == pytest.approx(KELVIN.max())


def test_a_matrix_of_pixels_is_called_one(tmp_path: Path) -> None:
    lines = ["File;a.seq", "Unit;degC", "Width;5", *(";".join("23456") for _ in range(4))]
    (tmp_path / "f.csv").write_text("\n".join(lines))
    with pytest.raises(InputError, match="has 5 columns, but the first one has 2"):
        read_field(tmp_path / "f.csv")
    (tmp_path / "f.csv").write_text("\n".join(lines[3:]))
    with pytest.raises(InputError, match="matrix of pixels"):
        read_field(tmp_path / "f.csv")
