"""Sampling of the part by the rays of one pose: its resolution.

That is the larger step to the next pixel's hit on the same smooth patch of the surface, across and
along the optical axis. The distance to the nearest neighbour among the hits would be none: on a
plane tilted about a pixel axis the nearest point lies at the same depth, whatever the tilt.
"""

from __future__ import annotations

import numpy as np

from iriftrace.core.arrays import FloatArray, IntArray

STEP = "step to the next pixel"
"""Its meaning, for files, axes and messages."""

FRONTAL = "plane seen frontally"
"""Reason for an axial resolution of 0, for messages."""

FRONTAL_SLOPE = 1e-3
"""Ratio of steps along and across the axis below which only the rounding of hits is left."""


Spacing = tuple[FloatArray, FloatArray]
"""Distance from each of n points to a neighbour, across and along the optical axis, (n,) arrays,
mm, NaN where there is none."""


def step_spacing(
    points: FloatArray, pixels: IntArray, resolution: tuple[int, int], group: IntArray
) -> Spacing:
    """Larger step from each point to the next pixel's point, to the right and below.

    Input are (n, 3) hit points, mm, camera frame, with ascending row-major pixel numbers (n,) in a
    picture of `resolution` (width, height). Steps between smooth patches, `group` (n,), do not
    count. Lateral is ``hypot(dx, dy)``, axial ``|dz|``, each the larger of the (at most two) steps.
    """
    width, height = resolution
    x, y, z = np.ascontiguousarray(points.T)
    lateral, axial = (np.full(len(points), -1.0) for _ in range(2))
    # The point to the right is the next one, so that no number has to be looked up.
    next_to = (np.diff(pixels) == 1) & (group[1:] == group[:-1]) & (pixels[1:] % width != 0)
    across = np.sqrt(np.diff(x) ** 2 + np.diff(y) ** 2)
    np.copyto(lateral[:-1], across, where=next_to)
    np.copyto(axial[:-1], np.abs(np.diff(z)), where=next_to)

    number = np.full(width * (height + 1), -1, dtype=np.int32)
    number[pixels] = np.arange(len(pixels), dtype=np.int32)
    second = number[pixels + width]
    first = np.flatnonzero((second >= 0) & (group == group[second]))
    second = second[first]
    across = np.sqrt((x[second] - x[first]) ** 2 + (y[second] - y[first]) ** 2)
    lateral[first] = np.maximum(lateral[first], across)
    axial[first] = np.maximum(axial[first], np.abs(z[second] - z[first]))
    lateral[lateral < 0] = np.nan
    axial[axial < 0] = np.nan
    return lateral, axial


def seen_frontally(lateral: float, axial: float) -> bool:
    """True if steps to the next pixel have no depth: the surface is a plane across the axis.

    Steps across and along the optical axis have one unit; they are NaN where they are not known.
    """
    return bool(axial < FRONTAL_SLOPE * lateral)
