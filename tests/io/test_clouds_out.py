"""Corrected clouds as files: rows, columns, frames and units of the cloud that was measured."""

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

from iriftrace.core.errors import InputError
from iriftrace.core.mesh.transform import apply
from iriftrace.io.cloud_write import WRITTEN
from iriftrace.io.clouds import Cloud, read_cloud
from iriftrace.io.e57 import read_scan
from iriftrace.io.ply import read_ply
from iriftrace.measuring.two_devices.correction import Correction
from iriftrace.measuring.two_devices.correction_status import CorrectionStatus

RNG = np.random.default_rng(4)
ROWS = RNG.uniform(-80, 80, (12, 3))
ROWS[2], ROWS[7] = 0.0, np.nan
COLOURS = RNG.integers(0, 255, (3, 12)).astype(np.uint8)
NORMALS = RNG.normal(size=(12, 3)).astype(np.float32)
# A quarter turn about z and a shift.
MOTION = np.array([[0.0, -1, 0, 10], [1, 0, 0, 20], [0, 0, 1, 30], [0, 0, 0, 1]])


def cloud(unit: str = "mm") -> Cloud:
    columns = dict(zip(("red", "green", "blue"), COLOURS, strict=True)) | {
        "Normals:0": NORMALS[:, 0],
        "Normals:1": NORMALS[:, 1],
        "Normals:2": NORMALS[:, 2],
        "intensity": np.linspace(0, 1, 12).astype(np.float32),
    }
    rows = ROWS / (1000.0 if unit == "m" else 1.0)
    measured = np.isfinite(rows).all(axis=1) & rows.any(axis=1)
    return Cloud(rows, measured, unit, columns, ("obj_info num_cols 4", "obj_info num_rows 3"))


def correction(points: np.ndarray) -> Correction:
    """Every point by other micrometres; the last one stays as it is."""
    error = 1e-3 * np.random.default_rng(5).normal(size=points.shape)
    error[-1] = 0.0
    status = np.zeros(len(points), dtype=np.int64)
    status[-1] = CorrectionStatus.HIDDEN
    return Correction(
        measured=points,
        error=error,
        status=status,
        face=np.zeros(len(points), dtype=np.int64),
        face_normals=np.array([[0.0, 0.0, 1.0]]),
        system="stereo",
        provenance={"assumptions": {"field_origin": "none"}},
    )


@pytest.mark.parametrize("ending", WRITTEN)
def test_every_row_comes_back_in_its_place(ending: str, tmp_path: Path) -> None:
    """In the cloud's own frame and unit, in each kind of file."""
    measured = cloud("m")
    found = correction(apply(MOTION, measured.points))
    path, _ = found.save(
        tmp_path / f"c{ending}", cloud=measured, motion=MOTION, in_cloud_frame=True
    )
    expected = ROWS.copy()
    expected[measured.measured] -= found.error @ MOTION[:3, :3]
    if ending == ".e57":
        columns = read_scan(str(path))
        rows = columns["points"]
        expected = expected[measured.measured]
        np.testing.assert_allclose(1e3 * rows, expected, atol=8e-6)
        np.testing.assert_array_equal(columns["red"], COLOURS[0][measured.measured])
        return
    if ending == ".vtp":
        data = pv.read(path)
        rows, columns = data.points.copy(), dict(data.point_data)
        np.testing.assert_array_equal(rows[7], 0.0)
        rows[7] = np.nan
    elif ending == ".ply":
        data = read_ply(path)
        rows, columns = data.vertices, data.vertex_columns
        assert data.remarks == measured.remarks
        assert b"lengths: m," in path.read_bytes()
    else:
        names = path.read_text().splitlines()[0].strip("# ").replace(",", " ").split()
        table = np.loadtxt(path, delimiter="," if ending == ".csv" else None, skiprows=1)
        columns = dict(zip(names, table.T, strict=True))
        rows = table[:, :3]
    np.testing.assert_allclose(1e3 * rows, expected, atol=1e-9)
    for name, values in zip(("red", "green", "blue"), COLOURS, strict=True):
        np.testing.assert_array_equal(columns[name], values)
        assert ending in (".asc", ".xyz", ".txt", ".csv") or columns[name].dtype == np.uint8
    np.testing.assert_allclose(columns["Normals:0"], NORMALS[:, 0], rtol=1e-7)
    assert columns["status"][[2, 7, 11]].tolist() == [8, 8, 2]
    added = np.column_stack([columns[f"correction_{axis}"] for axis in "xyz"])
    np.testing.assert_allclose(1e3 * (rows - added), ROWS, atol=1e-9)


def test_normals_turn_with_the_points(tmp_path: Path) -> None:
    """In the scene's frame, mm; by whatever names."""
    measured = cloud()
    found = correction(apply(MOTION, measured.points))
    path, _ = found.save(tmp_path / "c.vtp", cloud=measured, motion=MOTION)
    data = pv.read(path)
    np.testing.assert_allclose(data.points[measured.measured], found.points, atol=1e-12)
    turned = np.column_stack([data[f"Normals:{i}"] for i in range(3)])
    np.testing.assert_allclose(turned, NORMALS @ MOTION[:3, :3].T, rtol=1e-6)


@pytest.mark.parametrize("ending", [".ply", ".vtp", ".csv"])
def test_what_is_read_is_written_again(ending: str, tmp_path: Path) -> None:
    """Names and types of the columns, and the grid of an organised .ply; not a scan's errors."""
    truth = {name: np.zeros(12) for name in ("true_x", "error_x", "error_normal", "gap")}
    first = Cloud(ROWS, np.isfinite(ROWS).all(axis=1), "mm", cloud().columns | truth)
    found = correction(first.points)
    found.save(tmp_path / f"a{ending}", cloud=first)
    text = (tmp_path / f"a{ending}").read_bytes()
    with pytest.raises(InputError, match="corrected already"):
        read_cloud(tmp_path / f"a{ending}")
    if ending == ".vtp":
        data = pv.read(tmp_path / "a.vtp")
        for axis in "xyz":
            del data.point_data[f"correction_{axis}"]
        data.save(tmp_path / "b.vtp")
    else:
        (tmp_path / f"b{ending}").write_bytes(text.replace(b"correction_", b"somewhere_"))
    with pytest.warns(UserWarning, match="left out"):
        read = read_cloud(tmp_path / f"b{ending}")
    assert {*cloud().columns, "gap", "status"} <= set(read.columns)
    assert not {"x", "true_x", "error_x", "error_normal"} & set(read.columns)
    np.testing.assert_array_equal(read.columns["red"], COLOURS[0])


def test_three_bytes_a_point_are_its_colour(tmp_path: Path) -> None:
    data = pv.PolyData(ROWS[:2])
    data.point_data["RGB"] = COLOURS[:, :2].T
    data.save(tmp_path / "c.vtp")
    np.testing.assert_array_equal(read_cloud(tmp_path / "c.vtp").columns["green"], COLOURS[1, :2])
