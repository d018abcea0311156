"""CGNS, Exodus and XDMF, which VTK alone reads: fields as in VTK's own format, and times."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.field import read_field
from iriftrace.io.members import member_at, members
from iriftrace.io.reading import ReadField
from validation.field_files import cgns, exodus, xdmf
from validation.inputs import hot_block

FORMATS = pytest.mark.parametrize(
    ("kind", "name"), [(cgns, "air.cgns"), (exodus, "air.e"), (xdmf, "air.xdmf")]
)


@pytest.mark.parametrize(
    ("kind", "name", "array", "cells"),
    [
        (cgns, "air.cgns", "Temperature", "hexahedra"),
        (cgns, "air.cgns", "Temperature", "tetrahedra"),
        (exodus, "air.e", "T", "hexahedra"),
        (exodus, "air.ex2", "T", "tetrahedra"),
        (exodus, "air.EXO", "T", "hexahedra"),
        (xdmf, "air.xdmf", "T", "hexahedra"),
        (xdmf, "air.xmf", "T", "tetrahedra"),
    ],
)
def test_the_field_is_that_of_vtk(
    tmp_path: Path, kind: Any, name: str, array: str, cells: str
) -> None:
    grid = hot_block.air(6)
    if cells == "tetrahedra":
        grid = pv.UnstructuredGrid(grid.triangulate())
    path = kind.write(tmp_path / name, grid)
    grid.save(tmp_path / "air.vtu")
    found, expected = read_field(path), read_field(tmp_path / "air.vtu")
    assert len(members(path)) == 1
    assert (found.source.array, found.source.length_unit) == (array, "mm")
    assert found.grid.volume == pytest.approx(expected.grid.volume)
    nearest = [expected.grid.find_closest_point(point) for point in np.asarray(found.grid.points)]
    assert_allclose(found.grid.points, np.asarray(expected.grid.points)[nearest], atol=1e-6)
    assert_allclose(found.temperature_k, expected.temperature_k[nearest], rtol=1e-6)


@FORMATS
@pytest.mark.filterwarnings("ignore:The coolest air")
def test_a_file_with_several_times(tmp_path: Path, kind: Any, name: str) -> None:
    grid = hot_block.air(6)
    later = [(0.5, np.asarray(grid["T"]) + 10.0), (2.0, np.asarray(grid["T"]) + 20.0)]
    path = kind.write(tmp_path / name, grid, later)
    assert [member.time for member in members(path)] == [0.0, 0.5, 2.0]
    chosen = read_field(path, member=member_at(path, "0.5").index)
    assert chosen.temperature_k.max() == pytest.approx(hot_block.WALL + 10.0)
    with pytest.warns(IriftraceWarning, match=r"3 states; the last one, t = 2\.0, is used"):
        assert read_field(path).temperature_k.min() == pytest.approx(hot_block.AMBIENT + 20.0)


@FORMATS
def test_damaged_files_are_refused(tmp_path: Path, kind: Any, name: str) -> None:
    path = kind.write(tmp_path / name, hot_block.air(6))
    content = path.read_bytes()
    for damaged in (content[: len(content) // 3], b"something else", b""):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match=r"cannot be read|no volume cells"):
            read_field(path)


@pytest.mark.filterwarnings("ignore:'Temperature' in .* is given in the cells")
def test_cgns_has_values_at_cells_and_units(tmp_path: Path) -> None:
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
    with pytest.raises(InputError, match="in m, but they were to be read in mm"):
        read_field(path, ReadField(length_unit="mm"))
    feet, celsius = (("Foot", "Kelvin"), "of Foot,"), (("Meter", "Celsius"), "of Celsius and")
    for wrong, said in (feet, celsius):
        other = cgns.write(tmp_path / "other.cgns", grid, units=wrong)
        with pytest.raises(InputError, match=said):
            read_field(other)


@pytest.mark.parametrize("node", ["CoordinateTheta", "DataConversion_t"])
def test_cgns_in_other_coordinates_or_scaled_is_refused(tmp_path: Path, node: str) -> None:
    axes = ("R", "Theta", "Z") if node == "CoordinateTheta" else ("X", "Y", "Z")
    path = cgns.write(tmp_path / "air.cgns", hot_block.air(6), axes=axes)
    if node == "DataConversion_t":
        cgns.scale(path, "Temperature", 2.0)
    with pytest.raises(InputError, match="cylindrical coordinates or numbers to be scaled"):
        read_field(path)


@pytest.mark.filterwarnings("ignore:.*2 states")
def test_functions_of_fenics_are_on_one_mesh(tmp_path: Path) -> None:
    """Its files have a grid for the mesh and one for each function, with the mesh in each."""
    grid = hot_block.air(6)
    kelvin = np.asarray(grid["T"])
    grid["velocity"] = np.outer(kelvin - hot_block.AMBIENT, (0.0, 0.001, 0.002))
    path = xdmf.write(tmp_path / "air.xdmf", grid, [(2.0, kelvin)])
    field = read_field(path, member=0, flow=True)
    assert field.grid.volume == pytest.approx((2 * hot_block.OUTER) ** 3 - 12.0**3)
    excess = field.temperature_k - hot_block.AMBIENT
    assert_allclose(field.flow.velocity, np.outer(excess, (0.0, 0.001, 0.002)), atol=1e-9)


@pytest.mark.parametrize("time", ["", '<Time Value="0"/>'])
def test_states_of_xdmf_need_a_time_each(tmp_path: Path, time: str) -> None:
    """VTK reads the first state alone of those without times."""
    grid = hot_block.air(6)
    path = xdmf.write(tmp_path / "air.xdmf", grid, [(2.0, np.asarray(grid["T"]))])
    path.write_text(re.sub("<Time [^>]*>", time, path.read_text()))
    with pytest.raises(InputError, match=r"it has 2 states at \d times.*write a Time into each"):
        members(path)


def test_values_of_xdmf_without_their_file(tmp_path: Path) -> None:
    path = xdmf.write(tmp_path / "air.xdmf", hot_block.air(6))
    path.write_text(path.read_text().replace("air.h5:/T/0", "air.h5:/T/1"))
    with pytest.raises(InputError, match="cannot be read"):
        read_field(path)
    path.with_suffix(".h5").unlink()
    with pytest.raises(InputError, match="cannot be read"):
        read_field(path)
