"""Exodus files as VTK writes them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.field.read import read_field
from iriftrace.field.readers.members import member_at, members
from validation.field_files import exodus
from validation.inputs import hot_block


@pytest.mark.parametrize("name", ["air.e", "air.ex2", "air.EXO"])
def test_the_field_is_that_of_vtk(tmp_path: Path, name: str) -> None:
    grid = hot_block.air(6)
    path = exodus.write(tmp_path / name, grid)
    grid.save(tmp_path / "air.vtu")
    found, expected = read_field(path), read_field(tmp_path / "air.vtu")
    assert len(members(path)) == 1
    assert found.source.array == "T"
    assert found.grid.volume == pytest.approx(expected.grid.volume)
    nearest = [expected.grid.find_closest_point(point) for point in np.asarray(found.grid.points)]
    assert_allclose(found.grid.points, np.asarray(expected.grid.points)[nearest], atol=1e-6)
    assert_allclose(found.temperature_k, expected.temperature_k[nearest], rtol=1e-6)


@pytest.mark.filterwarnings("ignore:The coolest air")
def test_a_file_with_several_times(tmp_path: Path) -> None:
    grid = hot_block.air(6)
    later = [(0.5, np.asarray(grid["T"]) + 10.0), (2.0, np.asarray(grid["T"]) + 20.0)]
    path = exodus.write(tmp_path / "air.e", grid, later)
    assert [member.time for member in members(path)] == [0.0, 0.5, 2.0]
    chosen = read_field(path, member=member_at(path, "0.5").index)
    assert chosen.temperature_k.max() == pytest.approx(hot_block.WALL + 10.0)
    with pytest.warns(IriftraceWarning, match=r"3 states; the last one, t = 2\.0, is used"):
        assert read_field(path).temperature_k.min() == pytest.approx(hot_block.AMBIENT + 20.0)


def test_damaged_files_are_refused(tmp_path: Path) -> None:
    path = exodus.write(tmp_path / "air.e", hot_block.air(6))
    content = path.read_bytes()
    for damaged in (content[: len(content) // 3], b"something else", b""):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match=r"cannot be read|no volume cells"):
            read_field(path)
