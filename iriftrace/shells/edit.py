"""Changes to finished shells for studies: trim to a view, smooth, subdivide."""

from __future__ import annotations

import numpy as np
from attrs import evolve
from scipy.sparse import csr_array

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import AnyIntArray, FloatArray
from iriftrace.core.errors import InputError
from iriftrace.geometry.topology import edges_of, open_edges
from iriftrace.geometry.triangles import unit_vectors, used_vertices
from iriftrace.shells.stack import Shell, ShellStack

TAUBIN_FACTORS = 0.20, -0.21
"""Fractions of the way to its neighbours' mean that a vertex moves, in turn; the pass-band ends at
the sum of their reciprocals."""


def trim_to_frustum(stack: ShellStack, camera: Camera, margin_mm: float) -> ShellStack:
    """Remove triangles that lie wholly outside or behind a camera's view.

    A triangle stays unless all its corners are beyond the same side of the view by more than the
    margin, so no triangle that a ray of the camera could meet is lost. The margin, mm, is room for
    refracted rays and for other cameras near this one. Shells are open where they are cut, and
    shells without any triangle in view are removed. Raises InputError for a negative margin or if
    no triangle is in view.
    """
    if not (margin_mm >= 0.0 and np.isfinite(margin_mm)):
        raise InputError(
            f"The margin of the view is {margin_mm} mm; give 0 or a positive length, else rays at "
            "the picture's edge miss shells."
        )
    anchors, inward = _sides_of_view(camera)

    def trimmed(shell: Shell) -> Shell | None:
        points = shell.vertices.astype(np.float64)
        kept = np.ones(len(shell.faces), dtype=bool)
        for anchor, normal in zip(anchors, inward, strict=True):
            beyond = (points - anchor) @ normal < -margin_mm
            kept &= ~beyond[shell.faces].all(axis=1)
        if not kept.any():
            return None
        used, faces = used_vertices(len(points), shell.faces[kept])
        return evolve(
            shell,
            vertices=shell.vertices[used],
            faces=faces,
            normals=None if shell.normals is None else shell.normals[used],
            derivatives=None if shell.derivatives is None else shell.derivatives[used],
        )

    shells = [shell for shell in map(trimmed, stack.shells) if shell is not None]
    if not shells:
        raise InputError(
            "No shell is in the camera's view, so nothing would bend its rays; check the pose."
        )
    return evolve(stack, shells=shells)


def without_inner(stack: ShellStack, count: int, levels: int | None = None) -> ShellStack:
    """Remove the innermost levels together with their index steps.

    Rays then continue to the part in the air of the last remaining shell. Kern et al. (2025) did
    this where shells of a coarse field cut the part; it is for studies only. `levels` is the number
    of all levels, whether the field reaches them or not; by default as many as there are. Raises
    InputError if the count is negative, or no shell is left.
    """
    last = max(shell.layer for shell in stack.shells) if levels is None else levels
    kept = [shell for shell in stack.shells if shell.layer <= last - count]
    if count < 0 or not kept:
        raise InputError(
            f"{count} inner shells of {last} cannot be left out, because some must remain; give a "
            "number from 0 on, or more layers."
        )
    return evolve(stack, shells=kept)


def smooth_taubin(stack: ShellStack, iterations: int) -> ShellStack:
    """Smooth shells without shrinking them (Taubin 1995, "A signal processing approach").

    Each iteration moves every vertex by each of `TAUBIN_FACTORS` times the vector to the mean of
    its neighbours. Vertices on a border stay, so that shells still end on the wall or the data's
    edge. Gradient normals and derivatives belong to the original surface, so the result has none.
    Raises InputError for negative iterations.
    """
    if iterations < 0:
        raise InputError(f"{iterations} smoothing iterations cannot be done; give 0 or more.")
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
        raise InputError(f"Shells cannot be subdivided {times} times; give 0 or more.")
    for _ in range(times):
        stack = evolve(stack, shells=map(_subdivided, stack.shells))
    return stack


def _sides_of_view(camera: Camera) -> tuple[FloatArray, FloatArray]:
    """A point on each plane around a camera's view and the planes' unit normals, inward.

    The four sides, and the plane through the origin across the line of sight. Works for pinhole and
    orthographic cameras: a side holds the rays through two neighbouring corners of the picture (of
    the smallest picture without distortion that holds all, where the lens distorts).
    """
    camera = camera.without_distortion()
    origins, directions = camera.rays(camera.corners)
    tips = origins + directions
    sides = unit_vectors(np.cross(np.roll(tips, -1, axis=0) - tips, directions))
    middle = tips.mean(axis=0)
    inward = np.sign(np.einsum("ij,ij->i", middle - tips, sides))[:, None]
    return np.vstack((origins, camera.origin)), np.vstack((sides * inward, camera.forward))


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
