"""Clouds in PCD files: ASCII, binary and compressed, grids, colours, units and damage."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.cloud_write import save_cloud
from iriftrace.io.clouds import read_cloud

COMPRESSED = (Path(__file__).parents[1] / "data/pcd/compressed.pcd").read_bytes()
"""A grid of 6 x 4 points with a colour and an intensity each; number 7 was not measured."""

NUMBER = np.arange(24)
ROWS = np.column_stack((NUMBER % 6 * 1.5, NUMBER // 6 * -2.0, np.full(24, 100.25)))
MEASURED = NUMBER != 7
COLOURS = {"red": 10 + NUMBER, "green": 20 + NUMBER, "blue": 200 - NUMBER}

HEADER = """# .PCD v0.7 - Point Cloud Data file format
VERSION 0.7
FIELDS x y z {names}
SIZE 4 4 4 {sizes}
TYPE F F F {types}
COUNT 1 1 1 {counts}
WIDTH 6
HEIGHT 4
VIEWPOINT 0 0 0 1 0 0 0
POINTS 24
DATA {form}
"""


def header(names="", sizes="4", types="F", counts="1", form="ascii") -> bytes:
    empty = {} if names else {"sizes": "", "types": "", "counts": ""}
    values = {"sizes": sizes, "types": types, "counts": counts} | empty
    return HEADER.format(names=names, form=form, **values).encode()


def table(*further) -> bytes:
    rows = np.where(MEASURED[:, None], ROWS, (np.nan, np.nan, np.nan))
    return "".join(
        " ".join(f"{value:.9g}" for value in (*row, *more)) + "\n"
        for row, *more in zip(rows, *further, strict=True)
    ).encode()


def written(folder: Path, content: bytes) -> Path:
    path = folder / "cloud.pcd"
    path.write_bytes(content)
    return path


@pytest.fixture
def binary() -> bytes:
    """The grid as binary rows, with padding between colour and intensity."""
    kind = [("p", "<f4", 3), ("rgb", "<u4"), ("_", "u1", 3), ("i", "<f4")]
    rows = np.zeros(24, dtype=kind)
    rows["p"] = ROWS
    rows["p"][7] = np.nan
    rows["rgb"] = COLOURS["red"] << 16 | COLOURS["green"] << 8 | COLOURS["blue"]
    rows["i"] = 7.0
    return header("rgb _ intensity", "4 1 4", "F U F", "1 3 1", "binary") + rows.tobytes()


@pytest.mark.filterwarnings("ignore:All coordinates")
@pytest.mark.parametrize("form", ["binary", "compressed", "ascii"])
def test_a_grid_with_colours(tmp_path: Path, binary: bytes, form: str) -> None:
    packed = COLOURS["red"] << 16 | COLOURS["green"] << 8 | COLOURS["blue"]
    text = header("rgb intensity", "4 4", "U F", "1 1") + table(packed, np.full(24, 7.0))
    content = {"binary": binary, "compressed": COMPRESSED, "ascii": text}[form]
    with pytest.warns(IriftraceWarning, match="1 of 24 points in cloud.pcd are not finite"):
        cloud = read_cloud(written(tmp_path, content))
    assert_array_equal(cloud.measured, MEASURED)
    assert_array_equal(cloud.points, ROWS[MEASURED])
    assert set(cloud.columns) == {"red", "green", "blue", "intensity"}
    assert_array_equal(cloud.columns["intensity"], np.full(24, 7.0))
    for name, values in COLOURS.items():
        assert_array_equal(cloud.columns[name], values)
    # A .ply keeps the grid.
    values = {"schema": "", "assumptions": {"field_origin": ""}}
    ply, _ = save_cloud(
        tmp_path / "cloud.ply", cloud.rows, cloud.columns, values, remarks=cloud.remarks
    )
    with pytest.warns(IriftraceWarning, match="1 of 24 points"):
        again = read_cloud(ply)
    assert again.remarks == ("obj_info num_cols 6", "obj_info num_rows 4")
    assert_array_equal(again.points, cloud.points)


@pytest.mark.filterwarnings("ignore::iriftrace.core.errors.IriftraceWarning")
def test_units(tmp_path: Path) -> None:
    content = header() + table()
    assert_array_equal(read_cloud(written(tmp_path, content)).points, ROWS[MEASURED])
    in_metres = read_cloud(written(tmp_path, content), length_unit="m").points
    assert_allclose(in_metres, 1e3 * ROWS[MEASURED], rtol=1e-15)
    stated = written(tmp_path, b"# unit: m\n" + content)
    assert_allclose(read_cloud(stated).points, in_metres)
    with pytest.raises(InputError, match="states its coordinates in m, but"):
        read_cloud(stated, length_unit="mm")


@pytest.mark.filterwarnings("ignore:(All coordinates|1 of 24)")
def test_a_viewpoint_is_said_and_not_applied(tmp_path: Path) -> None:
    content = header().replace(b"VIEWPOINT 0 0 0 1", b"VIEWPOINT 0 0 1.5 1") + table()
    with pytest.warns(IriftraceWarning, match=r"states a VIEWPOINT \(0 0 1.5 1 0 0 0\), which is"):
        cloud = read_cloud(written(tmp_path, content))
    assert_array_equal(cloud.points, ROWS[MEASURED])


@pytest.mark.filterwarnings("ignore::iriftrace.core.errors.IriftraceWarning")
def test_chosen_columns_double_precision_and_further_numbers(tmp_path: Path) -> None:
    kind = [("p", "<f4", 3), ("d", "<f8", 3), ("k", "<i2", 2)]
    rows = np.zeros(24, dtype=kind)
    rows["d"] = ROWS + 1e-9
    rows["k"] = (-1, 300)
    names = header("mean_x mean_y mean_z k", "8 8 8 2", "F F F I", "1 1 1 2", "binary")
    path = written(tmp_path, names + rows.tobytes())
    cloud = read_cloud(path, columns=("mean_x", "mean_y", "mean_z"))
    assert_array_equal(cloud.points, ROWS + 1e-9)
    assert set(cloud.columns) == {"x", "y", "z", "k_0", "k_1"}
    assert_array_equal(cloud.columns["k_1"], np.full(24, 300))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "header has no line DATA"),
        (b"FIELDS x y\nDATA ascii\n1 2\n", r"fields \(x y\) have no x, y and z"),
        (header() + table()[:-40], "states 24 points and has 2|could not convert|columns"),
        (header().replace(b"WIDTH 6", b"WIDTH six") + table(), "'six'"),
        (header().replace(b"TYPE F", b"TYPE X") + table(), "field x has type X, size 4 and count"),
        (header().replace(b"SIZE 4 4 4", b"SIZE 4 4") + table(), "is shorter than|is longer than"),
        (header(form="binary") + bytes(24 * 12 - 1), "states 24 points of 12 bytes and is shorter"),
        (header(form="zipped"), "its data are 'zipped'"),
        (COMPRESSED[:-9], "states 480 bytes and has"),
        (COMPRESSED[:195], "states 480 bytes and has"),
        (header(form="binary_compressed") + b"\x02\0\0\0\x03\0\0\0\x20\x05", "what is before them"),
        (header().replace(b"WIDTH 6", b"WIDTH 0").replace(b"POINTS 24", b"POINTS 0"), "no points"),
    ],
)
def test_damaged_files(tmp_path: Path, content: bytes, message: str) -> None:
    path = written(tmp_path, content)
    with pytest.raises(InputError, match=message) as caught:
        read_cloud(path)
    assert str(path) in str(caught.value)
    assert caught.value.code == "file.damaged"
