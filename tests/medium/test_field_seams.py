"""Mirrored halves: joined at their seam, against the whole, but not where a value jumps."""

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
import vtk

from iriftrace.core.errors import InputError
from iriftrace.io.field import read_field
from iriftrace.medium.tetrahedra import tetrahedra_of
from iriftrace.medium.volume import without_seams
from validation.inputs.shell_fields import hexahedra
from validation.inputs.solved_fields import DATA

SEAM = 49


def half() -> pv.UnstructuredGrid:
    """A cube of 6 x 6 x 6 cells whose face at x = 0 is the plane of symmetry."""
    grid = hexahedra(6, 10.0)
    points = np.add(grid.points, (10.0, 0.0, 0.0))
    # A flow solver's points of symmetry are not always at +0.
    points[np.abs(points) < 1e-9] = 0.0
    grid.points = points
    x, _, z = points.T
    grid.point_data["T"] = 300.0 + 3.0 * x + 2.0 * z
    grid.point_data["U"] = np.column_stack((1.0 + x, z, 0.0 * z))
    grid.point_data["number"] = np.arange(grid.n_points)
    grid.cell_data["region"] = np.arange(grid.n_cells)
    return grid


def reflected(grid: pv.UnstructuredGrid) -> pv.UnstructuredGrid:
    """As ParaView's Reflect leaves it."""
    mirror = vtk.vtkReflectionFilter()
    mirror.SetInputData(grid)
    mirror.SetPlaneToX()
    mirror.CopyInputOn()
    mirror.Update()
    return pv.UnstructuredGrid(mirror.GetOutput())


def test_a_reflected_half_is_joined() -> None:
    solved = half()
    both = reflected(solved)
    assert both.n_points == 2 * solved.n_points
    joined = without_seams(both)
    assert joined.n_points == 2 * solved.n_points - SEAM
    assert joined.n_cells == both.n_cells
    np.testing.assert_array_equal(joined.cell_data["region"], both.cell_data["region"])
    corners = np.asarray(joined.points)[np.asarray(joined.cell_connectivity)]
    np.testing.assert_array_equal(
        corners, np.asarray(both.points)[np.asarray(both.cell_connectivity)]
    )
    found = joined.point_data["T"][np.asarray(joined.cell_connectivity)]
    np.testing.assert_array_equal(found, both.point_data["T"][np.asarray(both.cell_connectivity)])
    # Vectors point elsewhere in the mirror; those of the half that was solved stay.
    np.testing.assert_array_equal(joined.point_data["U"][: solved.n_points], solved["U"])


def test_points_stay_apart_where_a_value_jumps() -> None:
    """A thin wall at x = 0 with other temperatures on its two sides, but for one edge."""
    both = reflected(half())
    wall = np.flatnonzero(np.asarray(both.points)[:, 0] == 0.0)
    other = wall[wall >= half().n_points]
    edge = np.asarray(both.points)[other, 2] == -10.0
    both.point_data["T"][other[~edge]] += 5.0
    joined = without_seams(both)
    assert joined.n_points == both.n_points - edge.sum()
    assert joined.n_cells == both.n_cells


def test_a_grid_without_seams_is_left_as_it_is() -> None:
    grid = half()
    assert without_seams(grid) is grid
    twins = reflected(grid)
    twins.point_data["T"][grid.n_points :] += 1.0
    assert without_seams(twins) is twins


def test_a_ring_closes_where_the_sine_of_a_full_turn_is_not_zero() -> None:
    angle, radius, height = np.linspace(0.0, 2.0 * np.pi, 13), [10.0, 20.0, 30.0], [0.0, 5.0]
    angle, radius, height = np.meshgrid(angle, radius, height, indexing="ij")
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    ring = pv.StructuredGrid(x, y, height).cast_to_unstructured_grid()
    assert (np.ptp(y[[0, -1]], axis=0) > 0.0).all()
    ring.point_data["T"] = 300.0 + np.asarray(ring.points)[:, 0] + 1e-13 * np.arange(ring.n_points)
    joined = without_seams(ring)
    assert joined.n_points == ring.n_points - 6
    found = set(map(tuple, np.asarray(joined.points)))
    assert found < set(map(tuple, np.asarray(ring.points))), "places as they are in the file"


@pytest.mark.filterwarnings("ignore:The coolest air")
def test_a_reflected_field_has_no_boundary_inside(tmp_path: Path) -> None:
    path = tmp_path / "both.vtu"
    reflected(half()).save(path)
    field = read_field(path)
    tetrahedra = tetrahedra_of(field.grid)
    middles = np.asarray(field.grid.points)[tetrahedra.boundary.astype(np.int64)].mean(axis=1)
    assert (np.abs(middles).max(axis=1) > 9.9).all()
    # The gradient at the plane of symmetry lies in it.
    seam = np.asarray(field.grid.points)[:, 0] == 0.0
    assert seam.sum() == SEAM
    gradient = field.gradient[seam]
    assert np.abs(gradient[:, 0]).max() < 1e-6 * np.abs(gradient).max()


def test_cells_twice_are_refused(tmp_path: Path) -> None:
    """Reflect applied to a field that was whole already; and a block that is there twice."""
    whole = without_seams(reflected(half()))
    path = tmp_path / "twice.vtu"
    pv.merge([whole, whole.copy()], merge_points=False).save(path)
    with pytest.raises(InputError, match=f"{whole.n_cells} cells of .*twice.vtu lie where others"):
        read_field(path)
    blocks = tmp_path / "blocks.vtm"
    pv.MultiBlock([whole, whole.extract_cells(range(7))]).save(blocks)
    with pytest.raises(InputError, match=r"7 cells of .*blocks.vtm lie where others"):
        read_field(blocks)


@pytest.mark.filterwarnings("ignore:The coolest air")
def test_blocks_that_lie_in_each_other_are_refused(tmp_path: Path) -> None:
    """A coarse block of all the air and a fine one in it; not two next to each other."""
    path = tmp_path / "air.vtm"
    coarse, fine = half(), hexahedra(7, 5.0)
    fine.point_data["T"] = np.full(fine.n_points, 300.0)
    fine.point_data["U"] = np.zeros((fine.n_points, 3))
    fine.points += np.array((25.0, 0.0, 0.0), dtype=fine.points.dtype)
    pv.MultiBlock([coarse, fine]).save(path)
    assert read_field(path).grid.n_cells == coarse.n_cells + fine.n_cells
    fine.points -= np.array((15.0, 0.0, 0.0), dtype=fine.points.dtype)
    pv.MultiBlock([coarse, fine]).save(path)
    with pytest.raises(InputError, match="blocks that lie in each other"):
        read_field(path)


def test_cells_of_two_processes_without_a_mark_are_refused(tmp_path: Path) -> None:
    """Processes that write their copies of each other's cells, too, without ``vtkGhostType``."""
    for number, piece in enumerate((range(130), range(94, 216))):
        half().extract_cells(piece).save(tmp_path / f"{number}.vtu")
    path = tmp_path / "air.pvtu"
    path.write_text(
        '<VTKFile type="PUnstructuredGrid"><PUnstructuredGrid><PPointData>'
        '<PDataArray type="Float64" Name="T"/></PPointData><PPoints><PDataArray type="Float64" '
        'NumberOfComponents="3"/></PPoints><Piece Source="0.vtu"/><Piece Source="1.vtu"/>'
        "</PUnstructuredGrid></VTKFile>"
    )
    with pytest.raises(InputError, match=r"36 cells of .*air.pvtu lie where others"):
        read_field(path)


def test_flat_twins_of_polyhedra_are_no_cells_twice(tmp_path: Path) -> None:
    """A gear's quarter has such; mirrored it is read as it was solved."""
    quarter = pv.read(DATA / "bevel_gear_quarter.vtu")
    path = tmp_path / "half.vtu"
    reflected(quarter).save(path)
    assert read_field(path).grid.n_cells == 2 * quarter.n_cells
