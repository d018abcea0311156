r"""Lines of sight from a device to given points: the two-point problem of geometrical optics.

A device at o sees (or lights) a point X along the refracted ray that ends there. The sensor's
software knows the straight line along which that ray leaves the device, so its direction is sought.
The line is aimed at A, beginning with A = X; the traced ray passes X by the *miss*

.. math:: m = (I - d d^T)(Y - X)

with a point Y of its last straight segment and its direction d, and A - m is the next aim. The
deflection changes little between neighbouring aims, so each round shrinks the miss by the factor
:math:`|\partial\delta / \partial x|`, some 1e-3 on a part's side, up to 0.3 straight down a plume.
Where that is not below 1 the point has several images. Two misses give the factor: where the next
miss, with a margin of `MARGIN`, is then below `MISS_MM`, the last correction is not traced again.

Points need not lie on the part: a ray continues along its last straight segment.
"""

from __future__ import annotations

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.core.mesh.triangles import row_lengths, unit_vectors
from iriftrace.tracing.rays import refracted_hits
from iriftrace.tracing.scene import Scene

MISS_MM = 1e-6
"""Largest miss of a ray that has found its point: a thousandth of what sensors resolve."""

ROUNDS = 8

MARGIN = 10.0
"""Of a miss that is foretold by the two before it; the factor depends on the miss's direction."""


@frozen(eq=False)
class LinesOfSight:
    """Straight lines from a device whose refracted rays end on n points.

    The residual is the distance to a point from the ray's end on the part, along the ray: far from
    0 where something lies between device and point, NaN where the ray does not meet the part.
    """

    direction: FloatArray  # (n, 3), unit; that of the last round where none was found
    offset: FloatArray  # (n, 3), mm, from the point to the aim of the line
    found: BoolArray  # the refracted ray passes the point by `MISS_MM` at most, traced or foretold
    residual: FloatArray  # mm
    face: IntArray  # of the part, under the ray's end; -1 where it meets none
    in_air: BoolArray  # the ray met hot air
    lost: BoolArray  # where the ray ends is not known, see `iriftrace.image.aov_image.Status.lost`


def lines_of_sight(
    scene: Scene,
    origin: FloatArray,
    points: FloatArray,
    offset: FloatArray | None = None,
    *,
    rounds: int = ROUNDS,
    bent: bool = True,
) -> LinesOfSight:
    """Find the straight lines along which a device at (3,) sees points (n, 3), mm, world.

    They lie on the part or near it, in one field. `offset` is a first guess of
    `LinesOfSight.offset`; each point is traced `rounds` times at most. Rays that are
    not `bent` run straight, as without the hot air.
    """
    aim = points + (0.0 if offset is None else offset)
    direction = unit_vectors(aim - origin)
    miss = np.full(len(points), np.nan)
    residual = np.full(len(points), np.nan)
    face = np.full(len(points), -1)
    in_air, lost = np.zeros((2, len(points)), dtype=bool)
    active = np.arange(len(points))
    for _ in range(rounds):
        if len(active) == 0:
            break
        # Not copied while all are active.
        rays = slice(None) if len(active) == len(points) else active
        ends = refracted_hits(scene, origin, direction[rays], bent=bent)
        face[rays], lost[rays] = ends.face, ends.lost
        beyond = points[rays] - ends.point
        along = np.einsum("ij,ij->i", beyond, ends.direction)
        off = along[:, None] * ends.direction - beyond
        residual[rays] = np.where(face[rays] >= 0, along, np.nan)
        in_air[rays] = ends.crossings > 0
        now = row_lengths(off)
        foretold = MARGIN * now**2 / miss[rays]
        corrected = ~(now <= MISS_MM) & ~lost[rays]
        miss[rays] = np.where(corrected & (foretold <= MISS_MM), foretold, now)
        off[~corrected] = 0.0
        aim[rays] -= off
        direction[rays] = unit_vectors(aim[rays] - origin)
        active = active[corrected & ~(miss[rays] <= MISS_MM)]
    found = (miss <= MISS_MM) & ~lost
    return LinesOfSight(direction, aim - points, found, residual, face, in_air, lost)
