"""Splitting cells adds triangles to surfaces of equal index and moves none of them."""

import numpy as np
import pytest

from iriftrace.core.mesh.triangles import area_vectors
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.shells.contour import contour_shells
from validation.inputs.shell_fields import sphere_field
from validation.paper.split_cells import as_tetrahedra, split_tetrahedra


def volume(field: IndexField) -> np.ndarray:
    sizes = field.grid.compute_cell_sizes(length=False, area=False, volume=True)
    return np.abs(np.asarray(sizes.cell_data["Volume"]))


def area(field: IndexField) -> np.ndarray:
    shells = contour_shells(field, 3, rule="midpoint", min_size_mm=0.0).shells
    return np.array(
        [np.linalg.norm(area_vectors(s.vertices, s.faces), axis=1).sum() for s in shells]
    )


def test_eighths_fill_the_tetrahedron() -> None:
    whole = as_tetrahedra(sphere_field(cells=4))
    split = split_tetrahedra(whole)
    assert split.grid.n_cells == 8 * whole.grid.n_cells
    # Every eighth has an eighth of the volume: the cut at the middles is Bey's (1995).
    np.testing.assert_allclose(
        volume(split).reshape(-1, 8), np.repeat(volume(whole)[:, None] / 8, 8, axis=1), rtol=1e-5
    )


def test_a_split_field_has_the_same_surfaces_with_more_triangles() -> None:
    whole = as_tetrahedra(sphere_field(cells=12))
    split = split_tetrahedra(whole)
    before, after = contour_shells(whole, 3), contour_shells(split, 3)
    assert after.triangles > 3 * before.triangles
    np.testing.assert_allclose(area(split), area(whole), rtol=2e-6)
    for one, other in zip(before.shells, after.shells, strict=True):
        np.testing.assert_allclose(
            [other.vertices.min(axis=0), other.vertices.max(axis=0)],
            [one.vertices.min(axis=0), one.vertices.max(axis=0)],
            atol=2e-5,
        )


def test_hexahedra_are_not_linear_so_tetrahedra_move_their_surfaces() -> None:
    field = sphere_field(cells=12)
    # The third surface is smaller than a cell.
    change = (area(as_tetrahedra(field)) / area(field) - 1.0)[:2]
    assert np.all(np.abs(change) > 1e-4)
    assert np.all(np.abs(change) < 0.02)


def test_values_and_points_of_the_field_stay() -> None:
    field = sphere_field(cells=6)
    split = split_tetrahedra(as_tetrahedra(field))
    count = field.grid.n_points
    np.testing.assert_allclose(split.grid.points[:count], field.grid.points)
    np.testing.assert_array_equal(split.refractivity[:count], field.refractivity)
    assert split.hottest_refractivity == pytest.approx(field.hottest_refractivity, rel=1e-12)
