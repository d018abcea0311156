"""Faces of a surface in nested blocks of neighbours, and areas distributed within them.

The number of pixel centres on a face scatters: footprints add up to more than one face's area and
to less than the next one's. The excess on a face therefore belongs to the faces around it. It is
distributed in blocks: first among four neighbouring faces, the remainder among sixteen, and so on
up to the whole smooth patch. This conserves the sum, takes a few passes over the faces for any
distance, and does not depend on the order of steps.
"""

from __future__ import annotations

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.geometry.query import runs

# Blocks of one level in one of the next: the curve below fills a surface in squares of four.
_TOGETHER = 4

# Bits of each coordinate on the curve; three times as many fit into 64.
_BITS = 16


@frozen(eq=False)
class FaceBlocks:
    """Nested blocks of m faces."""

    order: IntArray  # (m,) face numbers, sorted such that each block is a run of them
    # For each level, fine to coarse, where its blocks begin among those of the level before (the
    # faces themselves for the first level).
    starts: tuple[IntArray, ...]


def nest_faces(patch: IntArray, centres: FloatArray) -> FaceBlocks:
    """Blocks of 4, 16, 64 ... faces that lie close together, by their (m, 3) centres, mm.

    No block spans two patches; `patch` (m,) is the number of each face's.
    """
    order = np.lexsort((_along_z_curve(centres), patch))
    owner = patch[order]
    starts: list[IntArray] = []
    while True:
        first = np.flatnonzero(np.concatenate(([True], owner[1:] != owner[:-1])))
        rank = runs(_sizes(first, len(owner)))[1]
        start = np.flatnonzero(rank % _TOGETHER == 0)
        if len(start) == len(owner):
            return FaceBlocks(order, tuple(starts))
        starts.append(start)
        owner = owner[start]


def share_out(
    amount: FloatArray, limit: FloatArray, may_take: BoolArray, blocks: FaceBlocks
) -> FloatArray:
    """Limit each face's amount and distribute the excess to faces close by.

    `amount` and `limit` are (m,), mm^2, not negative; a face that `may_take` (m,) gets excess from
    others in proportion to its room. The result (m,), mm^2, is at most `limit`, exactly, and
    adds up to the sum of `amount` less what the patches that it belongs to have no room for.
    """
    order = blocks.order
    most = limit[order]
    free = most - np.minimum(amount[order], most)
    room = np.where(may_take[order], free, 0.0)
    excess = amount[order] - most
    np.maximum(excess, 0.0, out=excess)
    kept = []
    for start in blocks.starts:
        if not excess.any():
            break
        excess = np.add.reduceat(excess, start)
        room = np.add.reduceat(room, start)
        taken = np.minimum(excess, room)
        excess -= taken
        left = room - taken
        kept.append(np.divide(left, room, out=np.ones_like(room), where=room > 0))
        room = left
    # The remaining room of a face is the product over all the blocks that contain it.
    weight = np.ones(len(room))
    for level in range(len(kept) - 1, -1, -1):
        count = len(kept[level - 1]) if level else len(order)
        weight = np.repeat(weight * kept[level], _sizes(blocks.starts[level], count))
    np.multiply(free, weight, out=free, where=may_take[order])
    result = np.empty_like(most)
    result[order] = most - free
    return result


def _sizes(starts: IntArray, count: int) -> IntArray:
    return np.diff(np.append(starts, count))


def _along_z_curve(points: FloatArray) -> NDArray[np.uint64]:
    """Position of each point on a space-filling curve that preserves neighbourhoods (Morton 1966).

    The bits of the three coordinates, one after the other.
    """
    lowest = points.min(axis=0)
    extent = float((points.max(axis=0) - lowest).max())
    steps = (points - lowest) * ((2**_BITS - 1) / extent if extent > 0 else 0.0)
    place = np.zeros(len(points), dtype=np.uint64)
    for axis, step in enumerate(steps.astype(np.uint64).T):
        for bit in range(_BITS):
            place |= ((step >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return place
