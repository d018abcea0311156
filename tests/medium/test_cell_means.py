"""Values of cells at the points around them: exact for linear fields, also where cells grow."""

import itertools
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose

from iriftrace.core.arrays import FloatArray
from iriftrace.io.field import read_field
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.cell_means import point_means
from iriftrace.medium.gradient import cell_centroids
from iriftrace.medium.volume import linear_volume

SLOPE = np.array((8.0, -5.0, 3.0))
AXIS = np.array((-8.0, -4.0, -2.0, -1.0, 0.0, 1.0, 3.0, 7.0))
"""Of cells that grow by a factor of two."""


def graded() -> pv.UnstructuredGrid:
    grid = pv.StructuredGrid(*np.meshgrid(AXIS, AXIS, AXIS, indexing="ij"))
    return grid.cast_to_unstructured_grid()


def inside(points: FloatArray, low: float, high: float) -> FloatArray:
    """Mask of the points that are not on the outside of a cube."""
    return ((points > low + 1e-6) & (points < high - 1e-6)).all(axis=1)


@pytest.mark.parametrize("cells", ["hexahedra", "tetrahedra", "wedges"])
def test_linear_fields_are_exact_inside_graded_cells(cells: str) -> None:
    """At a few points of tetrahedra the function of the weights stops: 2 % of a cell's step."""
    grid = graded()
    if cells == "tetrahedra":
        grid = linear_volume(grid.triangulate())
    elif cells == "wedges":
        corners = np.asarray(grid.cell_connectivity).reshape(-1, 8)
        halves = np.concatenate((corners[:, [0, 1, 2, 4, 5, 6]], corners[:, [0, 2, 3, 4, 6, 7]]))
        grid = pv.UnstructuredGrid({pv.CellType.WEDGE: halves}, grid.points)
    points = np.asarray(grid.points, dtype=np.float64)
    inner = inside(points, AXIS[0], AXIS[-1])
    assert inner.sum() == 6**3
    found = point_means(grid, cell_centroids(grid) @ SLOPE)
    off = np.abs(found - points @ SLOPE)
    assert off[inner].max() < (0.04 if cells == "tetrahedra" else 1e-6)
    assert np.mean(off[inner] < 1e-6) > 0.9
    # All places of an outer point lie on one side of it; their values still bracket its own.
    assert off.max() <= 2.0 * np.abs(SLOPE).sum()


def refined() -> pv.UnstructuredGrid:
    """Polyhedra: cubes with edge 2 for x < 0 and with edge 1 beyond, and the corners they share."""
    coarse = [((x, y, z), 2) for x in (-4, -2) for y in (0, 2) for z in (0, 2)]
    fine = [((x, y, z), 1) for x in (0, 1) for y in range(4) for z in range(4)]
    points: dict[tuple[int, ...], int] = {}
    cells: list[int] = []
    for low, edge in coarse + fine:
        faces = []
        for axis, side in itertools.product(range(3), (0, 1)):
            start = list(low)
            start[axis] += side * edge
            # The coarse cells' faces at x = 0 are four of the fine ones.
            parts = 2 if axis == 0 and edge == 2 and start[0] == 0 else 1
            step = edge // parts
            across = [k for k in range(3) if k != axis]
            for i, j in itertools.product(range(parts), repeat=2):
                face = []
                for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
                    corner = list(start)
                    corner[across[0]] += step * (i + a)
                    corner[across[1]] += step * (j + b)
                    face.append(points.setdefault(tuple(corner), len(points)))
                faces.append(face)
        stream = [len(faces), *(number for face in faces for number in (4, *face))]
        cells += [len(stream), *stream]
    kinds = [pv.CellType.POLYHEDRON] * (len(coarse) + len(fine))
    return pv.UnstructuredGrid(cells, kinds, np.array(list(points), dtype=np.float64))


@pytest.mark.filterwarnings("ignore:'T' in .* is given in the cells")
def test_values_of_polyhedra_belong_to_their_centroids(tmp_path: Path) -> None:
    grid = refined()
    low, high = np.array(grid.bounds).reshape(3, 2).T
    corners = [grid.get_cell(number).points for number in range(grid.n_cells)]
    centres = np.array([0.5 * (p.min(axis=0) + p.max(axis=0)) for p in corners])
    grid.cell_data["T"] = 400.0 + centres @ SLOPE
    grid.save(tmp_path / "air.vtu")
    field = read_field(tmp_path / "air.vtu", air=Air(temperature_k=grid.cell_data["T"].min()))
    points = np.asarray(field.grid.points)
    inner = ((points > low + 1e-6) & (points < high - 1e-6)).all(axis=1)
    assert inner.sum() == grid.n_cells + 9 + 9 + 1
    off = field.temperature_k - 400.0 - points @ SLOPE
    assert_allclose(off[inner], 0.0, atol=1e-6)
