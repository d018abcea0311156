"""Split the edges of a triangle mesh without changing its surface.

CAD programs write a cylinder as slivers, of 100 mm by 1 mm for example. Halving all long edges, as
VTK's and trimesh's subdivisions do, cuts such a sliver lengthwise too, since its diagonals are as
long as its sides: the mesh gets several times as many triangles as its edges need. So the edges
between planes are halved first, and inside each plane edges are flipped until the triangles are
those of Delaunay; then the longest edges there are halved.
"""

from __future__ import annotations

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.core.mesh.topology import Neighbours, edge_keys, edges_of, find_neighbours
from iriftrace.core.mesh.triangles import area_vectors, cross_rows, row_lengths, unit_vectors

_ROUNDING = 4 * float(np.finfo(np.float32).eps)
"""Distance from a plane that rounding of the coordinates explains, relative to these."""

_SLACK = 1e-9
"""Excess of the opposite angles' cotangents over 0 up to which an edge counts as Delaunay's."""


@frozen(eq=False)
class Mesh:
    """A welded triangle mesh, mm; edges between two regions stay."""

    vertices: FloatArray  # (n, 3)
    faces: IntArray  # (m, 3)
    region: IntArray  # (m,), number of each face's region


def subdivide(mesh: Mesh, edge_mm: float, most_faces: int) -> Mesh | None:
    """Split edges until none is longer; None if that needs more than `most_faces` triangles.

    The surface and its regions do not change, and a closed one stays closed: an edge is split in
    the same way in all its triangles.
    """
    while True:
        mesh = _flipped(mesh)
        neighbours = find_neighbours(mesh.faces)
        flat = _flat(mesh, neighbours)
        inner = np.zeros(mesh.faces.shape, dtype=bool)
        inner[neighbours.pairs[flat], neighbours.edges[flat]] = True
        corners = mesh.vertices[mesh.faces]
        sides = np.roll(corners, -1, axis=1) - corners
        length = row_lengths(sides.reshape(-1, 3)).reshape(-1, 3)
        long = length > edge_mm
        if not long.any():
            return mesh
        creases = long & ~inner
        if not creases.any():
            long &= length == length.max(axis=1, keepdims=True)
        mesh = _split(mesh, creases if creases.any() else long)
        if len(mesh.faces) > most_faces:
            return None


def _flat(mesh: Mesh, neighbours: Neighbours) -> BoolArray:
    """(k,) mask of the pairs of neighbours that lie in one plane and one region."""
    first, second = neighbours.pairs.T
    flat: BoolArray = neighbours.opposed & (mesh.region[first] == mesh.region[second])
    normals = unit_vectors(area_vectors(mesh.vertices, mesh.faces))
    flat &= np.einsum("ij,ij->i", normals[first], normals[second]) > 0.9
    reach = _ROUNDING * float(np.abs(mesh.vertices).max(initial=1.0))
    for near, far, side in ((first, second, 1), (second, first, 0)):
        apex = mesh.faces[far, (neighbours.edges[:, side] + 2) % 3]
        offset = mesh.vertices[apex] - mesh.vertices[mesh.faces[near, 0]]
        flat &= np.abs(np.einsum("ij,ij->i", offset, normals[near])) <= reach
    return flat


def _flipped(mesh: Mesh) -> Mesh:
    """The mesh after Lawson's flips: inside each plane its triangles are those of Delaunay."""
    random = np.random.default_rng(0)
    while True:
        neighbours = find_neighbours(mesh.faces)
        wrong = np.flatnonzero(_flat(mesh, neighbours))
        pairs, edges = neighbours.pairs[wrong], neighbours.edges[wrong]
        a, b, c, d = _quads(mesh.faces, pairs, edges)
        wrong = np.flatnonzero(_cotangents(mesh.vertices, a, b, c, d) < -_SLACK)
        wrong = random.permutation(wrong)
        wrong = wrong[_apart(pairs[wrong], len(mesh.faces))]
        a, b, c, d, pairs = a[wrong], b[wrong], c[wrong], d[wrong], pairs[wrong]
        free = _new_edges(mesh.faces, c, d)
        if not free.any():
            return mesh
        faces = mesh.faces.copy()
        faces[pairs[free, 0]] = np.stack((a, d, c), axis=1)[free]
        faces[pairs[free, 1]] = np.stack((d, b, c), axis=1)[free]
        mesh = Mesh(mesh.vertices, faces, mesh.region)


def _quads(
    faces: IntArray, pairs: IntArray, edges: IntArray
) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Corners of pairs of triangles: a and b of the common edge, c and d opposite to it."""
    rows = np.arange(len(pairs))
    first, second = faces[pairs[:, 0]], faces[pairs[:, 1]]
    a, b, c = (first[rows, (edges[:, 0] + step) % 3] for step in range(3))
    return a, b, c, second[rows, (edges[:, 1] + 2) % 3]


def _cotangents(
    vertices: FloatArray, a: IntArray, b: IntArray, c: IntArray, d: IntArray
) -> FloatArray:
    """Sum of the cotangents of the angles opposite to the edge a b; negative beyond 180 degrees."""
    total = np.zeros(len(a))
    for apex in (c, d):
        u, v = vertices[a] - vertices[apex], vertices[b] - vertices[apex]
        area = row_lengths(cross_rows(u, v))
        total += np.einsum("ij,ij->i", u, v) / np.maximum(area, np.finfo(float).tiny)
    return total


def _apart(pairs: IntArray, count: int) -> BoolArray:
    """(k,) mask of pairs of which no two have a common triangle: those that come first at both."""
    place = np.arange(len(pairs))
    first = np.full(count, len(pairs))
    for column in pairs.T:
        np.minimum.at(first, column, place)
    return np.asarray((first[pairs] == place[:, None]).all(axis=1))


def _new_edges(faces: IntArray, c: IntArray, d: IntArray) -> BoolArray:
    """(k,) mask of the edges c d that no triangle has yet, each once."""
    key = (np.minimum(c, d) << 32) | np.maximum(c, d)
    present = np.isin(key, edge_keys(faces)[0])
    once = np.zeros(len(key), dtype=bool)
    once[np.unique(key, return_index=True)[1]] = True
    return ~present & once


def _split(mesh: Mesh, marked: BoolArray) -> Mesh:
    """The mesh with the marked sides, (m, 3), halved in all their triangles."""
    ends, number = edges_of(mesh.faces)
    halved = np.zeros(len(ends), dtype=bool)
    halved[number[marked]] = True
    middle = np.where(halved, len(mesh.vertices) + np.cumsum(halved) - 1, -1)
    one, other = ends[halved].T
    middles = 0.5 * (mesh.vertices[one] + mesh.vertices[other])
    corners = np.concatenate((mesh.faces, middle[number]), axis=1)
    faces, regions = [], []
    for first in range(3):
        # Turned so that the side `first` comes first: its pattern is one of four.
        order = [(first + k) % 3 for k in range(3)]
        turned = corners[:, [*order, *(3 + k for k in order)]]
        has = turned[:, 3:] >= 0
        for pattern, triangles in _PATTERNS.items():
            whole = pattern in ((False,) * 3, (True,) * 3)
            rows = (has == pattern).all(axis=1) & (not whole or first == 0)
            for triangle in triangles:
                faces.append(turned[rows][:, triangle])
                regions.append(mesh.region[rows])
    return Mesh(
        np.concatenate((mesh.vertices, middles)), np.concatenate(faces), np.concatenate(regions)
    )


# Triangles for each pattern of halved sides: corners 0 to 2, the middles of the sides 3 to 5.
_PATTERNS = {
    (False, False, False): ((0, 1, 2),),
    (True, False, False): ((0, 3, 2), (3, 1, 2)),
    (True, True, False): ((3, 1, 4), (0, 3, 4), (0, 4, 2)),
    (True, True, True): ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
}
