"""Gradients and means over cells split into tetrahedra: exactness, symmetry, bad cells."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from iriftrace.field.gradient import point_gradient, point_mean

# A row of unit cubes along x, each made of other cells, with corners 0..3 at its left, 4..7 at its
# right, and 8 in its middle.
CUBES = {
    pv.CellType.HEXAHEDRON: [(0, 1, 2, 3, 4, 5, 6, 7)],
    pv.CellType.WEDGE: [(0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7)],
    pv.CellType.PYRAMID: [
        *((0, 1, 2, 3, 8), (4, 7, 6, 5, 8), (0, 4, 5, 1, 8)),
        *((1, 5, 6, 2, 8), (2, 6, 7, 3, 8), (3, 7, 4, 0, 8)),
    ],
    pv.CellType.TETRA: [(0, 1, 3, 4), (1, 2, 3, 6), (1, 4, 5, 6), (3, 6, 7, 4), (1, 3, 4, 6)],
}


def row_of_cubes() -> pv.UnstructuredGrid:
    square = np.array([(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)], dtype=float)
    count = len(CUBES)
    layers = [square + np.array([x, 0, 0]) for x in range(count + 1)]
    middle = (list(CUBES).index(pv.CellType.PYRAMID) + 0.5, 0.5, 0.5)
    points = np.vstack([*layers, middle])
    cells, types = [], []
    for place, (kind, parts) in enumerate(CUBES.items()):
        for part in parts:
            cells += [len(part), *(len(points) - 1 if c == 8 else 4 * place + c for c in part)]
            types.append(kind)
    return pv.UnstructuredGrid(cells, types, points)


def cubes(cells: int) -> pv.UnstructuredGrid:
    """Hexahedra in the cube from -1 to 1."""
    axis = np.linspace(-1.0, 1.0, cells + 1)
    return pv.StructuredGrid(
        *np.meshgrid(axis, axis, axis, indexing="ij")
    ).cast_to_unstructured_grid()


def test_the_row_of_cubes_is_what_it_should_be():
    # Otherwise the tests below would prove nothing about a type of cell.
    grid = row_of_cubes()
    assert set(grid.celltypes) == set(CUBES)
    sizes = grid.compute_cell_sizes(length=False, area=False).cell_data["Volume"]
    assert grid.volume == pytest.approx(4.0)
    assert sizes.min() > 0.1


@given(
    st.integers(0, 2**32 - 1),
    st.tuples(*[st.floats(-10.0, 10.0)] * 4),
    st.floats(0.0, 0.4),
)
def test_linear_fields_have_exact_gradients_in_all_cells(seed, coefficients, jitter):
    # The gradient of a linear function is constant in every tetrahedron, however bent or inverted
    # the cells are.
    grid = row_of_cubes()
    grid.points += np.random.default_rng(seed).uniform(-jitter, jitter, grid.points.shape)
    offset, *slope = coefficients
    values = np.asarray(grid.points, float) @ slope + offset
    gradient = point_gradient(grid, values)
    assert_allclose(gradient, np.broadcast_to(slope, gradient.shape), atol=1e-10)


def test_several_quantities_at_a_time_have_the_gradients_of_each():
    grid = row_of_cubes()
    values = np.random.default_rng(1).normal(size=(grid.n_points, 2))
    gradients = point_gradient(grid, values)
    for number, column in enumerate(values.T):
        assert_array_equal(gradients[:, number], point_gradient(grid, column))


def test_quadratic_fields_have_exact_gradients_inside_regular_hexahedra():
    # Central differences: this needs a split that favours no diagonal.
    grid = cubes(4)
    x, y, z = np.asarray(grid.points, float).T
    gradient = point_gradient(grid, x**2 - 2 * y**2 + x * y + 3 * y * z)
    inside = np.abs(grid.points).max(axis=1) < 0.99
    expected = np.column_stack([2 * x + y, -4 * y + x + 3 * z, 3 * y])
    assert inside.sum() == 27
    assert_allclose(gradient[inside], expected[inside], atol=1e-12)


def test_mirrored_cells_give_the_mirrored_gradient():
    # Half domains are solved and mirrored, which turns cells inside out.
    grid = row_of_cubes()
    values = np.sin(np.asarray(grid.points, float) @ [1.0, 2.0, 3.0])
    gradient = point_gradient(grid, values)
    grid.points *= (1.0, -1.0, 1.0)
    assert_allclose(point_gradient(grid, values), gradient * (1.0, -1.0, 1.0), atol=1e-12)


def test_a_sliver_does_not_spoil_the_gradient():
    # Two good tetrahedra and a sliver of 1e-6 of their volume between the same points, in which
    # the values differ across almost no height, as decomposed polyhedra leave them.
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1e-6), (0, 0, -1)], float)
    good = [4, 0, 1, 2, 3, 4, 0, 2, 1, 5]
    sliver = [4, 0, 1, 2, 4]
    values = points @ [1.0, 2.0, 3.0]
    values[4] += 0.01
    clean = pv.UnstructuredGrid(good, [10, 10], points)
    spoilt = pv.UnstructuredGrid(good + sliver, [10, 10, 10], points)
    spoilt.point_data["v"] = values
    unweighted = spoilt.compute_derivative("v", gradient="g").point_data["g"]
    assert np.abs(unweighted[0] - (1.0, 2.0, 3.0)).max() > 1000.0
    assert_allclose(point_gradient(spoilt, values)[0], (1.0, 2.0, 3.0), atol=0.006)
    assert_allclose(point_gradient(clean, values)[0], (1.0, 2.0, 3.0), atol=1e-12)


def test_flat_cells_give_no_gradient_and_no_nonsense():
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], float)
    grid = pv.UnstructuredGrid([4, 0, 1, 2, 3], [10], points)
    assert_array_equal(point_gradient(grid, np.arange(4.0)), np.zeros((4, 3)))
    assert_allclose(point_mean(grid, np.array([7.0])), 7.0)


def test_means_are_weighted_with_the_volumes_of_all_types():
    # Each cube counts as its volume whatever it is cut into: between two cubes the mean is theirs.
    grid = row_of_cubes()
    cube = np.floor(np.asarray(grid.cell_centers().points)[:, 0])
    mean = point_mean(grid, cube)
    volume = np.abs(grid.compute_cell_sizes().cell_data["Volume"])
    for point in range(grid.n_points):
        around = grid.point_cell_ids(point)
        expected = np.average(cube[around], weights=volume[around])
        assert mean[point] == pytest.approx(expected, rel=1e-12)


def test_cells_of_different_types_count_by_their_volume():
    # A field that is 0 in a pyramid and rises to 1 in a tetrahedron on one of its sides.
    points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, 1), (2, 0.5, 0.5)]
    grid = pv.UnstructuredGrid([5, 0, 1, 2, 3, 4, 4, 1, 2, 4, 5], [14, 10], np.array(points))
    values = np.array([0.0, 0, 0, 0, 0, 1])
    edges = np.array(points)[[2, 4, 5]] - np.array(points)[1]
    risen, tetrahedron = np.linalg.solve(edges, [0.0, 0.0, 1.0]), abs(np.linalg.det(edges)) / 6
    expected = risen * tetrahedron / (tetrahedron + 1.0 / 3.0)
    assert_allclose(point_gradient(grid, values)[4], expected, atol=1e-12)
