"""COMSOL text exports of every layout: the field read is the one that was written."""

import re
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.field import read_field
from iriftrace.io.members import members
from iriftrace.io.part_files import read_part
from iriftrace.io.reading import ReadField
from iriftrace.medium.index_field import IndexField
from iriftrace.part.part import Part
from validation.field_files import comsol
from validation.inputs.field_grids import AMBIENT, box, saved
from validation.inputs.hot_block import HALF, OUTER, WALL, air, block

POINTS = np.asarray(box().points, dtype=np.float64)
KELVIN = AMBIENT + 50.0 * POINTS[:, 0]
TETRAHEDRA = np.asarray(box().triangulate().cell_connectivity).reshape(-1, 4)


@pytest.fixture(scope="module")
def part(tmp_path_factory: pytest.TempPathFactory) -> Part:
    """The block in hot air, closed."""
    path = tmp_path_factory.mktemp("part") / "block.stl"
    block().export(path)
    return read_part(path)


def assert_the_box(field: IndexField) -> None:
    """The field is the box: T = ambient + 50 x in 1000 mm3."""
    assert field.grid.volume == pytest.approx(1000.0)
    expected = AMBIENT + 50.0 * np.asarray(field.grid.points)[:, 0]
    assert_allclose(field.temperature_k, expected, rtol=1e-12)


def written(path: Path, layout: str, columns: dict[str, np.ndarray]) -> Path:
    match layout:
        case "spreadsheet":
            return comsol.spreadsheet(path, POINTS, columns)
        case "comma":
            return comsol.spreadsheet(path, POINTS, columns, separator=",")
        case "sectionwise":
            return comsol.sectionwise(path, POINTS, TETRAHEDRA, columns)
        case _:
            return comsol.grid(path, [np.unique(axis) for axis in POINTS.T], columns)


UNITS = {"K": KELVIN, "degC": KELVIN - 273.15, "degF": KELVIN * 1.8 - 459.67, "°C": KELVIN - 273.15}


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("layout", ["spreadsheet", "sectionwise", "grid"])
def test_the_header_tells_the_unit_of_the_temperature(
    tmp_path: Path, layout: str, unit: str
) -> None:
    columns = {f"T ({unit})": UNITS[unit]}
    field = read_field(written(tmp_path / "field.txt", layout, columns))
    assert_the_box(field)
    assert field.source.array == "T"
    assert field.source.origin == "COMSOL 6.2.0.415, model part.mph"


SEPARATORS = [
    (" ", ".", "txt"),
    (" ", ",", "txt"),
    (",", ".", "csv"),
    (";", ".", "csv"),
    (";", ",", "csv"),
    ("\t", ".", "txt"),
    ("\t", ",", "txt"),
]


@pytest.mark.parametrize("newline", ["\n", "\r\n"], ids=["unix", "windows"])
@pytest.mark.parametrize(("separator", "decimal", "suffix"), SEPARATORS)
def test_separators_decimal_signs_and_line_ends(
    tmp_path: Path, separator: str, decimal: str, suffix: str, newline: str
) -> None:
    columns = {"T (K)": KELVIN}
    path = tmp_path / f"f.{suffix}"
    options = {"separator": separator, "decimal": decimal, "newline": newline}
    assert_the_box(read_field(comsol.spreadsheet(path, POINTS, columns, **options)))
    assert_the_box(read_field(comsol.sectionwise(path, POINTS, TETRAHEDRA, columns, **options)))


@pytest.mark.parametrize("word", ["tetrahedra", "tetrahedral"])
def test_both_words_for_tetrahedra(tmp_path: Path, word: str) -> None:
    path = comsol.sectionwise(tmp_path / "f.txt", POINTS, TETRAHEDRA, {"T (K)": KELVIN}, word=word)
    assert_the_box(read_field(path))


@pytest.mark.parametrize(("unit", "factor"), [("m", 1e-3), ("cm", 0.1), ("µm", 1e3)])
def test_the_header_tells_the_unit_of_length(tmp_path: Path, unit: str, factor: float) -> None:
    path = tmp_path / "f.txt"
    comsol.sectionwise(path, POINTS * factor, TETRAHEDRA, {"T (K)": KELVIN}, length_unit=unit)
    assert_the_box(read_field(path))


def test_the_axes_may_tell_the_unit_of_length(tmp_path: Path) -> None:
    path = tmp_path / "f.csv"
    comsol.spreadsheet(
        path,
        POINTS / 1e3,
        {"T (K)": KELVIN},
        separator=",",
        axes=("x (m)", "y (m)", "z (m)"),
        length_unit=None,
    )
    field = read_field(path)
    assert_the_box(field)
    assert field.source.length_unit == "m"


def test_columns_go_by_their_names_and_not_their_order(tmp_path: Path) -> None:
    text = comsol.header(nodes=len(POINTS), expressions=2)
    text.append("% T (K), Z, p (Pa), X, Y")
    rows = np.column_stack([KELVIN, POINTS[:, 2], KELVIN * 0 + 1e5, POINTS[:, :2]])
    text += [", ".join(map(repr, row)) for row in rows.tolist()]
    path = tmp_path / "f.csv"
    path.write_text("\ufeff" + "\n".join(text))
    assert_the_box(read_field(path))


def test_a_column_that_is_wider_than_its_title_leaves_one_blank(tmp_path: Path) -> None:
    text = comsol.header(nodes=len(POINTS), expressions=2)
    text.append("% x y z comp1.some_long_expression(a,b) (kg/s) @ t=1, P=2 T (K) @ t=1, P=2")
    text += [f"{x} {y} {z} 0 {t!r}" for (x, y, z), t in zip(POINTS, KELVIN.tolist(), strict=True)]
    path = tmp_path / "f.txt"
    path.write_text("\n".join(text))
    assert [m.label for m in members(path)] == ["t=1, P=2"]
    assert_the_box(read_field(path))


def test_a_spreadsheet_may_have_its_names_without_a_percent_sign(tmp_path: Path) -> None:
    path = tmp_path / "f.csv"
    rows = np.column_stack([POINTS, KELVIN]).tolist()
    path.write_text("x,y,z,T (K)\n" + "\n".join(",".join(map(repr, row)) for row in rows))
    assert_the_box(read_field(path))


def test_numbers_may_be_quoted(tmp_path: Path) -> None:
    path = tmp_path / "f.csv"
    rows = [[f'"{value!r}"' for value in row] for row in np.column_stack([POINTS, KELVIN]).tolist()]
    path.write_text('"x","y","z","T (K)"\n' + "\n".join(map(",".join, rows)))
    assert_the_box(read_field(path))
    path.write_text("x,y,z,T (K)\n" + "\n".join(f'{x},{x},{x},"1,{x}00"' for x in range(1, 9)))
    with pytest.raises(InputError, match="'1,100' is not a number"):
        read_field(path)


@pytest.mark.parametrize("name", ["T", "comp1.T", "Temperature", "ht.T", "Temperatur"])
def test_names_that_comsol_gives_the_temperature(tmp_path: Path, name: str) -> None:
    path = comsol.sectionwise(
        tmp_path / "f.txt",
        POINTS,
        TETRAHEDRA,
        {f"{name} (K)": KELVIN, "spf.U (m/s)": KELVIN, "ht.Cp (J/(kg*K))": KELVIN},
    )
    assert_the_box(read_field(path))


def test_density_has_its_unit_too(tmp_path: Path) -> None:
    plain = read_field(
        comsol.sectionwise(tmp_path / "T.txt", POINTS, TETRAHEDRA, {"T (K)": KELVIN})
    )
    density = plain.air.ambient_density * AMBIENT / KELVIN
    path = tmp_path / "rho.txt"
    comsol.sectionwise(path, POINTS, TETRAHEDRA, {"ht.rho (g/cm^3)": density / 1e3})
    assert_the_box(read_field(path))


@pytest.mark.parametrize("layout", ["spreadsheet", "comma", "sectionwise"])
@pytest.mark.parametrize("state", ["t={}", "t={}, P=100", "P={}"])
def test_times_and_parameters_are_members(tmp_path: Path, layout: str, state: str) -> None:
    columns = {}
    for k, value in enumerate((0.5, 1.0, 10.0)):
        columns[f"T (K) @ {state.format(value)}"] = KELVIN + k
        columns[f"spf.U (m/s) @ {state.format(value)}"] = KELVIN * 0.0
    path = written(tmp_path / "f.txt", layout, columns)
    found = members(path)
    assert [m.label for m in found] == [state.format(v) for v in (0.5, 1.0, 10.0)]
    assert [m.time for m in found] == ([0.5, 1.0, 10.0] if "t" in state else [None] * 3)
    for member in found:
        field = read_field(path, member=member.index)
        assert field.temperature_k.min() == pytest.approx(AMBIENT + member.index, abs=1e-9)
        assert field.source.origin.endswith(f", {member.label}")
    with pytest.warns(IriftraceWarning, match="3 states; the last one"):
        assert read_field(path).temperature_k.min() == pytest.approx(AMBIENT + 2, abs=1e-9)


def test_states_in_the_arrays_of_comsols_vtu(tmp_path: Path) -> None:
    grid = box().cast_to_unstructured_grid()
    grid.clear_data()
    for time in (0.0, 0.25):
        grid.point_data[f"Temperature_@_t={time:g}"] = KELVIN + time
    path = saved(grid, tmp_path / "f.vtu")
    assert [(m.label, m.time) for m in members(path)] == [("t=0", 0.0), ("t=0.25", 0.25)]
    for member in members(path):
        field = read_field(path, member=member.index)
        assert field.source.array == "Temperature"
        assert field.temperature_k.min() == pytest.approx(AMBIENT + (member.time or 0.0))


def test_a_unit_in_the_name_of_a_vtu_array_counts(tmp_path: Path) -> None:
    grid = pv.ImageData(dimensions=(5, 5, 5), spacing=(2.5, 2.5, 2.5))
    grid.point_data["Temperature_(degC)"] = KELVIN - 273.15
    assert_the_box(read_field(saved(grid, tmp_path / "f.vti")))


def test_the_part_is_cut_out_of_scattered_points(tmp_path: Path, part: Part) -> None:
    """The block's air is the outer cube less the block; Delaunay alone fills the block too."""
    grid = air(9)
    rng = np.random.default_rng(0)
    points = np.asarray(grid.points, dtype=np.float64)
    free = (np.abs(points) > HALF + 1).any(axis=1) & (np.abs(points) < OUTER - 1).all(axis=1)
    # Off the regular grid, as a solver's points are; those on wall and outside stay on them.
    points[free] += rng.uniform(-0.7, 0.7, (np.count_nonzero(free), 3))
    kelvin = np.asarray(grid.point_data["T"], dtype=np.float64)
    path = tmp_path / "f.txt"
    comsol.spreadsheet(path, points / 1e3, {"T (K)": kelvin}, length_unit="m")
    field = read_field(path, part=part)
    assert set(field.grid.celltypes) == {pv.CellType.TETRA}
    assert field.grid.n_points == len(points)
    assert field.grid.volume == pytest.approx((2 * OUTER) ** 3 - (2 * HALF) ** 3, rel=1e-9)
    assert field.wall.area == pytest.approx(6 * (2 * HALF) ** 2, rel=1e-9)
    assert np.asarray(field.wall.point_data["refractivity"]) == pytest.approx(
        field.air.refractivity(WALL)
    )


def test_points_of_a_regular_grid_keep_its_cells(tmp_path: Path) -> None:
    """With NaN in the part, a grid's spreadsheet needs no part to be cut out."""
    axis = np.linspace(-OUTER, OUTER, 10)
    z, y, x = np.meshgrid(axis, axis, axis, indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    inside = (np.abs(points) < HALF - 1).all(axis=1)
    kelvin = np.where(inside, np.nan, AMBIENT + 100.0)
    kelvin[0] = AMBIENT
    shuffled = np.random.default_rng(1).permutation(len(points))
    path = tmp_path / "f.txt"
    comsol.spreadsheet(path, points[shuffled], {"T (K)": kelvin[shuffled]})
    with pytest.warns(IriftraceWarning, match=r"no number \(NaN\) at 8 of 1000"):
        field = read_field(path)
    assert set(field.grid.celltypes) == {pv.CellType.HEXAHEDRON}
    assert field.grid.n_cells == 9**3 - 3**3
    assert field.temperature_k.min() == pytest.approx(AMBIENT)


def test_nodes_without_a_value_take_their_elements_away(tmp_path: Path) -> None:
    kelvin = KELVIN.copy()
    kelvin[62] = np.nan  # the middle of 5 x 5 x 5 points
    path = comsol.sectionwise(tmp_path / "f.txt", POINTS, TETRAHEDRA, {"T (K)": kelvin})
    with pytest.warns(IriftraceWarning, match="NaN"):
        field = read_field(path)
    assert field.grid.n_points == 124
    assert field.grid.n_cells == np.count_nonzero((TETRAHEDRA != 62).all(axis=1))


def test_points_that_are_listed_again_are_used_once(tmp_path: Path, part: Part) -> None:
    grid = air(6)
    points = np.asarray(grid.points, dtype=np.float64)
    kelvin = np.asarray(grid.point_data["T"], dtype=np.float64)
    path = tmp_path / "f.txt"
    comsol.spreadsheet(
        path, np.vstack([points, points[:50]]), {"T (K)": np.append(kelvin, kelvin[:50])}
    )
    with pytest.warns(IriftraceWarning, match="repeats 50 points"):
        field = read_field(path, part=part)
    assert field.grid.n_points == len(points)


HEADERS = {
    "comma": lambda line: line.replace(": ", ",", 1),
    "quotation marks": lambda line: line.replace(": ", ',"', 1) + '"',
    "semicolon": lambda line: line.replace(":", ";", 1),
    "tab": lambda line: line.replace(":", "\t", 1),
    "number sign": lambda line: line.replace("%", "#", 1),
}


def metre_table(path: Path, header: str) -> Path:
    """The box in m as a .csv, with the keys of its header written in another way."""
    comsol.spreadsheet(path, POINTS / 1e3, {"T (K)": KELVIN}, separator=",", length_unit="m")
    lines = path.read_text().splitlines()
    keys = [k for k, line in enumerate(lines) if re.match(r"% (Length|Nodes|Expr)", line)]
    for k in keys:
        lines[k] = HEADERS[header](" ".join(lines[k].split()))
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("header", HEADERS)
def test_keys_of_a_header_are_read_whatever_follows_them(tmp_path: Path, header: str) -> None:
    field = read_field(metre_table(tmp_path / "f.csv", header))
    assert_the_box(field)
    assert field.source.length_unit == "m"


def test_a_table_with_fewer_rows_than_its_header_counts_is_refused(tmp_path: Path) -> None:
    """Whatever follows the key of its header."""
    path = metre_table(tmp_path / "f.csv", "semicolon")
    path.write_text("\n".join(path.read_text().splitlines()[:90]) + "\n")
    with pytest.raises(InputError, match="counts 125 nodes, not 81"):
        read_field(path)


@pytest.mark.parametrize("layout", ["spreadsheet", "sectionwise", "grid"])
def test_a_file_with_fewer_results_than_its_header_counts_is_refused(
    tmp_path: Path, layout: str
) -> None:
    path = written(tmp_path / "f.txt", layout, {"T (K)": KELVIN})
    text = path.read_text()
    path.write_text(re.sub("(Expressions: +)1", r"\g<1>3", text))
    with pytest.raises(InputError, match="counts 3 expressions, not 1"):
        read_field(path)
    path.write_text(re.sub("(Nodes: +)125", r"\g<1>130", text))
    with pytest.raises(InputError, match="counts 130 nodes, not 125"):
        read_field(path)


def test_an_expression_of_several_states_counts_once_or_once_a_state(tmp_path: Path) -> None:
    columns = {f"T (K) @ t={time}": KELVIN for time in (1, 2, 3)}
    path = comsol.spreadsheet(tmp_path / "f.txt", POINTS, columns)
    assert_the_box(read_field(path, member=2))
    path.write_text(re.sub("(Expressions: +)3", r"\g<1>1", path.read_text()))
    assert_the_box(read_field(path, member=2))


def test_header_and_axes_that_state_different_units_of_length_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "f.csv"
    axes = ("x (m)", "y (m)", "z (m)")
    comsol.spreadsheet(path, POINTS, {"T (K)": KELVIN}, separator=",", axes=axes)
    with pytest.raises(InputError) as error:
        read_field(path)
    assert error.value.code == "units.two"


@pytest.mark.parametrize("unit", [" [ m ]", " [m]", "[m]"])
@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_units_in_square_brackets(tmp_path: Path, unit: str, separator: str) -> None:
    names = [f"{name}{unit}" for name in "XYZ"] + [f"Temperature{unit.replace('m', 'K')}"]
    rows = np.column_stack([POINTS / 1e3, KELVIN]).tolist()
    lines = ["[Name]", "air", "", "[Data]", f"{separator} ".join(names)]
    lines += [f"{separator} ".join(map(repr, row)) for row in rows]
    path = tmp_path / "f.csv"
    path.write_text("\n".join(lines))
    field = read_field(path)
    assert_the_box(field)
    assert field.source.length_unit == "m"


@pytest.mark.parametrize(
    ("header", "unit"),
    [
        ("Points:0,Points:1,Points:2,T", None),
        ("Points_0,Points_1,Points_2,T", None),
        ("x_m,y_m,z_m,T", "m"),
        ("# units: m, K\n# x,y,z,T", "m"),
        ("# x y z T", None),
    ],
)
def test_names_and_units_of_other_programs(tmp_path: Path, header: str, unit: str | None) -> None:
    """ParaView, NumPy, and units behind names or in a remark."""
    rows = np.column_stack((POINTS / (1e3 if unit else 1.0), KELVIN))
    mark = "," if "," in header else " "
    np.savetxt(tmp_path / "f.txt", rows, "%.12e", mark, header=header, comments="")
    field = read_field(tmp_path / "f.txt", ReadField(temperature_unit="K"))
    assert_the_box(field)
    assert field.source.length_unit == (unit or "mm")
