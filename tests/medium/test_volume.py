"""File types and cell types: volume and values of one linear grid against a box of known size."""

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose, assert_array_equal
from vtkmodules.vtkCommonDataModel import vtkCellTypeUtilities

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.field import read_field
from iriftrace.io.vtk_check import _FEWEST, _SIZES
from iriftrace.medium.gradient import CORNERS
from iriftrace.medium.polyhedra import SPLIT
from iriftrace.medium.volume import _CONVEX_SET, _HIGHER_ORDER, _VOXEL
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


def air_and_support() -> pv.MultiBlock:
    """Air around a support that is hotter, and of which a solver writes no velocity."""
    grid = solid(6)
    grid["T"] = np.full(grid.n_points, AMBIENT)
    inside = (np.abs(grid.cell_centers().points - 5.0) < 2.0).all(axis=1)
    air, support = (grid.extract_cells(np.flatnonzero(mask)) for mask in (~inside, inside))
    support["T"] = np.full(support.n_points, AMBIENT + 600.0)
    air["T"] = np.where(
        np.isin(air["vtkOriginalPointIds"], support["vtkOriginalPointIds"]),
        AMBIENT + 600.0,
        AMBIENT,
    )
    blocks = pv.MultiBlock()
    for name, block in (("air", air), ("support", support)):
        block.clear_cell_data()
        del block.point_data["vtkOriginalPointIds"]
        blocks.append(block, name)
    return blocks


@pytest.mark.parametrize("velocity", ["U", "x-velocity"])
@pytest.mark.parametrize("name", ["cht.vtm", "cht.pvd"])
def test_blocks_without_a_velocity_next_to_one_with_it_are_solids(tmp_path, velocity, name):
    blocks = air_and_support()
    air = blocks["air"]
    for array in ("U",) if velocity == "U" else [f"{axis}-velocity" for axis in "xyz"]:
        air[array] = np.zeros((air.n_points, 3) if array == "U" else air.n_points)
    path = tmp_path / name
    if name.endswith(".vtm"):
        blocks.save(path)
    else:
        sets = ""
        for part, key in enumerate(blocks.keys()):
            blocks[key].save(tmp_path / f"{key}.vtu")
            sets += f'<DataSet timestep="1" part="{part}" file="{key}.vtu"/>'
        path.write_text(f'<VTKFile type="Collection"><Collection>{sets}</Collection></VTKFile>')
    with pytest.warns(IriftraceWarning, match="velocity in some blocks, but none in support"):
        field = read_field(path)
    assert field.grid.n_cells == air.n_cells
    assert np.isnan(field.sample(np.array([[5.0, 5.0, 5.0]]))).all()
    assert field.wall.area == pytest.approx(6 * (10.0 / 3.0) ** 2, rel=1e-6)


def test_blocks_are_all_air_where_none_has_a_velocity(tmp_path):
    air_and_support().save(tmp_path / "two.vtm")
    assert read_field(tmp_path / "two.vtm").grid.volume == pytest.approx(1000.0)


def test_higher_order_cells_keep_their_corners(tmp_path):
    grid = pv.examples.cells.QuadraticHexahedron()
    grid.point_data["T"] = AMBIENT + grid.points[:, 0]
    path = saved(grid, tmp_path / "f.vtu")
    with pytest.warns(IriftraceWarning, match="higher order"):
        field = read_field(path)
    assert field.grid.n_points == 8
    assert_array_equal(field.grid.celltypes, [pv.CellType.HEXAHEDRON])
    assert_allclose(field.temperature_k, AMBIENT + field.grid.points[:, 0])


@pytest.mark.parametrize("kind", [74, 78, 79, 80, 81])
def test_lagrange_pyramids_and_bezier_cells_keep_their_corners(tmp_path, kind):
    """Quadratic ones; their further points are where the edges of linear cells have none."""
    target, count = {
        74: (pv.CellType.PYRAMID, 14),
        78: (pv.CellType.TETRA, 10),
        79: (pv.CellType.HEXAHEDRON, 27),
        80: (pv.CellType.WEDGE, 18),
        81: (pv.CellType.PYRAMID, 14),
    }[kind]
    corners = np.asarray(
        {
            pv.CellType.PYRAMID: pv.examples.cells.Pyramid,
            pv.CellType.TETRA: pv.examples.cells.Tetrahedron,
            pv.CellType.HEXAHEDRON: pv.examples.cells.Hexahedron,
            pv.CellType.WEDGE: pv.examples.cells.Wedge,
        }[target]().points
    )
    further = np.random.default_rng(kind).uniform(0.2, 0.4, (count - len(corners), 3))
    points = np.concatenate((corners, corners.mean(axis=0) + further))
    # Next to a linear cell, which alone would be left.
    cube = solid(1)
    cells = [count, *range(count), 8, *(count + cube.cell_connectivity)]
    grid = pv.UnstructuredGrid(
        cells, [kind, pv.CellType.VOXEL], np.concatenate((points, cube.points + 50.0))
    )
    grid.point_data["T"] = AMBIENT + grid.points[:, 0] - grid.points[:, 0].min()
    with pytest.warns(IriftraceWarning, match="higher order"):
        field = read_field(saved(grid, tmp_path / "f.vtu"))
    assert set(field.grid.celltypes) == {target, pv.CellType.HEXAHEDRON}
    assert field.grid.n_points == len(corners) + 8


def test_every_volume_cell_that_a_file_may_have_is_read():
    """Otherwise it would be left out without a word."""
    kinds = (*_SIZES, *_FEWEST)
    volumes = {kind for kind in kinds if vtkCellTypeUtilities.GetDimension(kind) == 3}
    assert volumes == {*CORNERS, _VOXEL, _CONVEX_SET, *SPLIT, *_HIGHER_ORDER}


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
