"""Triangles that lie exactly on others: copies of bodies, and walls between touching bodies."""

from __future__ import annotations

import numpy as np

from iriftrace.core.arrays import BoolArray, IntArray
from iriftrace.geometry.topology import open_edges


def distinct_faces(faces: IntArray) -> BoolArray:
    """Mask (m,) of the triangles to keep so that none lies on another.

    The first of several triangles with the same corners and winding is kept. Two with opposite
    windings are either both sides of one surface, of which the first is kept, or the wall between
    two bodies that touch, of which none is kept; the case with fewer open edges in the whole mesh
    is chosen. Triangles that use a vertex twice are all kept.

    `faces` are (m, 3) vertex numbers of a welded mesh (see `iriftrace.geometry.topology.weld`).
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
