"""Damaged and ambiguous COMSOL exports: each is refused in a sentence that names the fault."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.field import read_field
from iriftrace.io.part_files import read_part
from iriftrace.io.reading import ReadField
from validation.field_files import comsol
from validation.inputs.field_grids import AMBIENT, box
from validation.inputs.hot_block import air, block

POINTS = np.asarray(box().points, dtype=np.float64)
KELVIN = AMBIENT + 50.0 * POINTS[:, 0]
TETRAHEDRA = np.asarray(box().triangulate().cell_connectivity).reshape(-1, 4)

Edit = Callable[[str], str]


def swap(old: str, new: str) -> Edit:
    """Replace what must be there once or more."""

    def edit(text: str) -> str:
        assert old in text
        return text.replace(old, new)

    return edit


def cut(count: int) -> Edit:
    return lambda text: text[:count]


def without_header(text: str) -> str:
    return "\n".join(line for line in text.splitlines() if not line.startswith("%"))


def row(number: int, new: str) -> Edit:
    """Replace one row of numbers."""

    def edit(text: str) -> str:
        lines = text.splitlines()
        first = next(k for k, line in enumerate(lines) if not line.startswith("%"))
        lines[first + number] = new
        return "\n".join(lines)

    return edit


SPREADSHEET = {
    "no unit": (swap("T (K)", "T"), "does not say in which unit 'T' is"),
    "unit of another kind": (swap("(K)", "(V)"), "unit 'V', which is not a unit of temperature"),
    "unknown unit": (swap("(K)", "(Kelvins)"), "'Kelvins', which is not a unit"),
    "unknown unit of length": (swap(" mm", " furlong"), "'furlong' is not a length unit"),
    "no header": (without_header, "rows of 4 columns, which no line above them names"),
    "no names": (swap("% x", "% Date: x"), "columns Date: x"),
    "one name too few": (swap("z  ", "   "), "rows of 4 columns, which no line above them names"),
    "no z": (swap("z  ", "r  "), "columns x, y, r, T \\(K\\), of which not one each"),
    "two x": (swap("y  ", "x  "), "of which not one each"),
    "two dimensions": (swap("Dimension:          3", "Dimension:          2"), "in 2 dimensions"),
    "no number of nodes": (
        swap("Nodes:              125", "Nodes: some"),
        "counts some nodes, not 125",
    ),
    "cut between rows": (lambda t: "\n".join(t.splitlines()[:60]), "counts 125 nodes, not 51"),
    "cut within a row": (
        lambda t: t.rstrip()[:-30],
        "line 134: the row .* has 3 columns.*whole file",
    ),
    "no rows": (cut(200), "no row of numbers"),
    "empty": (cut(0), "no row of numbers"),
    "word in a row": (row(3, "1 2 oops 300"), "line 13: 'oops' is not a number"),
    "complex value": (row(3, "1 2 3 300+2i"), r"line 13: '300\+2i' is not a number"),
    "not text": (swap("% Model", "\0\1"), "is not text"),
    "all NaN": (
        lambda t: re.sub(r"^([^%].*?)\S+\s*$", r"\1NaN", t, flags=re.M),
        "NaN at all points",
    ),
    "infinite": (row(3, "7.5 0 0 inf"), "not a finite number at 1"),
    "only coordinates": (
        lambda t: re.sub(r"^([^%].*?)\S+\s*$", r"\1", t, flags=re.M).replace("T (K)", ""),
        "no results, only coordinates",
    ),
}


SECTIONWISE = {
    "no unit": (swap("(T (K))", "(T)"), "does not say in which unit 'T' is"),
    "nothing in the title": (swap(" (T (K))", ""), "in which unit 'Temperature' is"),
    "no name at all": (
        lambda t: re.sub(r"% Desc.*\n", "", t).replace(" (T (K))", ""),
        "does not name its 1 sections",
    ),
    "no data": (lambda t: t[: t.index("% Data")], "no section % Data"),
    "no elements": (
        lambda t: t[: t.index("% Elements (")] + t[t.index("% Data") :],
        "0 sections % Elements",
    ),
    "cut in the data": (lambda t: "\n".join(t.splitlines()[:-4]), "has 121 values for 125 points"),
    "cut in the elements": (
        lambda t: "\n".join(
            t[: t.index("% Data")].splitlines()[:-5] + t[t.index("% Data") :].splitlines()
        ),
        "counts 320 elements, not 315",
    ),
    "cut in the coordinates": (row(0, ""), "counts 125 nodes, not 124"),
    "triangles": (
        lambda t: "\n".join(
            line.rsplit(None, 1)[0] if re.fullmatch(r"\d+(\s+\d+){3}", line) else line
            for line in t.splitlines()
        ),
        "elements of 3 corners, but rays need the air volume",
    ),
    "numbered from zero": (
        lambda t: re.sub(
            r"^\d+(\s+\d+){3}$",
            lambda m: " ".join(str(int(n) - 1) for n in m[0].split()),
            t,
            flags=re.M,
        ),
        "name points 0 to 124 of 125",
    ),
    "points that are not there": (
        swap("Nodes:              125", "Nodes:              124"),
        "counts 124 nodes",
    ),
    "a plane": (
        lambda t: re.sub(r"^([-+.\dE]+ +[-+.\dE]+) +[-+.\dE]+$", r"\1", t, flags=re.M),
        "coordinates of 2 columns, but rays need the air volume",
    ),
}


DAMAGED = [
    pytest.param(layout, *case, id=f"{layout}: {name}")
    for layout, cases in (("spreadsheet", SPREADSHEET), ("sectionwise", SECTIONWISE))
    for name, case in cases.items()
]


@pytest.mark.parametrize(("layout", "edit", "words"), DAMAGED)
def test_damaged_files(tmp_path: Path, layout: str, edit: Edit, words: str) -> None:
    path, columns = tmp_path / "f.txt", {"T (K)": KELVIN}
    if layout == "spreadsheet":
        comsol.spreadsheet(path, POINTS, columns)
    else:
        comsol.sectionwise(path, POINTS, TETRAHEDRA, columns)
    path.write_text(edit(path.read_text()))
    with pytest.raises(InputError, match=f"(?s){words}") as caught:
        read_field(path)
    assert "f.txt" in str(caught.value) or "length unit" in str(caught.value)


def test_commas_both_as_separator_and_decimal_sign(tmp_path: Path) -> None:
    path = tmp_path / "f.csv"
    comsol.spreadsheet(path, POINTS + 0.5, {"T (K)": KELVIN}, separator=",", decimal=",")
    with pytest.raises(InputError, match=r"line 11: .* has 7 columns, but the first one has 8"):
        read_field(path)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"temperature_unit": "degC"}, "is in K, but the temperature unit given is degC"),
        ({"length_unit": "m"}, "in mm, but they were to be read in m.* scale them by 1000 if"),
    ],
)
def test_units_that_contradict_the_header(
    tmp_path: Path, options: dict[str, str], words: str
) -> None:
    path = comsol.sectionwise(tmp_path / "f.txt", POINTS, TETRAHEDRA, {"T (K)": KELVIN})
    with pytest.raises(InputError, match=words):
        read_field(path, ReadField(**options))


def test_units_that_the_user_adds(tmp_path: Path) -> None:
    path = tmp_path / "f.txt"
    comsol.sectionwise(path, POINTS / 10, TETRAHEDRA, {"T": KELVIN - 273.15}, length_unit=None)
    field = read_field(path, ReadField(temperature_unit="degC", length_unit="cm"))
    assert field.grid.volume == pytest.approx(1000.0)
    assert field.temperature_k.min() == pytest.approx(AMBIENT)


def test_a_compressed_file(tmp_path: Path) -> None:
    (tmp_path / "f.txt.gz").write_bytes(b"\x1f\x8b")
    with pytest.raises(InputError, match="compressed; unpack it first"):
        read_field(tmp_path / "f.txt.gz")


def test_points_that_are_no_field(tmp_path: Path) -> None:
    """Several different values at one point, and points in a plane."""
    grid = air(6)
    points = np.asarray(grid.points, dtype=np.float64)
    kelvin = np.asarray(grid.point_data["T"], dtype=np.float64)
    twice = np.vstack([points, points[:3]]), np.append(kelvin, kelvin[:3] + 99.0)
    flat = np.random.default_rng(0).uniform(size=(50, 3)) * (1.0, 1.0, 0.0), np.full(50, AMBIENT)
    for (places, values), words in ((twice, "several different values"), (flat, "fill no volume")):
        path = comsol.spreadsheet(tmp_path / "f.txt", places, {"T (K)": values})
        with pytest.raises(InputError, match=words):
            read_field(path)


def test_scattered_points_need_a_closed_part(tmp_path: Path) -> None:
    grid = air(6)
    points = np.asarray(grid.points, dtype=np.float64)
    path = comsol.spreadsheet(
        tmp_path / "f.txt", points, {"T (K)": np.asarray(grid.point_data["T"])}
    )
    with pytest.raises(InputError, match="give the part so that it can be cut out"):
        read_field(path)
    mesh = block()
    mesh.update_faces(np.arange(len(mesh.faces)) > 1)
    mesh.export(tmp_path / "open.stl")
    with pytest.warns(IriftraceWarning, match="not closed"):
        part = read_part(tmp_path / "open.stl")
    with pytest.raises(InputError, match=r"open\.stl is not a closed surface"):
        read_field(path, part=part)
    block().apply_scale(10.0).export(tmp_path / "large.stl")
    with pytest.raises(InputError, match=r"All points.*lie in the part"):
        read_field(path, part=read_part(tmp_path / "large.stl"))


def test_headers_of_other_languages_are_refused_where_they_state_a_count_or_unit(
    tmp_path: Path,
) -> None:
    path = comsol.spreadsheet(tmp_path / "f.txt", POINTS, {"T (K)": KELVIN})
    text = path.read_text(encoding="utf-8")
    for key, other in (("Nodes:", "Knoten:"), ("Length unit:", "Längeneinheit:")):
        path.write_text(swap(key, other)(text), encoding="utf-8")
        with pytest.raises(InputError, match=f"{other} .* export it in English"):
            read_field(path)
    path.write_text(swap("Model:", "Modell:")(text), encoding="utf-8")
    assert read_field(path).grid.volume == pytest.approx(1000.0)


def test_a_file_of_tecplot_is_refused(tmp_path: Path) -> None:
    tecplot = (
        'TITLE = "a"\nVARIABLES = "X", "Y", "Z", "T"\nZONE I=2 F=POINT\n1 2 3 300\n2 3 4 300\n'
    )
    (tmp_path / "f.dat").write_text(tecplot)
    with pytest.raises(InputError, match="ZONE"):
        read_field(tmp_path / "f.dat")
