"""Inner boundary of a field: area and place of the part's surface, never the outer boundary."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose

from iriftrace.field.read import read_field
from iriftrace.field.wall import inner_wall

CYLINDER = Path(__file__).parents[2] / "scenes" / "cylinder" / "field.vtu"


def air(keep) -> pv.UnstructuredGrid:
    """Cells of 1 mm in the cube from -8 to 8 whose centres a function keeps."""
    axis = np.linspace(-8.0, 8.0, 17)
    grid = pv.RectilinearGrid(axis, axis, axis).cast_to_unstructured_grid()
    centres = np.asarray(grid.cell_centers().points)
    return grid.extract_cells(np.flatnonzero(keep(*centres.T)))


def outside_block(x, y, z, half=3.0):
    return np.maximum(np.maximum(abs(x), abs(y)), abs(z)) > half


def test_a_cavity_is_the_wall():
    wall = inner_wall(air(outside_block))
    assert wall.area == pytest.approx(6 * 6.0**2)
    assert_allclose(np.abs(wall.points).max(axis=1), 3.0)


def test_a_stepped_outer_boundary_is_none():
    # Cropped cell by cell: all over the outside there are steps.
    def keep(x, y, z):
        return outside_block(x, y, z) & (x**2 + y**2 + z**2 < 7.5**2)

    assert inner_wall(air(keep)).area == pytest.approx(6 * 6.0**2)


def test_two_parts_have_two_walls():
    def keep(x, y, z):
        return outside_block(x - 5, y, z, 2.0) & outside_block(x + 5, y, z, 1.0)

    assert inner_wall(air(keep)).area == pytest.approx(6 * (4.0**2 + 2.0**2))


def test_on_a_quarter_domain_the_symmetry_planes_are_no_walls():
    def keep(x, y, z):
        return outside_block(x, y, z) & (x > 0) & (y > 0)

    assert inner_wall(air(keep)).area == pytest.approx(2 * 3.0**2 + 2 * 3.0 * 6.0)


def test_air_without_a_part_has_no_wall():
    wall = inner_wall(air(lambda x, y, z: x < 99))
    assert (wall.n_cells, wall.n_points) == (0, 0)


def test_mirrored_cells_have_the_same_wall():
    # Mirroring turns the cells, and with them the order of the corners of their faces.
    grid = air(outside_block)
    grid.points *= (-1.0, 1.0, 1.0)
    assert inner_wall(grid).area == pytest.approx(6 * 6.0**2)


def test_the_wall_of_the_bundled_field_is_the_cylinder():
    field = read_field(CYLINDER)
    wall = field.wall
    assert_allclose(wall.bounds, (-85.0, 85.0, -13.5, 13.5, -13.5, 13.5), atol=1e-4)
    # Coarse cells cut the corner between the heads and the lateral surface.
    area = 2 * np.pi * 13.5 * 170.0 + 2 * np.pi * 13.5**2
    assert wall.area == pytest.approx(area, rel=0.01)
    hot = field.air.temperature(np.asarray(wall.point_data["refractivity"]))
    assert np.median(hot) == pytest.approx(1373.15, abs=1.0)
