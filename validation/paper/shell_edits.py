"""Changes to finished shells: smooth and subdivide."""

from __future__ import annotations

import numpy as np
from attrs import evolve
from scipy.sparse import csr_array

from iriftrace.core.arrays import AnyIntArray
from iriftrace.core.errors import InputError
from iriftrace.core.mesh.topology import edges_of, open_edges
from iriftrace.core.mesh.triangles import unit_vectors
from iriftrace.medium.shells.stack import Shell, ShellStack

TAUBIN_FACTORS = 0.20, -0.21
"""Fractions of the way to its neighbours' mean that a vertex moves, in turn; the pass-band ends at
the sum of their reciprocals."""


def smooth_taubin(stack: ShellStack, iterations: int) -> ShellStack:
    """Smooth shells without shrinking them (Taubin 1995, "A signal processing approach").

    Each iteration moves every vertex by each of `TAUBIN_FACTORS` times the vector to the mean of
    its neighbours. Vertices on a border stay, so that shells still end on the wall or the data's
    edge. Gradient normals and derivatives belong to the original surface, so the result has none.
    Raises InputError for negative iterations.
    """
    if iterations < 0:
        raise InputError(
            f"{iterations} smoothing iterations cannot be done; give 0 or more.",
            code="validation.below_zero",
        )
    if iterations == 0:
        return stack

    def smoothed(shell: Shell) -> Shell:
        points = shell.vertices.astype(np.float64)
        mean = _neighbour_mean(shell.faces, len(points))
        free = np.ones((len(points), 1))
        free[open_edges(shell.faces).ravel()] = 0.0
        for _ in range(iterations):
            for factor in TAUBIN_FACTORS:
                points += factor * free * (mean @ points - points)
        return evolve(shell, vertices=points, normals=None, derivatives=None)

    return evolve(stack, shells=map(smoothed, stack.shells))


def subdivide_midpoint(stack: ShellStack, times: int = 1) -> ShellStack:
    """Split every triangle into four at the middles of its edges.

    The surface does not change except for the rounding of the new vertices to float32 (4e-6 mm at
    100 mm), which turns facets by this error over their size. Normals and derivatives are
    interpolated, and the number of triangles grows by ``4**times``.
    """
    if times < 0:
        raise InputError(
            f"Shells cannot be subdivided {times} times; give 0 or more.",
            code="validation.below_zero",
        )
    for _ in range(times):
        stack = evolve(stack, shells=map(_subdivided, stack.shells))
    return stack


def _neighbour_mean(faces: AnyIntArray, count: int) -> csr_array:
    """Matrix (n, n) that gives the mean of the vertices joined to each vertex by an edge."""
    start = np.concatenate((faces, faces[:, ::-1]), axis=1).ravel()
    end = np.concatenate((np.roll(faces, -1, 1), np.roll(faces[:, ::-1], -1, 1)), axis=1).ravel()
    joined = csr_array((np.ones(len(start)), (start, end)), shape=(count, count))
    joined.sum_duplicates()
    # An edge of two triangles was counted twice.
    joined.data[:] = 1.0
    degree = np.asarray(joined.sum(axis=1)).ravel()
    joined.data /= np.repeat(np.maximum(degree, 1.0), np.diff(joined.indptr))
    return joined


def _subdivided(shell: Shell) -> Shell:
    faces = shell.faces.astype(np.int64)
    ends, edge = edges_of(faces)
    one, two = ends.T
    points = shell.vertices.astype(np.float64)
    vertices = np.vstack((points, 0.5 * (points[one] + points[two])))
    a, b, c = faces.T
    ab, bc, ca = (edge + len(points)).T
    quarters = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    normals = None
    if shell.normals is not None:
        old = shell.normals.astype(np.float64)
        between = unit_vectors(old[one] + old[two])
        # Opposite normals have no mean; either one is used.
        between = np.where(np.any(between, axis=1)[:, None], between, old[one])
        normals = np.vstack((old, between))
    derivatives = None
    if shell.derivatives is not None:
        known = shell.derivatives.astype(np.float64)
        derivatives = np.concatenate((known, 0.5 * (known[one] + known[two])))
    return evolve(
        shell,
        vertices=vertices,
        faces=np.stack([np.stack(quarter, axis=1) for quarter in quarters], axis=1).reshape(-1, 3),
        normals=normals,
        derivatives=derivatives,
    )
