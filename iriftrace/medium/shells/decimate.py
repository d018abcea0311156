"""Decimation of shells: quadric decimation that preserves the normals of the field."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
import pyvista as pv
from attrs import evolve

from iriftrace.core.arrays import BoolArray, Float32Array, FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.core.mesh.query import Surface
from iriftrace.core.mesh.topology import (
    connected,
    drop_degenerate,
    edges_of,
    face_along,
    open_edges,
    weld,
)
from iriftrace.core.mesh.triangles import normals_along, polydata, used_vertices
from iriftrace.medium.shells.stack import Shell, ShellStack

BORDER_REACH = 0.5
"""Vertices are moved back onto the border from within this fraction of its edges' median."""

LARGEST_SMALL_HOLE = 4
"""Number of edges of the largest hole that is closed in any place."""

FEWEST_CLOSED = 4
"""Number of triangles of the smallest closed surface."""

FEWEST = 400
"""A shell keeps at least this many triangles, if it has them."""

NORMALS_WEIGHT = 3.0
"""Weight of an error of the normal relative to one of the position. Of 0, 0.1, 1, 3 and 10 this
value changes the displacement on a bevel gear the least."""

BORDER_WEIGHT = 30.0
"""Weight of an error at the border: shells end on the data's edge or on the part, and a gap there
would let rays pass. With 1, half of a wishbone's borders were off by 0.1 mm, with 30 a tenth."""


def decimate(stack: ShellStack, triangles: int) -> ShellStack:
    """Decimate shells to about this total number of triangles.

    Garland and Heckbert's quadric error metric with the normals as attributes (1998, "Simplifying
    surfaces with color and texture using quadric error metrics"). All shells keep the same
    fraction. Normals and derivatives of the new vertices are those of the nearest points of the
    original shells. A stack of no more triangles is returned as it is; a number too small to keep
    the shells' shapes raises InputError.
    """
    least = FEWEST * len(stack.shells)
    if triangles < least:
        raise InputError(
            f"{triangles} triangles for {len(stack.shells)} shells are too few to keep their "
            f"shapes; give at least {least}.",
            code="shells.too_few_triangles",
            argument="triangles",
        )
    if stack.triangles <= triangles:
        return stack
    fraction = triangles / stack.triangles
    return evolve(stack, shells=[_thinned(shell, fraction) for shell in stack.shells])


def _thinned(shell: Shell, fraction: float) -> Shell:
    target = max(FEWEST, int(fraction * len(shell.faces)))
    if len(shell.faces) <= target:
        return shell
    mesh = polydata(shell.vertices, shell.faces)
    smooth = shell.normals is not None
    if shell.normals is not None:
        mesh.point_data["Normals"] = shell.normals
        mesh.point_data.active_normals_name = "Normals"
    # On flat pieces VTK logs every quadric that has no unique minimum, and takes an edge's middle.
    with pv.vtk_verbosity("off"):
        thin = mesh.decimate(
            1.0 - target / len(shell.faces),
            enable_all_attribute_error=smooth,
            normals=smooth,
            scalars=False,
            vectors=False,
            tcoords=False,
            tensors=False,
            normals_weight=NORMALS_WEIGHT,
            boundary_constraints=True,
            boundary_weight=BORDER_WEIGHT,
        )
    vertices = np.asarray(thin.points, dtype=np.float32)
    faces = drop_degenerate(vertices, weld(vertices)[np.asarray(thin.regular_faces, np.int64)])
    faces = _without_single_triangles(_without_non_manifold(faces))
    vertices, on_border = _back_on_border(vertices, faces, shell)
    faces = _without_small_holes(faces, on_border)
    corners, weights = _nearest(shell, vertices.astype(np.float64))
    gradient = _normals_at(shell, corners, weights)
    # Contracting an edge may turn a sliver over; the pieces keep the side they had.
    faces, _, _ = face_along(vertices, faces, gradient[faces].mean(axis=1))
    used, faces = used_vertices(len(vertices), faces)
    vertices = vertices[used]
    normals = normals_along(vertices, faces, gradient[used]) if smooth else None
    derivatives = None
    if shell.derivatives is not None:
        derivatives = np.einsum("ij,ijk->ik", weights, shell.derivatives[corners])[used]
    return evolve(shell, vertices=vertices, faces=faces, normals=normals, derivatives=derivatives)


def _without_non_manifold(faces: IntArray) -> IntArray:
    """Drop triangles that stick out of the surface: one edge of theirs has three, one has one.

    VTK contracts edges even if their ends have further neighbours in common, which sometimes folds
    a piece of the surface onto itself.
    """
    while True:
        edge = edges_of(faces)[1]
        shared = np.bincount(edge.ravel())[edge]
        loose = (shared > 2).any(axis=1) & (shared == 1).any(axis=1)
        if not loose.any():
            return faces
        faces = faces[~loose]


def _without_single_triangles(faces: IntArray) -> IntArray:
    """Drop pieces with fewer triangles than a closed surface: remainders of small ones."""
    links = np.concatenate((faces[:, :2], faces[:, 1:]))
    piece = connected(links, int(faces.max()) + 1)[faces[:, 0]]
    return faces[np.bincount(piece)[piece] >= FEWEST_CLOSED]


def _without_small_holes(faces: IntArray, on_border: BoolArray) -> IntArray:
    """Close holes of three or four edges left by non-manifold triangles; not the shell's ends."""
    edge = edges_of(faces)[1].ravel()
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    border = np.bincount(edge)[edge] == 1
    after = dict(zip(start[border].tolist(), end[border].tolist(), strict=True))
    closed = []
    for first in after:
        loop = _loop_from(first, after)
        if first == min(loop) and not on_border[loop].all():
            # Along the border of a surface, the triangles that are missing run the other way.
            closed += [(first, c, b) for b, c in pairwise(loop[1:])]
    return np.concatenate((faces, np.array(closed, dtype=faces.dtype).reshape(-1, 3)))


def _loop_from(first: int, after: Mapping[int, int]) -> list[int]:
    """Vertices of the hole that a border's edges run around; the first alone if it is larger."""
    loop = [first]
    while len(loop) < LARGEST_SMALL_HOLE:
        loop.append(after.get(loop[-1], -1))
        if after.get(loop[-1], -1) == first and len(set(loop)) == len(loop) > 2:
            return loop
    return [first]


def _back_on_border(
    vertices: Float32Array, faces: IntArray, before: Shell
) -> tuple[Float32Array, BoolArray]:
    """Vertices, of which those at the border lie on the border before, and which these are.

    That is the data's edge or the part. The weight of the border keeps most of them within
    hundredths of a millimetre; the few corners of holes that thinning has torn elsewhere stay.
    """
    on_border = np.zeros(len(vertices), dtype=bool)
    edges, edges_before = open_edges(faces), open_edges(before.faces)
    if len(edges) == 0 or len(edges_before) == 0:
        return vertices, on_border
    ends = vertices[edges].astype(np.float64)
    reach = BORDER_REACH * np.median(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))
    border = np.unique(edges)
    lines = np.insert(edges_before, 0, 2, axis=1).ravel()
    found: Any = pv.PolyData(before.vertices.astype(np.float64), lines=lines).find_closest_cell(
        vertices[border].astype(np.float64), return_closest_point=True
    )
    near = np.linalg.norm(found[1] - vertices[border], axis=1) < reach
    on_border[border[near]] = True
    moved = vertices.copy()
    moved[on_border] = found[1][near]
    return moved, on_border


def _nearest(shell: Shell, points: FloatArray) -> tuple[IntArray, FloatArray]:
    """Vertices (n, 3) of the triangle nearest to each point, and their weights (n, 3) there."""
    close, nearest = Surface(shell.vertices, shell.faces).nearest(points)
    faces = shell.faces[nearest].astype(np.int64)
    a, b, c = shell.vertices[faces].astype(np.float64).transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    square = np.maximum(np.einsum("ij,ij->i", normal, normal), np.finfo(float).tiny)
    at_a = np.einsum("ij,ij->i", np.cross(c - b, close - b), normal) / square
    at_b = np.einsum("ij,ij->i", np.cross(a - c, close - c), normal) / square
    return faces, np.clip(np.stack((at_a, at_b, 1.0 - at_a - at_b), axis=1), 0.0, 1.0)


def _normals_at(shell: Shell, corners: IntArray, weights: FloatArray) -> FloatArray:
    """(n, 3) array: the shell's normals, interpolated; those of its facets if it has no others."""
    if shell.normals is None:
        a, b, c = shell.vertices[corners].astype(np.float64).transpose(1, 0, 2)
        return np.cross(b - a, c - a)
    own = shell.normals[corners].astype(np.float64)
    return np.asarray(np.einsum("ij,ijk->ik", weights, own))
