"""Checks of size, growth and orientation of a part's mesh: refuse, warn or repair."""

from __future__ import annotations

import numpy as np

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.mesh.query import Surface
from iriftrace.core.mesh.topology import (
    Neighbours,
    connected,
    find_neighbours,
    open_edges,
    wound_alike,
)
from iriftrace.core.mesh.triangles import area_vectors, row_lengths
from iriftrace.core.units import ZERO_CELSIUS_K
from iriftrace.part.growth import Growth

PLAUSIBLE_SIZE_MM = (1.0, 10_000.0)
"""Parts outside these sizes are rarely real; a metre read as a millimetre is common."""

COARSEST_STEP_MM = 1e-3
"""Rounding of coordinates at 16 m from the origin."""

LEAST_BODY = 1e-6
"""Fraction of a part's volume from which on a piece of its surface is no sliver or double sheet."""

LEAST_FOLDED = 2e-3
"""Fraction of a part's area from which on folds are more than slivers."""


def stated_growth(
    path: str,
    stated: Growth | None,
    expansion: float | None,
    reference_k: float,
    hot_k: float | None,
) -> tuple[Growth | None, float]:
    """Growth of a part, from its file or the arguments, and the factor for its coordinates."""
    if expansion is None:
        return stated, 1.0
    if hot_k is None:
        raise InputError(
            "thermal expansion needs the part's hot temperature as well; give both or neither.",
            code="part.no_hot_temperature",
            argument="hot_temperature",
        )
    if stated is not None:
        raise InputError(
            f"{path} states that it is expanded to {stated.hot_k - ZERO_CELSIUS_K:g} degC already; "
            "give the part as it was drawn, or leave out the expansion.",
            code="part.expanded_twice",
            argument="expansion",
        )
    growth = Growth(expansion, reference_k, hot_k)
    return growth, growth.factor


def check_unit(path: str, vertices: FloatArray, stated: str, chosen: str) -> None:
    """Warn when the unit is not the one that the file states, or makes an unlikely size."""
    if stated != chosen:
        warn(
            f"{path} declares its unit as {stated} but is read as {chosen}; leave out "
            "length_unit if the file is right.",
            argument="length_unit",
        )
        return
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    if is_unlikely_size(size):
        warn(
            f"{path} is {size:.3g} mm across when read as {chosen}, which is unlikely for a "
            "measured part; check length_unit.",
            argument="length_unit",
        )


def is_unlikely_size(size_mm: float) -> bool:
    """True for the diagonal, mm, of a box around a part that is hardly measured anywhere."""
    smallest, largest = PLAUSIBLE_SIZE_MM
    return size_mm < smallest or size_mm > largest  # not for NaN, which is refused later


def distinct_faces(faces: IntArray) -> BoolArray:
    """Mask of the triangles, (m, 3) of a welded mesh, to keep so that none lies on another.

    The first of several triangles with the same corners and winding is kept. Two with opposite
    windings are either both sides of one surface, of which the first is kept, or the wall between
    two bodies that touch, of which none is kept; the case with fewer open edges in the whole mesh
    is chosen. Triangles that use a vertex twice are all kept.
    """
    corners = np.sort(faces, axis=1)
    # Ascending or reversed, two of three pairs of consecutive corners ascend.
    ascends = (np.roll(faces, -1, axis=1) > faces).sum(axis=1) == 2
    order = np.lexsort((ascends, *corners.T))
    corners, ascends = corners[order], ascends[order]
    same = np.zeros(len(faces), dtype=bool)
    same[1:] = (corners[1:] == corners[:-1]).all(axis=1)
    same &= (corners[:, 1:] != corners[:, :-1]).all(axis=1)
    keep = np.ones(len(faces), dtype=bool)
    if not same.any():
        return keep
    turned = np.zeros(len(faces), dtype=bool)
    turned[1:] = same[1:] & (ascends[1:] != ascends[:-1])
    keep[order[same & ~turned]] = False
    start = np.maximum.accumulate(np.where(same, 0, np.arange(len(faces))))
    pairs = np.stack((order[start[turned]], order[turned]), axis=1)
    one_side, neither = keep.copy(), keep.copy()
    one_side[pairs.max(axis=1)] = False
    neither[pairs] = False
    walls = neither.any() and len(open_edges(faces[neither])) <= len(open_edges(faces[one_side]))
    return neither if walls else one_side


def oriented_outward(
    path: str, vertices: FloatArray, faces: IntArray, welded: IntArray
) -> tuple[IntArray, Neighbours]:
    """Faces with one orientation, outward for a closed surface, and their pairs before that."""
    neighbours = find_neighbours(welded[faces])
    faces, turned = wound_alike(vertices, faces, neighbours)
    if turned:
        warn(
            f"{path} has {turned} triangles that face the other way than their "
            "neighbours; they were turned over."
        )
    if neighbours.open_edges:
        warn(
            f"{path} is not closed ({neighbours.open_edges} open edges): coverage refers to the "
            "remaining surface, rays may pass through the holes, and the inside of the part is "
            "unknown; rays through a hole count what they find behind it."
        )
        return faces, neighbours
    inward = _faces_inward(vertices, faces, neighbours)
    if inward.any():
        faces = np.where(inward[:, None], faces[:, ::-1], faces)
        has, count = ("", "all") if inward.all() else ("bodies with ", f"their {inward.sum()}")
        warn(
            f"{path} has {has}inward-facing normals (negative volume); {count} triangles were "
            "turned over."
        )
    return faces, neighbours


def _faces_inward(vertices: FloatArray, faces: IntArray, neighbours: Neighbours) -> BoolArray:
    """Mask (m,) of the triangles of a closed surface whose normals point into the part.

    Bodies have positive volumes, their cavities negative ones. Bodies within others may be either,
    and stay as they are if all that are in none are right.
    """
    normals, piece = area_vectors(vertices, faces), connected(neighbours.pairs, len(faces))
    areas = row_lengths(normals)
    heights = np.einsum("ij,ij->i", vertices[faces[:, 0]] - vertices.mean(axis=0), normals)
    volumes = np.bincount(piece, heights)
    by_area = np.argsort(areas)
    largest = np.empty(len(volumes), dtype=np.int64)
    largest[piece[by_area]] = by_area
    bodies = np.abs(volumes) > LEAST_BODY * np.abs(volumes).sum()
    if bodies.sum() == 1 or (volumes <= 0.0)[bodies].all():
        return np.full(len(faces), heights.sum() < 0.0)
    face, sign = largest[bodies], np.sign(volumes[bodies])
    outward = (sign / np.sqrt(areas[face]))[:, None] * normals[face]
    nested = Surface(vertices, faces).inside(vertices[faces[face]].mean(axis=1) + 1e-6 * outward)
    wrong = sign == np.where(nested, 1.0, -1.0)
    turned = np.zeros(len(volumes), dtype=bool)
    turned[bodies] = wrong & (wrong & ~nested).any()
    return turned[piece]


def warn_of_folds(
    path: str, neighbours: Neighbours, normals: FloatArray, areas: FloatArray
) -> None:
    """Warn of triangles that lie on their neighbours, with normals (m, 3) opposite to theirs.

    So do fans of concave polygons, which then cover what is not the part's. Of areas (m,), mm^2, a
    small fraction can be slivers.
    """
    first, second = neighbours.pairs.T
    folded = np.einsum("ij,ij->i", normals[first], normals[second]) < -1.0 + 1e-6
    covered = np.minimum(areas[first], areas[second])[folded].sum() / areas.sum()
    if covered > LEAST_FOLDED:
        warn(
            f"{path} has triangles that are folded back onto their neighbours ({100 * covered:.2g} "
            "% of its area), as concave polygons become; export it as triangles."
        )


def warn_of_rounding(path: str, farthest_mm: float) -> None:
    """Warn of a part whose farthest coordinate is too large for the precision of scenes."""
    step = float(np.spacing(np.float32(farthest_mm)))
    if step > COARSEST_STEP_MM:
        warn(
            f"{path} lies {farthest_mm:.4g} mm from the origin, where single precision, in which "
            f"scenes store it, has steps of {step:.2g} mm; export part and field nearer to it, or "
            "move both by 'translate X Y Z'.",
            argument="part_transform",
        )


def signed_volume(vertices: FloatArray, faces: IntArray) -> float:
    """Sum of the tetrahedra between the triangles and the origin, mm^3."""
    heights = np.einsum("ij,ij->", vertices[faces[:, 0]], area_vectors(vertices, faces))
    return float(heights) / 3.0
