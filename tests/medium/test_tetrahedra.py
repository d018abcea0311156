"""Cells split into tetrahedra: volumes add up, faces are shared whole, counts made by hand."""

import numpy as np
import pytest
import pyvista as pv

from iriftrace.core.errors import InputError
from iriftrace.io.field import read_field
from iriftrace.medium.tetrahedra import BOUNDARY, OPPOSITE, Tetrahedra, tetrahedra_of
from iriftrace.scenes import folder_of
from validation.inputs.shell_fields import hexahedra


def volumes(grid: pv.UnstructuredGrid, found: Tetrahedra) -> np.ndarray:
    corners = np.asarray(grid.points, dtype=float)[found.corners]
    return np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6


def assert_links_are_mutual(found: Tetrahedra) -> None:
    """Neighbours name each other, by the same three points; the rest is the boundary."""
    flat = found.neighbours.ravel()
    inner = np.flatnonzero(flat < BOUNDARY)
    np.testing.assert_array_equal(flat[flat[inner]], inner)
    faces = np.sort(found.corners[:, OPPOSITE].reshape(-1, 3), axis=1)
    np.testing.assert_array_equal(faces[inner], faces[flat[inner]])
    outer = np.flatnonzero(flat >= BOUNDARY)
    np.testing.assert_array_equal(flat[outer] - BOUNDARY, np.arange(len(found.boundary)))
    np.testing.assert_array_equal(found.boundary_place, outer)
    np.testing.assert_array_equal(np.sort(found.boundary, axis=1), faces[outer])


def shuffled(grid: pv.UnstructuredGrid, seed: int) -> pv.UnstructuredGrid:
    """The same cells with their points in another order, so that other diagonals are taken."""
    order = np.random.default_rng(seed).permutation(grid.n_points)
    number = np.argsort(order)
    other = pv.UnstructuredGrid()
    other.copy_structure(grid)
    points = np.asarray(grid.points)[order]
    cells = pv.UnstructuredGrid(_cells(grid, number), grid.celltypes, points)
    return cells


def _cells(grid: pv.UnstructuredGrid, number: np.ndarray) -> np.ndarray:
    pieces = np.split(np.asarray(grid.cell_connectivity), np.asarray(grid.cell_offsets)[1:-1])
    return np.concatenate([[len(p), *number[p]] for p in pieces])


def mixed() -> pv.UnstructuredGrid:
    """A hexahedron, a wedge on its side, a pyramid on its top and a tetrahedron on that."""
    points = np.array(
        [
            *([0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]),
            *([0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]),
            *([2, 0, 0], [2, 0, 1], [0.5, 0.5, 2], [0.5, -1, 2]),
        ],
        dtype=float,
    )
    cells = [8, *range(8), 6, 1, 8, 2, 5, 9, 6, 5, 4, 5, 6, 7, 10, 4, 4, 5, 10, 11]
    return pv.UnstructuredGrid(cells, [12, 13, 14, 10], points)


@pytest.mark.parametrize("seed", range(12))
def test_mixed_cells_fill_their_space_whatever_the_order_of_points(seed: int) -> None:
    grid = shuffled(mixed(), seed)
    found = tetrahedra_of(grid)
    assert len(found.corners) == 6 + 3 + 2 + 1
    assert np.abs(volumes(grid, found)).min() > 0.01
    expected = 1 + 0.5 + 1 / 3 + abs(np.linalg.det([[1, 0, 0], [0.5, 0.5, 1], [0.5, -1, 1]])) / 6
    assert np.abs(volumes(grid, found)).sum() == pytest.approx(expected)
    assert_links_are_mutual(found)
    # 5 + 3 of the hexahedron and wedge are outside, and so on: counted by hand.
    assert len(found.boundary) == 2 * 4 + (1 + 1 + 2 + 2) + 3 + 3
    assert found.corners.dtype == np.uint32


def test_hexahedra_share_all_faces() -> None:
    grid = shuffled(hexahedra(4, 10.0), 3)
    found = tetrahedra_of(grid)
    assert len(found.corners) == 6 * 64
    assert volumes(grid, found).min() > 0
    assert volumes(grid, found).sum() == pytest.approx(8000)
    assert len(found.boundary) == 6 * 16 * 2
    assert_links_are_mutual(found)


def test_real_field_has_no_boundary_but_its_wall_and_its_box() -> None:
    field = read_field(folder_of("cylinder") / "field.vtu")
    found = tetrahedra_of(field.grid)
    assert_links_are_mutual(found)
    surface = field.grid.extract_surface(algorithm="geometry").triangulate()
    assert len(found.boundary) == surface.n_cells
    # VTK splits the warped quadrilaterals otherwise.
    assert volumes(field.grid, found).sum() == pytest.approx(field.grid.volume, rel=2e-3)


def test_flat_twins_of_a_point_in_the_middle_of_an_edge_vanish() -> None:
    """As in decomposed polyhedra: m halves the edge a-b, and two pyramids have a-m-b in the base.

    Their tetrahedra (a, m, b, apex) are flat, the same, and turned against each other.
    """
    a, b, m, apex = 0, 1, 2, 3
    points = np.array(
        [[0, 0, 0], [2, 0, 0], [1, 0, 0], [1, 0, 1], [1, 2, 0], [1, -2, 0]], dtype=float
    )
    cells = [5, a, m, b, 4, apex, 5, b, m, a, 5, apex]
    grid = pv.UnstructuredGrid(cells, [14, 14], points)
    found = tetrahedra_of(grid)
    assert len(found.corners) == 2
    assert np.abs(volumes(grid, found)).min() > 0.1
    assert_links_are_mutual(found)
    assert len(found.boundary) == 6


def test_duplicate_cells_are_refused() -> None:
    grid = pv.UnstructuredGrid(
        [4, 0, 1, 2, 3, 4, 0, 1, 2, 4, 4, 0, 1, 2, 5],
        [10, 10, 10],
        np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1], [1, 1, 1.0]]),
    )
    with pytest.raises(InputError, match="have a common face"):
        tetrahedra_of(grid)


@pytest.mark.parametrize("mirrored", [False, True])
def test_order_of_corners_does_not_look_like_cells_turned_inside_out(mirrored: bool) -> None:
    """Wedges in the other of the two usual orders, a mirrored field, tetrahedra in any order."""
    grid = mixed()
    cells = np.array(grid.cells)
    wedge = slice(10, 16)
    cells[wedge] = cells[wedge][[3, 4, 5, 0, 1, 2]]
    points = np.asarray(grid.points) * (-1 if mirrored else 1, 1, 1)
    other = pv.UnstructuredGrid(cells, grid.celltypes, points)
    assert volumes(other, tetrahedra_of(other)).min() > 0.01
    random = np.random.default_rng(0)
    corners = tetrahedra_of(shuffled(hexahedra(3, 10.0), 1)).corners.astype(np.int64)
    points = np.asarray(shuffled(hexahedra(3, 10.0), 1).points)
    anyhow = pv.UnstructuredGrid({pv.CellType.TETRA: random.permuted(corners, axis=1)}, points)
    assert volumes(anyhow, tetrahedra_of(anyhow)).min() > 0.01


def folded() -> pv.UnstructuredGrid:
    """A cube of 20 mm in which a point lies beyond its neighbour."""
    grid = hexahedra(6, 10.0)
    points = np.array(grid.points)
    middle = int(np.linalg.norm(points, axis=1).argmin())
    points[middle] += (5.0, 0.5, 0.3)
    grid.points = points
    return grid


def test_cells_that_are_inside_out_stay_so() -> None:
    grid = folded()
    found = volumes(grid, tetrahedra_of(grid))
    assert 0 < (found < 0).sum() < 10
    assert found.sum() == pytest.approx(8000)


def test_cells_that_are_inside_out_stay_so_where_half_a_field_is_a_mirror_image() -> None:
    """As users complete a quarter that was solved; the image's cells have the other hand."""
    half = folded()
    image = pv.UnstructuredGrid(half.cells, half.celltypes, np.asarray(half.points) * (-1, 1, 1))
    half.points = np.add(half.points, (10, 0, 0))
    image.points = np.subtract(image.points, (10, 0, 0))
    whole = pv.merge([half, image], merge_points=True)
    assert whole.n_points == 2 * half.n_points - 49
    tetrahedra = tetrahedra_of(whole)
    assert_links_are_mutual(tetrahedra)
    found = volumes(whole, tetrahedra)
    assert 0 < (found < 0).sum() < 20
    assert -found[found < 0].sum() < 0.01 * 16_000
    assert found.sum() == pytest.approx(16_000)
