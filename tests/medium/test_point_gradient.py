"""Recovered gradients and means: exact for linear fields, symmetric, right lengths, bad cells."""

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from iriftrace.medium.cell_means import point_means
from iriftrace.medium.gradient import cell_centroids, consistent_gradient, point_gradient
from iriftrace.medium.tetrahedra import tetrahedra_of
from validation.inputs.shell_fields import field_of, hexahedra

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
    assert_allclose(cell_centroids(grid), [(0.5, 0.5, 0.0)])
    assert_allclose(point_means(grid, np.array([7.0])), 7.0)


def test_centroids_of_all_types_are_their_centres_of_volume():
    grid = row_of_cubes()
    volume = np.abs(grid.compute_cell_sizes().cell_data["Volume"])
    cube = np.floor(np.asarray(grid.cell_centers().points)[:, 0]).astype(int)
    moment = volume[:, None] * cell_centroids(grid)
    for number in range(len(CUBES)):
        assert_allclose(moment[cube == number].sum(axis=0), (number + 0.5, 0.5, 0.5), atol=1e-12)


def test_cells_of_different_types_count_by_their_volume():
    # A field that is 0 in a pyramid and rises to 1 in a tetrahedron on one of its sides.
    points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, 1), (2, 0.5, 0.5)]
    grid = pv.UnstructuredGrid([5, 0, 1, 2, 3, 4, 4, 1, 2, 4, 5], [14, 10], np.array(points))
    values = np.array([0.0, 0, 0, 0, 0, 1])
    edges = np.array(points)[[2, 4, 5]] - np.array(points)[1]
    risen, tetrahedron = np.linalg.solve(edges, [0.0, 0.0, 1.0]), abs(np.linalg.det(edges)) / 6
    expected = risen * tetrahedron / (tetrahedron + 1.0 / 3.0)
    assert_allclose(point_gradient(grid, values)[4], expected, atol=1e-12)


def graded_layers() -> tuple[pv.UnstructuredGrid, np.ndarray, np.ndarray]:
    """Air over a hot wall at z = 0, in cells that grow by a fifth from layer to layer."""
    heights = np.concatenate(([0.0], np.cumsum(0.2 * 1.2 ** np.arange(16))))
    sides = np.linspace(-3, 3, 7)
    grid = pv.StructuredGrid(*np.meshgrid(sides, sides, heights, indexing="ij"))
    grid = grid.cast_to_unstructured_grid()
    z = np.asarray(grid.points)[:, 2].astype(float)
    return grid, 2.7e-4 - 2e-4 * np.exp(-z / 3), 2e-4 / 3 * np.exp(-z / 3)


def corrected(grid: pv.UnstructuredGrid, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The gradient as it is recovered, and with the right lengths."""
    first = point_gradient(grid, values)
    return first, consistent_gradient(grid.points, tetrahedra_of(grid).corners, values, first)


def test_lengths_come_near_the_truth_at_the_wall_and_where_cells_grow() -> None:
    """From 3.3 % to 0.9 % at the wall, where cells are on one side only; inside to a half."""
    grid, values, slope = graded_layers()
    z = np.asarray(grid.points)[:, 2]
    wall, inside = z == 0, (z > 0) & (z < 8)
    first, second = (
        np.abs(np.linalg.norm(gradient, axis=1) / slope - 1) for gradient in corrected(grid, values)
    )
    assert first[wall].min() > 0.025
    assert second[wall].max() < 0.0125
    assert np.median(second[inside]) < 0.6 * np.median(first[inside])


def test_second_derivatives_come_of_the_right_lengths() -> None:
    """Off by 25 % of those at the wall there, 4.5 % beside it, 0.5 % farther: half as it was."""
    grid, values, slope = graded_layers()
    sides, z = np.abs(grid.points[:, :2]).max(axis=1), np.asarray(grid.points)[:, 2]
    truth = np.zeros((len(z), 3, 3))
    truth[:, 2, 2] = -slope / 3
    off = np.abs(field_of(grid, values).hessian - truth).max(axis=(1, 2))
    off /= np.abs(truth).max()
    middle = sides < 1.5
    assert off[middle & (z == 0)].max() < 0.35
    assert off[middle & (z > 0) & (z < 1)].max() < 0.09
    assert off[middle & (z > 1) & (z < 8)].max() < 0.008


def test_directions_stay() -> None:
    grid, values, _ = graded_layers()
    values = values * (1 + 0.1 * np.asarray(grid.points)[:, 0])
    first, second = corrected(grid, values)
    lengths = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
    np.testing.assert_allclose(np.linalg.norm(np.cross(first, second), axis=1), 0, atol=1e-20)
    np.testing.assert_allclose(np.einsum("ij,ij->i", first, second), lengths, rtol=1e-12)


def test_linear_field_needs_no_correction() -> None:
    grid = hexahedra(5, 10.0)
    values = 2e-4 + np.asarray(grid.points) @ (1e-6, 2e-6, -3e-6)
    first, second = corrected(grid, values)
    np.testing.assert_allclose(second, first, rtol=1e-9)


def test_constant_field_and_repeated_points_give_zero_and_no_nan() -> None:
    grid = hexahedra(3, 10.0)
    points = np.array(grid.points)
    points[5] = points[4]
    grid.points = points
    first, second = corrected(grid, np.full(grid.n_points, 2e-4))
    np.testing.assert_array_equal(first, 0)
    np.testing.assert_array_equal(second, 0)


def test_sums_over_many_blocks_are_those_over_one(monkeypatch: pytest.MonkeyPatch) -> None:
    grid, values, _ = graded_layers()
    whole = corrected(grid, values)
    monkeypatch.setattr("iriftrace.medium.gradient.SMALLEST_BLOCK", 3)
    for blocks, one in zip(corrected(grid, values), whole, strict=True):
        assert_allclose(blocks, one, rtol=0, atol=1e-13 * np.abs(one).max())
