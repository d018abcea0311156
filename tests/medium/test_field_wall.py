"""Inner boundary of a field: area and place of the part's surface, never the outer boundary."""

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose

from iriftrace.io.field import read_field
from iriftrace.medium.wall import inner_wall

CYLINDER = Path(__file__).parents[2] / "scenes" / "cylinder" / "field.vtu"


def air(keep) -> pv.UnstructuredGrid:
    """Cells of 1 mm in the cube from -8 to 8 whose centres a function keeps."""
    axis = np.linspace(-8.0, 8.0, 17)
    grid = pv.RectilinearGrid(axis, axis, axis).cast_to_unstructured_grid()
    centres = np.asarray(grid.cell_centers().points)
    return grid.extract_cells(np.flatnonzero(keep(*centres.T)))


def outside_block(x, y, z, half=3.0):
    return np.maximum(np.maximum(abs(x), abs(y)), abs(z)) > half


BLOCK = 6 * 6.0**2
WALLS = {
    "cavity": (outside_block, BLOCK),
    # Cropped cell by cell: all over the outside there are steps.
    "stepped outside": (
        lambda x, y, z: outside_block(x, y, z) & (x**2 + y**2 + z**2 < 7.5**2),
        BLOCK,
    ),
    "two parts": (
        lambda x, y, z: outside_block(x - 5, y, z, 2.0) & outside_block(x + 5, y, z, 1.0),
        6 * (4.0**2 + 2.0**2),
    ),
    "symmetry planes are no walls": (
        lambda x, y, z: outside_block(x, y, z) & (x > 0) & (y > 0),
        2 * 3.0**2 + 2 * 3.0 * 6.0,
    ),
}


@pytest.mark.parametrize(("keep", "area"), WALLS.values(), ids=WALLS)
@pytest.mark.parametrize("mirrored", [False, True])
def test_the_wall_is_what_a_cavity_has(keep, area, mirrored):
    """Mirroring turns the cells, and with them the order of the corners of their faces."""
    grid = air(keep)
    grid.points *= (-1.0 if mirrored else 1.0, 1.0, 1.0)
    wall = inner_wall(grid)
    assert wall.area == pytest.approx(area)
    if keep is outside_block:
        assert_allclose(np.abs(wall.points).max(axis=1), 3.0)


def cells_between(axes, keep) -> pv.UnstructuredGrid:
    grid = pv.RectilinearGrid(*map(np.asarray, axes)).cast_to_unstructured_grid()
    return grid.extract_cells(np.flatnonzero(keep(*np.asarray(grid.cell_centers().points).T)))


def test_a_part_in_a_wide_room_has_a_wall():
    """A cube of 6 mm in a stepped ball of 380 mm, whose boundary has 2000 times its area."""
    half = np.array((0.0, 3.0, 20.0, 50.0, 100.0, 150.0, 200.0))
    axis = np.concatenate((-half[:0:-1], half))
    grid = cells_between(
        [axis] * 3, lambda x, y, z: outside_block(x, y, z) & (x**2 + y**2 + z**2 < 190.0**2)
    )
    assert inner_wall(grid).area == pytest.approx(BLOCK)


def test_a_small_part_has_a_wall_next_to_a_table():
    """A bar of 26 x 26 x 170 mm has 0.8 per mille of the area of a room of 2 m."""
    axes = ((-1e3, -13, 13, 400, 800, 1e3), (-1e3, -13, 13, 400, 1e3), (-1e3, -600, 0, 170, 1e3))

    def air_at(x, y, z):
        table = (x > 400) & (x < 800) & (y > 13) & (y < 400) & (z > -600) & (z < 0)
        bar = (abs(x) < 13) & (abs(y) < 13) & (z > 0) & (z < 170)
        return ~table & ~bar

    bar, table = 2 * 26**2 + 4 * 26 * 170, 2 * (400 * 387 + 400 * 600 + 387 * 600)
    assert inner_wall(cells_between(axes, air_at)).area == pytest.approx(bar + table)


def test_a_missing_cell_hides_no_part_on_a_symmetry_plane():
    """The part's wall is found without the sides of the box; the hole encloses air anyway."""
    across = (-1e3, -400, -80, 0, 1, 80, 400, 1e3)
    axes = (across, across, (0, 80, 90, 91, 400, 1e3))

    def air_at(x, y, z):
        hole = (x > 0) & (x < 1) & (y > 0) & (y < 1) & (z > 90) & (z < 91)
        return ~hole & ~((abs(x) < 80) & (abs(y) < 80) & (z < 80))

    assert inner_wall(cells_between(axes, air_at)).area == pytest.approx(160**2 + 4 * 160 * 80)


def test_air_without_a_part_has_no_wall():
    wall = inner_wall(air(lambda x, y, z: x < 99))
    assert (wall.n_cells, wall.n_points) == (0, 0)


def test_the_wall_of_the_bundled_field_is_the_cylinder():
    field = read_field(CYLINDER)
    wall = field.wall
    assert_allclose(wall.bounds, (-85.0, 85.0, -13.5, 13.5, -13.5, 13.5), atol=1e-4)
    # Coarse cells cut the corner between the heads and the lateral surface.
    area = 2 * np.pi * 13.5 * 170.0 + 2 * np.pi * 13.5**2
    assert wall.area == pytest.approx(area, rel=0.01)
    hot = field.air.temperature(np.asarray(wall.point_data["refractivity"]))
    assert np.median(hot) == pytest.approx(1373.15, abs=1.0)


@pytest.mark.parametrize("degrees", [5.0, 30.0, 61.0])
def test_the_sides_of_a_sector_are_no_walls(degrees):
    """Planes that are not sides of the bounding box enclose nothing, whatever rounding says."""
    angle = np.radians(np.linspace(-0.5, 0.5, 2) * degrees)
    radius, height = 10.0 + 30.0 * np.linspace(0.0, 1.0, 16) ** 2, np.linspace(-20.0, 20.0, 9)
    angle, radius, z = np.meshgrid(angle, radius, height, indexing="ij")
    sector = pv.StructuredGrid(radius * np.cos(angle), radius * np.sin(angle), z)
    assert inner_wall(sector.cast_to_unstructured_grid()).n_points == 0
