"""Small fields and meshes with known surfaces, for the tests of shells."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pyvista as pv
from attrs import evolve

from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.shells.stack import ShellStack
from iriftrace.medium.source import FieldSource

AIR = Air()
AMBIENT = AIR.ambient_refractivity
HOTTEST = float(AIR.refractivity(1373.15))

SOURCE = FieldSource(
    path="made.vtu", sha256="0" * 64, array="T", quantity="temperature", length_unit="mm"
)

CUBE_CORNERS = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
    dtype=float,
)
CUBE_FACES = np.array(
    [
        *([0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4]),
        *([1, 2, 6], [1, 6, 5], [2, 3, 6], [3, 7, 6], [3, 0, 7], [0, 4, 7]),
    ]
)


def hexahedra(cells: int, half: float) -> pv.UnstructuredGrid:
    """A cube of hexahedra centred at the origin, ``cells`` along each edge of length 2 half."""
    axis = np.linspace(-half, half, cells + 1)
    grid = pv.StructuredGrid(*np.meshgrid(axis, axis, axis, indexing="ij"))
    return grid.cast_to_unstructured_grid()


def field_of(
    grid: pv.UnstructuredGrid, refractivity: Callable[[np.ndarray], np.ndarray] | np.ndarray
) -> IndexField:
    values = refractivity(np.asarray(grid.points)) if callable(refractivity) else refractivity
    return IndexField(grid, values, AIR, SOURCE)


def sphere_field(cells: int = 24, half: float = 12.0, radius: float = 10.0) -> IndexField:
    """Hottest in the centre; n falls linearly with the radius to ambient at ``radius``."""

    def refractivity(points: np.ndarray) -> np.ndarray:
        r = np.minimum(np.linalg.norm(points, axis=1), radius)
        return HOTTEST + (AMBIENT - HOTTEST) * r / radius

    return field_of(hexahedra(cells, half), refractivity)


def signed_volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Volume enclosed by a closed surface; positive when its normals point outward."""
    a, b, c = vertices.astype(float)[faces].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def directed_edges(faces: np.ndarray) -> np.ndarray:
    """(3m, 2) vertex numbers of all edges as the triangles run along them."""
    return np.concatenate([faces[:, [i, (i + 1) % 3]] for i in range(3)])


def edge_counts(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Undirected edges and their numbers of triangles, counted independently of the package."""
    low, high = np.sort(directed_edges(faces), axis=1).T
    keys, counts = np.unique(low + 1_000_000_000 * high.astype(np.int64), return_counts=True)
    return np.stack(np.divmod(keys, 1_000_000_000)[::-1], axis=1), counts


def is_wound_consistently(faces: np.ndarray) -> bool:
    """True where no edge with two triangles is run along twice in the same direction."""
    edges, counts = edge_counts(faces)
    start, end = directed_edges(faces).astype(np.int64).T
    ways, runs = np.unique(start + 1_000_000_000 * end, return_counts=True)
    twice = ways[runs == 2]
    low, high = edges[counts == 2].astype(np.int64).T
    wrong = np.isin(np.concatenate((low + 1_000_000_000 * high, high + 1_000_000_000 * low)), twice)
    return not wrong.any()


def scaled(stack: ShellStack, share: float) -> ShellStack:
    """The same surfaces in air whose index differs from ambient by (1 + share) times as much."""
    ambient = stack.air.ambient_refractivity

    def more(value: float) -> float:
        return ambient + (1.0 + share) * (value - ambient)

    shells = [
        evolve(s, refractivity=more(s.refractivity), ext=more(s.ext), int_=more(s.int_))
        for s in stack.shells
    ]
    source = FieldSource(f"share {share}", "0" * 64, "n", "index", "mm", "synthetic: slab")
    return evolve(stack, shells=shells, source=source)
