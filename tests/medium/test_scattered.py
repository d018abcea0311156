"""Scattered points: volume of the air around cut-out parts, to the last cubic millimetre."""

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
import trimesh

from iriftrace.io.part_files import read_part
from iriftrace.io.scattered import cells_outside, tetrahedra_between
from iriftrace.part.part import Part

Mask = np.ndarray


def cubes(mask: Mask) -> pv.UnstructuredGrid:
    """Cells of 1 mm where the mask (nx, ny, nz) is set."""
    grid = pv.ImageData(dimensions=np.array(mask.shape) + 1)
    return grid.extract_cells(np.flatnonzero(mask.ravel(order="F")))


def part_of(mask: Mask, folder: Path) -> Part:
    surface = cubes(mask).extract_surface(algorithm="geometry").triangulate()
    faces = np.asarray(surface.faces).reshape(-1, 4)[:, 1:]
    mesh = trimesh.Trimesh(np.asarray(surface.points), faces)
    mesh.fix_normals()
    mesh.export(folder / "part.ply")
    return read_part(folder / "part.ply")


def points_of(air: Mask, seed: int = 0) -> np.ndarray:
    """Corners of the air's cells; those within the air are moved, as a solver's mesh would be."""
    grid = cubes(air)
    points = np.asarray(grid.points, dtype=np.float64)
    cells = np.asarray(grid.cell_connectivity)
    inner = np.bincount(cells, minlength=len(points)) == 8
    move = np.random.default_rng(seed).uniform(-0.3, 0.3, points.shape)
    return np.where(inner[:, None], points + move, points)


def volume_grid(points: np.ndarray) -> pv.UnstructuredGrid:
    return pv.UnstructuredGrid({pv.CellType.TETRA: tetrahedra_between(points, Path("f"))}, points)


def kept(points: np.ndarray, part: Part) -> pv.UnstructuredGrid:
    grid = volume_grid(points)
    return grid.extract_cells(cells_outside(grid, part, "f.txt"))


SHAPES = {
    "block": lambda x, y, z: (abs(x) < 2) & (abs(y) < 2) & (abs(z) < 2),
    "thin plate": lambda x, y, z: (abs(x) < 4) & (abs(y) < 4) & (abs(z - 0.5) < 0.6),
    "channel": lambda x, y, z: (
        (abs(x) < 3) & (abs(y) < 3) & (abs(z) < 3) & ((z < -2) | (abs(x) > 1))
    ),
    "teeth": lambda x, y, z: (abs(x) < 4) & (abs(y) < 2) & (abs(z) < 3) & ((z < 0) | (x % 3 < 2)),
}


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES.keys())
@pytest.mark.parametrize("seed", [0, 1])
def test_air_stays_and_the_part_goes(tmp_path: Path, shape, seed: int) -> None:
    """Volume of the air to the last cubic millimetre, also in gaps of the part."""
    axis = np.arange(12) - 5.5
    solid = shape(*np.meshgrid(axis, axis, axis, indexing="ij"))
    assert 0 < solid.sum() < 500
    part = part_of(solid, tmp_path)
    grid = kept(points_of(~solid, seed), part)
    centres = np.floor(np.asarray(grid.cell_centers().points)).astype(int).clip(0, 11)
    volumes = np.asarray(grid.compute_cell_sizes()["Volume"])
    assert (volumes >= 0.0).all()
    wrong = volumes[solid[tuple(centres.T)]].sum()
    assert grid.volume == pytest.approx(np.count_nonzero(~solid), rel=0.003)
    assert wrong < 0.003 * np.count_nonzero(~solid)


def test_a_notch_in_the_outline_is_not_bridged() -> None:
    """Air in the form of an L: the hull covers the notch, the cells do not, up to its corner."""
    air = np.ones((24, 24, 6), dtype=bool)
    air[10:, 10:] = False
    grid = volume_grid(points_of(air))
    hull = 24 * 24 * 6 - 14 * 14 * 6 / 2
    assert volume_grid(points_of(air)).volume < air.sum() + 0.25 * (hull - air.sum())
    assert grid.volume >= 0.999 * air.sum()


def test_graded_and_stretched_points_keep_all_their_cells() -> None:
    """Layers of 0.05 mm below cells of 2 mm, as at a wall: long cells that bridge nothing."""
    steps = np.concatenate(([0.0], np.cumsum(0.05 * 1.3 ** np.arange(16))))
    plane = np.linspace(0.0, 20.0, 11)
    z, y, x = np.meshgrid(steps, plane, plane, indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    assert volume_grid(points).volume == pytest.approx(400.0 * steps[-1], rel=1e-9)
