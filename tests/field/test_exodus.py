"""Exodus files as VTK writes them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from iriftrace.field.read import read_field
from iriftrace.field.readers.members import members
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
