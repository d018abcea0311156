"""EnSight Gold cases in text and binary, with one state and with several."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.field.index_field import IndexField
from iriftrace.field.read import read_field
from iriftrace.field.readers.members import member_at, members
from validation.inputs.field_grids import AMBIENT, solid


def write(
    folder: Path, *, binary: bool, times: tuple[float, ...] = (), name: str = "a.case"
) -> Path:
    """The box of air as EnSight Gold; at later times the air is 10 K hotter each."""
    grid = solid()
    points = np.asarray(grid.points)
    # VTK's voxels have two pairs of corners the other way round.
    cells = np.asarray(grid.cell_connectivity).reshape(-1, 8)[:, [0, 1, 3, 2, 4, 5, 7, 6]] + 1
    kelvin = AMBIENT + 50.0 * points[:, 0]

    def line(text: str) -> bytes:
        return text.ljust(80).encode() if binary else f"{text}\n".encode()

    def integers(values: np.ndarray) -> bytes:
        if binary:
            return values.astype("<i4").tobytes()
        return "".join("".join(f"{v:10d}" for v in row) + "\n" for row in values).encode()

    def reals(values: np.ndarray) -> bytes:
        return (
            values.astype("<f4").tobytes()
            if binary
            else "".join(f"{v:12.5e}\n" for v in values).encode()
        )

    def number(value: int) -> bytes:
        return struct.pack("<i", value) if binary else f"{value:10d}\n".encode()

    head = line("C Binary") if binary else b""
    geometry = head + b"".join(map(line, ("made", "of air", "node id off", "element id off")))
    geometry += line("part") + number(1) + line("air") + line("coordinates") + number(len(points))
    geometry += b"".join(reals(axis) for axis in points.T)
    geometry += line("hexa8") + number(len(cells)) + integers(cells)
    (folder / "air.geo").write_bytes(geometry)
    for step in range(max(1, len(times))):
        text = line("T") + line("part") + number(1) + line("coordinates")
        text += reals(kelvin + 10.0 * step)
        (folder / (f"air{step}.T" if times else "air.T")).write_bytes(text)
    case = ["FORMAT", "type: ensight gold", "GEOMETRY", "model: air.geo", "VARIABLE"]
    if times:
        case += ["scalar per node: 1 T air*.T", "TIME", "time set: 1"]
        case += [f"number of steps: {len(times)}", "filename start number: 0"]
        case += ["filename increment: 1", "time values:", *map(str, times)]
    else:
        case += ["scalar per node: T air.T"]
    (folder / name).write_text("\n".join(case) + "\n")
    return folder / name


def assert_the_box(field: IndexField, hotter: float = 0.0) -> None:
    """T = ambient + 50 x in 1000 mm3."""
    assert field.grid.volume == pytest.approx(1000.0)
    expected = AMBIENT + 50.0 * np.asarray(field.grid.points)[:, 0] + hotter
    assert_allclose(field.temperature_k, expected, rtol=1e-5)


@pytest.mark.parametrize("name", ["a.case", "a.encas", "A.CASE"])
@pytest.mark.parametrize("binary", [False, True], ids=["text", "binary"])
def test_a_steady_case(tmp_path: Path, binary: bool, name: str) -> None:
    field = read_field(write(tmp_path, binary=binary, name=name))
    assert_the_box(field)
    assert field.source.array == "T"
    assert field.source.length_unit == "mm"


@pytest.mark.filterwarnings("ignore:The coolest air")
@pytest.mark.parametrize("binary", [False, True], ids=["text", "binary"])
def test_a_case_with_several_times(tmp_path: Path, binary: bool) -> None:
    path = write(tmp_path, binary=binary, times=(0.0, 0.5, 2.0))
    assert [m.time for m in members(path)] == [0.0, 0.5, 2.0]
    assert_the_box(read_field(path, member=member_at(path, "0.5").index), 10.0)
    with pytest.warns(IriftraceWarning, match="3 states; the last one, t = 2.0, is used"):
        assert_the_box(read_field(path), 20.0)


def test_damaged_cases_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path, binary=True)
    geometry = (tmp_path / "air.geo").read_bytes()
    (tmp_path / "air.geo").write_bytes(geometry[: len(geometry) // 2])
    with pytest.raises(InputError, match=r"cannot be read|no volume cells"):
        read_field(path)
    (tmp_path / "air.geo").unlink()
    with pytest.raises(InputError, match=r"cannot be read|no volume cells"):
        read_field(path)
    path.write_text("something else")
    with pytest.raises(InputError, match="is no EnSight case"):
        read_field(path)
