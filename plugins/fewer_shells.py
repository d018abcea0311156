"""A prepared scene with every second of its shells, to see whether there are enough of them."""

from __future__ import annotations

from copy import copy
from itertools import pairwise

from .geometry import shell_indices, surface_index
from .prepared import PreparedScene, scene_of

FEWEST = 5
"""Layers' steps below which leaving half of them out says nothing of the rest."""


def with_every_second_shell(prepared: PreparedScene) -> PreparedScene | None:
    """The same scene with the first, the third, ... and the last step of the index.

    Meshes, tables and gradients are shared. The steps of the shells that stay add up to the same
    sum.

    Parameters
    ----------
    prepared : PreparedScene

    Returns
    -------
    PreparedScene or None
        None where the shells' steps do not lead from one to the next, or are fewer than ``FEWEST``.
    """
    shapes = prepared.scene.shapes()
    pairs = [shell_indices(shape.bsdf()) for shape in shapes]
    steps = sorted({pair for pair in pairs if pair}, reverse=True)
    if len(steps) < FEWEST or any(one[1] != other[0] for one, other in pairwise(steps)):
        return None
    kept = [*steps[:-1:2], steps[-1]]
    levels = {p: surface_index(s.bsdf()) for s, p in zip(shapes, pairs, strict=True) if p}
    between = [0.5 * (levels[one] + levels[other]) for one, other in pairwise(kept)]
    ends = [kept[0][0], *between, kept[-1][1]]
    sides = dict(zip(kept, pairwise(ends), strict=True))

    fewer = copy(prepared)
    fewer.tables = prepared.tables.with_sides([sides.get(pair, (1.0, 1.0)) for pair in pairs])
    fewer.scene = scene_of(
        [s for s, pair in zip(shapes, pairs, strict=True) if pair is None or pair in sides]
    )
    return fewer
