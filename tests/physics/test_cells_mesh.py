"""The cells engine on cells: exact where the field is linear, near the truth where it is not.

The meshes are made to be unpleasant: random tetrahedra, cells turned inside out, blocks that touch
without sharing points, a part that does not fit the wall. Slab and hot cylinder on fine cells are
figures of the accuracy page, which `test_cells_exact` computes.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
import trimesh
from scipy.spatial import Delaunay

from iriftrace.medium.path_data import cells_of
from iriftrace.plugins.kernels.tetrahedra import TetrahedralAir
from validation.inputs.shell_fields import field_of, hexahedra
from validation.inputs.small_scenes import part
from validation.inputs.smooth_medium import Ends, follow

pytestmark = pytest.mark.usefixtures("variant")

SLOPE = np.array((1e-6, -2e-6, 3e-6))


def air_of(
    grid: Any, refractivity: Callable[[np.ndarray], np.ndarray], *, recovered: bool = True
) -> TetrahedralAir:
    return TetrahedralAir(cells_of(field_of(grid, refractivity)), recovered)


def linear(points: np.ndarray) -> np.ndarray:
    return 2e-4 + points @ SLOPE


def plate(folder: Path, height: float) -> dict[str, Any]:
    """A plate far below, whose top is at a height."""
    box = trimesh.creation.box((400.0, 400.0, 5.0))
    box.apply_translation((0, 0, height - 2.5))
    return part(folder, box)


def downward(count: int, spread: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Random rays from 30 mm above, through the top and the bottom of the cube of +-10 mm."""
    random = np.random.default_rng(seed)
    directions = np.column_stack((random.uniform(-spread, spread, (count, 2)), -np.ones(count)))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    aims = np.column_stack((random.uniform(-5, 5, (count, 2)), np.zeros(count)))
    return aims - directions * (30 / -directions[:, 2:]), directions


def parabola(
    point: np.ndarray, direction: np.ndarray, length: float
) -> tuple[np.ndarray, np.ndarray]:
    """Point and direction after a way through the linear field, from x'' = n grad n in dt = ds / n.

    The series of n along the path, n'' = |grad n|^2 n, is exact to 1e-20 after three terms.
    """
    index = 1 + linear(point)
    growth = index * (direction @ SLOPE)
    square = SLOPE @ SLOPE
    time = length / index
    single = index * time + growth * time**2 / 2 + square * index * time**3 / 6
    double = index * time**2 / 2 + growth * time**3 / 6 + square * index * time**4 / 24
    velocity = index * direction + SLOPE * single
    return point + index * direction * time + SLOPE * double, velocity / np.linalg.norm(velocity)


def linear_ends(
    origins: np.ndarray,
    directions: np.ndarray,
    height: float,
    slabs: Sequence[tuple[float, float]] = ((10.0, -10.0),),
) -> np.ndarray:
    """Where rays come out of the air and on to the plate, by bisection of the parabola.

    slabs : top and bottom of the air that bends them, downwards, mm; nothing does between them
    """
    ends = []
    for point, heading in zip(origins, directions, strict=True):
        for top, bottom in slabs:
            entry = point + heading * ((top - point[2]) / heading[2])
            low, high = 0.0, 100.0
            for _ in range(60):
                middle = (low + high) / 2
                if parabola(entry, heading, middle)[0][2] > bottom:
                    low = middle
                else:
                    high = middle
            point, heading = parabola(entry, heading, low)
        ends.append(point + heading * ((height - point[2]) / heading[2]))
    return np.array(ends)


def random_tetrahedra(seed: int = 0) -> pv.UnstructuredGrid:
    """Delaunay tetrahedra of random points in the cube of +-10 mm, slivers and all."""
    random = np.random.default_rng(seed)
    corners = np.array(np.meshgrid(*[(-10, 10)] * 3)).reshape(3, -1).T
    points = np.concatenate((corners, random.uniform(-10, 10, (1000, 3)))).astype(np.float32)
    cells = Delaunay(points).simplices
    return pv.UnstructuredGrid({pv.CellType.TETRA: cells}, points)


def jittered(amount: float, seed: int = 0) -> pv.UnstructuredGrid:
    """Hexahedra of 2 mm whose inner corners are moved at random; from 1 mm on some are inverted."""
    grid = hexahedra(10, 10.0)
    points = np.array(grid.points)
    inner = (np.abs(points) < 9.9).all(axis=1)
    random = np.random.default_rng(seed)
    points[inner] += random.uniform(-amount, amount, (int(inner.sum()), 3))
    grid.points = points.astype(np.float32)
    return grid


def two_blocks() -> pv.UnstructuredGrid:
    """The cube in two halves that share no points."""
    grid = hexahedra(10, 10.0)
    left = np.asarray(grid.cell_centers().points)[:, 0] < 0
    halves = [grid.extract_cells(np.flatnonzero(side)) for side in (left, ~left)]
    return pv.MultiBlock(halves).combine(merge_points=False)


GRIDS = {
    "random tetrahedra": random_tetrahedra,
    "hexahedra": lambda: hexahedra(10, 10.0),
    "warped hexahedra": lambda: jittered(0.4),
    "inverted hexahedra": lambda: jittered(1.6),
    "two blocks": two_blocks,
}


@pytest.mark.parametrize("recovered", [True, False], ids=["recovered", "constant"])
@pytest.mark.parametrize("name", GRIDS)
def test_linear_field_bends_rays_to_exact_parabolas(
    tmp_path: Path, name: str, recovered: bool
) -> None:
    """On any cells: within what the tables' single precision leaves of the gradient."""
    air = air_of(GRIDS[name](), linear, recovered=recovered)
    origins, directions = downward(100, 0.4)
    ends, straight = follow(plate(tmp_path, -100.0), air, origins, directions)
    assert (ends.outcome == 1).all()
    expected = linear_ends(origins, directions, -100.0)
    assert np.linalg.norm(expected - straight, axis=1).min() > 1e-3
    # The points are rounded to 1e-6 mm, the values are not: that is all that is off.
    np.testing.assert_allclose(ends.point, expected, atol=1e-8)
    np.testing.assert_allclose(ends.error, 0, atol=2e-8)
    if not recovered:
        # |v| = n: the index at the end is the field's own.
        inside = ends.entry_index - 1
        np.testing.assert_allclose(
            ends.entry_index, 1 + linear(entries(origins, directions)), atol=1e-12
        )
        assert np.abs(inside + ends.index_sum - linear(exits(ends))).max() < 1e-10


def entries(origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    return origins + directions * ((10 - origins[:, 2:]) / directions[:, 2:])


def exits(ends: Ends) -> np.ndarray:
    return ends.point + ends.direction * ((-10 - ends.point[:, 2:]) / ends.direction[:, 2:])


def test_inverted_cells_are_there_and_lose_no_ray(tmp_path: Path) -> None:
    air = air_of(jittered(1.6), linear)
    corners = np.array(air.tetrahedra).reshape(-1, 8)[:, :4]
    points = np.array(air.points).reshape(-1, 8)[:, :3].astype(float)[corners]
    volume = np.linalg.det(points[:, 1:] - points[:, :1])
    assert (volume < 0).mean() > 0.02
    ends, _ = follow(plate(tmp_path, -100.0), air, *downward(5_000, 0.4))
    assert (ends.outcome == 1).all()


def test_blocks_that_share_no_points_are_crossed_by_seeking(tmp_path: Path) -> None:
    """Rays that run through the seam; their cells are found anew without a loss."""
    origins, directions = downward(100, 0.4)
    ends, _ = follow(plate(tmp_path, -100.0), air_of(two_blocks(), linear), origins, directions)
    whole, _ = follow(
        plate(tmp_path, -100.0), air_of(hexahedra(10, 10.0), linear), origins, directions
    )
    np.testing.assert_allclose(ends.point, whole.point, atol=1e-9)
    side = np.sign(np.stack((entries(origins, directions), exits(ends)))[..., 0])
    through = side[0] != side[1]
    # A few find the other block's face at once.
    assert (ends.relocations[through] == 1).mean() > 0.8
    np.testing.assert_array_equal(ends.relocations[~through], 0)
    np.testing.assert_array_equal(whole.relocations, 0)


def test_rays_leave_the_data_and_enter_them_again(tmp_path: Path) -> None:
    """Two blocks with 8 mm of ambient air between them, where nothing bends."""
    grid = hexahedra(10, 10.0)
    above = np.asarray(grid.cell_centers().points)[:, 2] > 0
    upper, lower = (grid.extract_cells(np.flatnonzero(side)) for side in (above, ~above))
    blocks = pv.MultiBlock([upper.translate((0, 0, 8)), lower]).combine(merge_points=False)
    origins, directions = downward(100, 0.2)
    ends, straight = follow(plate(tmp_path, -100.0), air_of(blocks, linear), origins, directions)
    assert (ends.outcome == 1).all()
    expected = linear_ends(origins, directions, -100.0, ((18.0, 8.0), (0.0, -10.0)))
    assert np.linalg.norm(expected - straight, axis=1).min() > 1e-3
    np.testing.assert_allclose(ends.point, expected, atol=1e-8)


def test_rays_that_start_in_the_data_are_bent_from_there(tmp_path: Path) -> None:
    origins, directions = downward(200, 0.4)
    starts = origins + directions * ((3.3 - origins[:, 2:]) / directions[:, 2:])
    ends, _ = follow(
        plate(tmp_path, -100.0), air_of(random_tetrahedra(), linear), starts, directions
    )
    np.testing.assert_allclose(ends.entry_index - 1, linear(starts), atol=1e-11)
    expected = linear_ends(starts[:20], directions[:20], -100.0, ((3.3, -10.0),))
    np.testing.assert_allclose(ends.point[:20], expected, atol=1e-8)


def test_the_way_back_leads_home(tmp_path: Path) -> None:
    """From the hit with the opposite direction to above the start.

    A step ends where the ray's tangent leaves the cell, on the way back a little elsewhere; that is
    1e-8 mm for a ray that grazes a face, and far less for the others.
    """

    def curved(points: np.ndarray) -> np.ndarray:
        return 2e-4 - 5e-7 * (points**2).sum(axis=1)

    air = air_of(jittered(0.4), curved, recovered=False)
    origins, directions = downward(500, 0.3)
    there, straight = follow(plate(tmp_path, -100.0), air, origins, directions)
    assert np.linalg.norm(there.point - straight, axis=1).max() > 0.01
    (tmp_path / "back").mkdir()
    above = plate(tmp_path / "back", 35.0)
    back, _ = follow(above, air, there.point, -there.direction)
    beyond = origins + directions * ((30 - origins[:, 2:]) / directions[:, 2:])
    np.testing.assert_allclose(
        back.point + back.direction * ((30 - back.point[:, 2:]) / back.direction[:, 2:]),
        beyond,
        atol=1e-7,
    )
    np.testing.assert_allclose(back.direction, -directions, atol=1e-9)


@pytest.mark.parametrize("height", [-10.0, -9.999, -10.001, -9.0, 4.2])
def test_part_inside_or_beside_the_cells_ends_the_ray_on_its_surface(
    tmp_path: Path, height: float
) -> None:
    """A surface that misses the data's wall by a micrometre, or lies in the middle of cells."""
    origins, directions = downward(400, 0.4)
    ends, straight = follow(
        plate(tmp_path, height), air_of(random_tetrahedra(), linear), origins, directions
    )
    assert (ends.outcome == 1).all()
    np.testing.assert_allclose(ends.point[:, 2], np.float32(height), atol=1e-9)
    off = np.linalg.norm(ends.point - straight, axis=1)
    # The bend over the way through the data, times that way.
    assert 1e-5 < off.max() < 5e-3
    np.testing.assert_allclose(
        ends.path_length, np.linalg.norm(ends.point - origins, axis=1), rtol=1e-8
    )


def test_ray_with_too_many_steps_gives_up(tmp_path: Path) -> None:
    origins, directions = downward(20, 0.2)
    ends, _ = follow(
        plate(tmp_path, -100.0),
        air_of(hexahedra(10, 10.0), linear),
        origins,
        directions,
        max_steps=7,
    )
    assert (ends.outcome == 3).all()


def test_data_that_end_in_other_air_are_open(tmp_path: Path) -> None:
    """The cube's top is hot, so a ray that comes in there is marked; one from the side is not."""

    def above(points: np.ndarray) -> np.ndarray:
        return 2.7e-4 - 1e-5 * np.maximum(points[:, 2], 0)

    air = air_of(hexahedra(10, 10.0), above)
    object.__setattr__(air, "ambient", 2.7e-4)
    directions = np.array(((0, 0, -1.0), (1.0, 0, 0)))
    origins = np.array(((1.0, 2.0, 50.0), (-50.0, 1.0, -8.0)))
    box = trimesh.creation.box((2000.0, 2000.0, 2000.0))
    box.invert()
    ends, _ = follow(part(tmp_path, box), air, origins, directions)
    assert (ends.outcome == 1).all()
    np.testing.assert_array_equal(ends.opened, (True, False))
