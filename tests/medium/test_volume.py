"""File types and cell types: volume and values of one linear grid against a box of known size."""

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose, assert_array_equal

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.field import read_field
from validation.inputs.field_grids import AMBIENT, box, saved, solid


def by_place(points: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Rows of place and value in an order that does not depend on the order of the points."""
    rows = np.column_stack([np.round(points, 9), values])
    return rows[np.lexsort(rows.T)]


@pytest.mark.parametrize(
    "name", ["f.vtu", "f.vtk", "f.vti", "f.vtr", "f.vts", "F.VTU", "f.vtm", "f.pvtu", "f.pvd"]
)
def test_all_file_types_give_the_same_field(tmp_path, name):
    path = tmp_path / name
    match path.suffix.lower():
        case ".vti":
            box().save(path)
        case ".vtr":
            box().cast_to_rectilinear_grid().save(path)
        case ".vts":
            box().cast_to_structured_grid().save(path)
        case ".vtm":
            pv.MultiBlock([box(), None, pv.Sphere()]).save(path)
        case ".pvd":
            solid().save(tmp_path / "step.vtu")
            path.write_text(
                '<VTKFile type="Collection" version="0.1"><Collection>'
                '<DataSet timestep="1" part="0" file="step.vtu"/></Collection></VTKFile>'
            )
        case ".pvtu":
            solid().save(tmp_path / "piece.vtu")
            path.write_text(
                '<VTKFile type="PUnstructuredGrid" version="0.1"><PUnstructuredGrid>'
                '<PPointData><PDataArray type="Float64" Name="T"/></PPointData>'
                '<PPoints><PDataArray type="Float32" Name="Points" NumberOfComponents="3"/>'
                '</PPoints><Piece Source="piece.vtu"/></PUnstructuredGrid></VTKFile>'
            )
        case _:
            solid().save(path)
    field = read_field(path)
    assert field.grid.n_cells == 64
    expected = AMBIENT + 50.0 * box().points[:, 0]
    assert_allclose(
        by_place(field.grid.points, field.temperature_k), by_place(box().points, expected)
    )
    assert field.grid.volume == pytest.approx(1000.0)


def test_blocks_are_joined_where_they_touch(tmp_path):
    # Else each seam would be a boundary: cracked shells, and a wall where there is none.
    left, right = solid(), solid().translate((10.0, 0.0, 0.0))
    right.point_data["T"] = AMBIENT + 50.0 * right.points[:, 0]
    pv.MultiBlock([left, right]).save(tmp_path / "two.vtm")
    field = read_field(tmp_path / "two.vtm")
    assert field.grid.n_points == 9 * 5 * 5
    assert field.wall.n_cells == 0


def test_blocks_with_other_names_for_the_temperature(tmp_path):
    """VTK joins what all blocks have, and would leave nothing."""
    left, right = solid(), solid().translate((10.0, 0.0, 0.0))
    right.rename_array("T", "Tsolid")
    pv.MultiBlock([left, right]).save(tmp_path / "two.vtm")
    with pytest.raises(InputError, match=r"2 blocks without an array in common .*T.*; .*Tsolid"):
        read_field(tmp_path / "two.vtm")


def test_higher_order_cells_keep_their_corners(tmp_path):
    grid = pv.examples.cells.QuadraticHexahedron()
    grid.point_data["T"] = AMBIENT + grid.points[:, 0]
    path = saved(grid, tmp_path / "f.vtu")
    with pytest.warns(IriftraceWarning, match="higher order"):
        field = read_field(path)
    assert field.grid.n_points == 8
    assert_array_equal(field.grid.celltypes, [pv.CellType.HEXAHEDRON])
    assert_allclose(field.temperature_k, AMBIENT + field.grid.points[:, 0])


def test_polyhedra_are_split_without_losing_volume(tmp_path):
    cube = solid(2)
    cells = []
    for number in range(cube.n_cells):
        faces = [face.point_ids for face in cube.get_cell(number).faces]
        if cube.celltypes[number] == pv.CellType.VOXEL:
            faces = [[f[0], f[1], f[3], f[2]] for f in faces]
        stream = [len(faces), *(v for f in faces for v in (len(f), *f))]
        cells += [len(stream), *stream]
    grid = pv.UnstructuredGrid(cells, [pv.CellType.POLYHEDRON] * cube.n_cells, cube.points)
    grid.point_data["T"] = AMBIENT + 50.0 * grid.points[:, 0]
    field = read_field(saved(grid, tmp_path / "f.vtu"))
    assert set(field.grid.celltypes) == {pv.CellType.PYRAMID}
    assert field.grid.volume == pytest.approx(1000.0)
    assert_allclose(field.temperature_k, AMBIENT + 50.0 * field.grid.points[:, 0], rtol=1e-6)
    # Neighbours split their common faces in the same way, so the only boundary is the outer one.
    assert field.grid.extract_surface(algorithm="geometry").area == pytest.approx(600.0)


def test_surface_cells_and_loose_points_are_left_out(tmp_path):
    cube = solid(1)
    points = np.vstack([cube.points, [[99.0, 99.0, 99.0]]])
    cells = [8, *cube.cell_connectivity, 3, 0, 1, 8]
    grid = pv.UnstructuredGrid(cells, [pv.CellType.VOXEL, pv.CellType.TRIANGLE], points)
    # The value at a place without air may be anything.
    grid.point_data["T"] = np.append(AMBIENT + points[:-1, 0], np.nan)
    field = read_field(saved(grid, tmp_path / "f.vtu"))
    assert field.grid.n_points == 8
    assert_allclose(field.temperature_k, AMBIENT + field.grid.points[:, 0])
