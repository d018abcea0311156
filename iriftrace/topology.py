"""Which cells of a mesh are neighbours, whether it is closed and which way its cells turn."""

from __future__ import annotations

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from iriftrace.errors import InputError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@frozen(eq=False)
class Neighbours:
    """Pairs of triangles that share an edge, and the edges that make no such pair.

    Attributes
    ----------
    pairs
        (k, 2) face numbers; one row for each edge that exactly two triangles share.
    edges
        (k, 2) which edge of each of the two that is: edge i runs from corner i to the next.
    opposed
        (k,) bool; True where the two triangles run along the edge in opposite directions, as
        neighbours of one orientation do.
    open_edges
        Number of edges with an odd number of triangles; 0 for a closed surface.
    """

    pairs: IntArray
    edges: IntArray
    opposed: NDArray[np.bool_]
    open_edges: int


def weld(vertices: FloatArray) -> IntArray:
    """Number the distinct positions of a mesh's vertices.

    Formats such as STL store three vertices for each triangle. Positions are compared as float32,
    which is the precision in which the renderer sees them.

    Parameters
    ----------
    vertices
        (n, 3) array, mm.

    Returns
    -------
    (n,) array
        Equal numbers for equal positions.
    """
    # Adding zero makes -0 and 0 the same bits.
    rounded = vertices.astype(np.float32) + np.float32(0)
    order = np.lexsort(rounded.T)
    ranked = rounded[order]
    new = np.logical_or.reduce((ranked[1:] != ranked[:-1]).T)
    numbers = np.empty(len(vertices), dtype=np.int64)
    numbers[order] = np.concatenate(([0], np.cumsum(new)))
    return numbers


def find_neighbours(faces: IntArray) -> Neighbours:
    """Find the pairs of triangles that share an edge.

    Parameters
    ----------
    faces
        (m, 3) vertex numbers of a welded mesh (see `weld`). Triangles that use a vertex twice have
        no neighbours.
    """
    proper = np.flatnonzero(
        (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    )
    start = faces[proper]
    end = np.roll(start, -1, axis=1)
    low, high = np.minimum(start, end).ravel(), np.maximum(start, end).ravel()
    upward = (start < end).ravel()
    key = low * (int(faces.max(initial=0)) + 1) + high
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.concatenate(([True], np.diff(key[order]) != 0)))[: len(order)]
    count = np.diff(np.append(first, len(order)))
    two = first[count == 2]
    one_side, other_side = order[two], order[two + 1]
    owner = np.repeat(proper, 3)
    return Neighbours(
        pairs=np.stack((owner[one_side], owner[other_side]), axis=1),
        edges=np.stack((one_side, other_side), axis=1) % 3,
        opposed=upward[one_side] != upward[other_side],
        open_edges=int(np.count_nonzero(count % 2)),
    )


def connected(pairs: IntArray, count: int) -> IntArray:
    """(count,) array: number of the connected group of each of `count` nodes."""
    weights = np.ones(len(pairs), dtype=np.int8)
    graph = coo_array((weights, (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    labels: IntArray = connected_components(graph, directed=False)[1].astype(np.int64)
    return labels


def faces_to_flip(neighbours: Neighbours, areas: FloatArray) -> NDArray[np.bool_]:
    """Faces whose vertex order must be reversed so that neighbours agree.

    In each connected piece the orientation that covers the smaller area gives way.

    Parameters
    ----------
    neighbours
        From `find_neighbours`.
    areas
        (m,) face areas, mm^2.

    Returns
    -------
    (m,) bool array

    Raises
    ------
    InputError
        The surface is one-sided, like a Moebius strip.
    """
    flipped, one_sided = cells_to_flip(neighbours.pairs, neighbours.opposed, areas)
    if one_sided.any():
        raise InputError(
            "the part's surface is one-sided (like a Moebius strip), so no side of it is outside; "
            "repair the mesh."
        )
    return flipped


def cells_to_flip(
    pairs: IntArray, opposed: NDArray[np.bool_], weights: FloatArray
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Cells, triangles or tetrahedra, that must be turned so that neighbours agree.

    Parameters
    ----------
    pairs
        (k, 2) cell numbers of neighbours.
    opposed
        (k,) bool; True where the two run along what they share in opposite directions, as
        neighbours of one orientation do.
    weights
        (m,) of each cell. In each connected piece the orientation with the larger sum stays, where
        a cell that is turned counts with the opposite sign.

    Returns
    -------
    flipped : (m,) bool array
    one_sided : (m,) bool array
        Cells of pieces that have no orientation.
    """
    count = len(weights)
    first, second = pairs.T
    # Each cell stands for two nodes, "kept" and "flipped". Neighbours that agree tie kept to kept,
    # others tie kept to flipped.
    crossing = np.where(opposed, 0, count)
    ties = np.concatenate(
        (
            np.stack((first, second + crossing), axis=1),
            np.stack((first + count, second + count - crossing), axis=1),
        )
    )
    sheet = connected(ties, 2 * count)
    kept, flipped = sheet[:count], sheet[count:]
    # The two sheets of a piece bear different numbers; cells on the lower one agree already.
    on_lower = kept < flipped
    piece = np.minimum(kept, flipped)
    lower = np.bincount(piece, np.where(on_lower, weights, -weights), minlength=2 * count)
    return np.where(lower[piece] >= 0, ~on_lower, on_lower), kept == flipped
