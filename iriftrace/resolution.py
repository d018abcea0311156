"""How finely the rays of one pose sample the part: three readings of "resolution".

The method's paper takes the distance to the nearest neighbour among the hit points, across and
along the optical axis. Nearest can mean in three dimensions (``nn3d``) or in the plane across the
axis (``nnxy``); on a plane tilted about a pixel axis the nearest point in either sense lies at the
same depth, so that the axial value is 0. The main reading is therefore the larger step to the next
pixel's hit on the same smooth patch of the surface. The other two come from `iriftrace.nearest`.
"""

from __future__ import annotations

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


FRONTAL = "plane seen frontally"
"""Why an axial resolution is 0, in words."""

FRONTAL_SLOPE = 1e-3
"""Steps along over steps across the axis below which only the rounding of hits is left of them."""


@frozen(eq=False)
class Spacing:
    """Distance from each point to a neighbour, (n,) arrays, mm, NaN where there is none.

    Attributes
    ----------
    lateral, axial
        Across and along the optical axis.
    """

    lateral: FloatArray
    axial: FloatArray


@frozen(eq=False)
class PixelGrid:
    """Places of n points in a picture.

    Attributes
    ----------
    pixels
        (n,) row-major pixel numbers, rising.
    number
        (height * width,) number of the pixel's point, -1 for none.
    width, height
        Size of the picture in pixels.
    """

    pixels: IntArray
    number: NDArray[np.int32]
    width: int
    height: int

    def pairs(self, rows: int, columns: int) -> tuple[IntArray, NDArray[np.int32]]:
        """Numbers of the points that have a point `rows` below and `columns` to the right."""
        inside = self.pixels < (self.height - rows) * self.width
        if columns:
            column = self.pixels % self.width
            inside &= (column < self.width - columns) if columns > 0 else (column >= -columns)
        first = np.flatnonzero(inside)
        second = self.number[self.pixels[first] + rows * self.width + columns]
        both = second >= 0
        return first[both], second[both]


def pixel_grid(pixels: IntArray, resolution: tuple[int, int]) -> PixelGrid:
    """Grid of the points of some pixels.

    Parameters
    ----------
    pixels
        (n,) row-major pixel numbers, rising.
    resolution
        Width and height of the picture.
    """
    width, height = resolution
    number = np.full(width * height, -1, dtype=np.int32)
    number[pixels] = np.arange(len(pixels), dtype=np.int32)
    return PixelGrid(pixels, number, width, height)


def seen_frontally(lateral: float, axial: float) -> bool:
    """Whether steps to the next pixel have no depth, so that a plane across the axis is seen.

    Parameters
    ----------
    lateral, axial
        Steps across and along the optical axis, of one unit; NaN where they are not known.
    """
    return bool(axial < FRONTAL_SLOPE * lateral)


def step_spacing(points: FloatArray, grid: PixelGrid, group: IntArray) -> Spacing:
    """Larger step from each point to the next pixel's point, to the right and below.

    Parameters
    ----------
    points
        (n, 3) hit points, mm, camera frame.
    grid
        Their pixels.
    group
        (n,) smooth patch of each point; steps from one patch to another do not count.

    Returns
    -------
    Spacing
        ``hypot(dx, dy)`` and ``|dz|``, each the larger one of the (at most two) steps.
    """
    x, y, z = np.ascontiguousarray(points.T)
    lateral, axial = (np.full(len(points), -1.0) for _ in range(2))
    # The point to the right is the next one, so that no number has to be looked up.
    next_to = (np.diff(grid.pixels) == 1) & (group[1:] == group[:-1])
    next_to &= grid.pixels[1:].astype(np.int32) % np.int32(grid.width) != 0
    across = np.sqrt(np.diff(x) ** 2 + np.diff(y) ** 2)
    np.copyto(lateral[:-1], across, where=next_to)
    np.copyto(axial[:-1], np.abs(np.diff(z)), where=next_to)

    first, second = grid.pairs(1, 0)
    same = group[first] == group[second]
    first, second = first[same], second[same]
    across = np.sqrt((x[second] - x[first]) ** 2 + (y[second] - y[first]) ** 2)
    lateral[first] = np.maximum(lateral[first], across)
    axial[first] = np.maximum(axial[first], np.abs(z[second] - z[first]))
    lateral[lateral < 0] = np.nan
    axial[axial < 0] = np.nan
    return Spacing(lateral, axial)
