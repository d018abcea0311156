"""CGNS files: the field is the same as from VTK's own format, in the units that they state."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose

from iriftrace.core.errors import InputError
from iriftrace.field.read import read_field
from iriftrace.field.readers.members import members
from validation.field_files import cgns
from validation.inputs import hot_block


@pytest.mark.parametrize("cells", ["hexahedra", "tetrahedra"])
def test_the_field_is_that_of_vtk(tmp_path: Path, cells: str) -> None:
    grid = hot_block.air(6)
    if cells == "tetrahedra":
        grid = pv.UnstructuredGrid(grid.triangulate())
    path = cgns.write(tmp_path / "air.cgns", grid)
    grid.save(tmp_path / "air.vtu")
    found, expected = read_field(path), read_field(tmp_path / "air.vtu")
    assert len(members(path)) == 1
    assert found.source.array == "Temperature"
    assert found.source.length_unit == "mm"
    assert_allclose(found.grid.points, expected.grid.points, atol=1e-6)
    assert_allclose(found.temperature_k, expected.temperature_k, rtol=1e-6)
    assert found.grid.volume == pytest.approx(expected.grid.volume)


@pytest.mark.filterwarnings("ignore:'Temperature' in .* is given in the cells")
def test_values_at_cells_and_a_unit_of_the_file(tmp_path: Path) -> None:
    grid = hot_block.air(6)
    expected = read_field(cgns.write(tmp_path / "points.cgns", grid))
    grid.points = np.asarray(grid.points, dtype=np.float64) * 1e-3
    cells = grid.point_data_to_cell_data()
    units = ("Meter", "Kelvin")
    path = cgns.write(tmp_path / "air.cgns", cells, location="CellCenter", units=units)
    found = read_field(path)
    assert found.source.length_unit == "m"
    assert_allclose(found.grid.points, expected.grid.points, atol=1e-4)
    assert hot_block.AMBIENT < found.temperature_k.mean() < hot_block.WALL
    with pytest.raises(InputError, match="length_unit"):
        read_field(path, length_unit="mm")
    for wrong, said in (
        (("Foot", "Kelvin"), "coordinates in Foot"),
        (("Meter", "Celsius"), "in K"),
    ):
        other = cgns.write(tmp_path / "other.cgns", grid, units=wrong)
        with pytest.raises(InputError, match=said):
            read_field(other)
