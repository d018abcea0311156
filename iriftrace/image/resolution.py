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
from scipy.spatial import cKDTree

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray, IntArray

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


# MERGE nearest: The nearest other hit point of each hit point, for the paper's readings of the re

# One half of the eight pixels around a pixel, as (rows, columns); each pair of pixels is met once.
_AROUND = ((0, 1), (1, -1), (1, 0), (1, 1))

# Half sizes of the windows, px, that are searched where the eight pixels around prove nothing.
_WINDOWS = (2, 4, 8)

# Hits are rounded to float32, so they lie a little beside their pixels' rays; far less than this.
_ROUNDING_PX = 0.1


@frozen(eq=False)
class Nearest:
    """The nearest other point of each point, (n,) arrays.

    Attributes
    ----------
    number
        Which point it is; of several at the same distance any.
    by_window
        Whether a window of pixels was proven to hold it, so that no k-d tree was asked.
    """

    number: IntArray
    by_window: NDArray[np.bool_]

    def spacing(self, points: FloatArray) -> Spacing:
        """Step from each of the points, (n, 3) array, mm, camera frame, to its nearest."""
        x, y, z = (row[self.number] - row for row in np.ascontiguousarray(points.T))
        return Spacing(np.sqrt(x * x + y * y), np.abs(z))


def nearest_in_plane(points: FloatArray, grid: PixelGrid, camera: Camera) -> Nearest:
    """The point nearest to each point across the optical axis.

    Only parallel rays let windows of pixels prove anything.

    Parameters
    ----------
    points
        (n, 3) hit points, mm, camera frame; at least two.
    grid
        Their pixels.
    camera
        The camera that sees them.
    """
    if camera.projection == "orthographic":
        return _nearest_by_window(points, points[:, :2], grid, camera)
    return Nearest(_nearest(points[:, :2], slice(None)), np.zeros(len(points), dtype=np.bool_))


def nearest_in_space(points: FloatArray, grid: PixelGrid, camera: Camera) -> Nearest:
    """The point nearest to each point in three dimensions.

    Parameters
    ----------
    points
        (n, 3) hit points, mm, camera frame; at least two.
    grid
        Their pixels.
    camera
        The camera that sees them.
    """
    return _nearest_by_window(points, points, grid, camera)


def _nearest_by_window(
    points: FloatArray, coordinates: FloatArray, grid: PixelGrid, camera: Camera
) -> Nearest:
    """Search windows of pixels around each point, and a k-d tree where that proves nothing.

    A point nearer than the candidate is seen less than so many pixels away (`_reach_px`). If all of
    these have been looked at, none was overlooked.
    """
    rows = np.ascontiguousarray(coordinates.T)
    closest, nearest = _search_around(rows, grid)
    reach = _reach_px(points, np.sqrt(closest), camera)
    proven = reach < 2 - _ROUNDING_PX
    for half in _WINDOWS:
        enough = half + 1 - _ROUNDING_PX
        members = np.flatnonzero(~proven & ((reach < enough) | np.isinf(closest)))
        _search_window(rows, grid, members, half, closest, nearest)
        reach[members] = _reach_px(points[members], np.sqrt(closest[members]), camera)
        proven[members] = reach[members] < enough
    rest = np.flatnonzero(~proven)
    if len(rest):
        nearest[rest] = _nearest(coordinates, rest)
    return Nearest(nearest, proven)


def _search_around(rows: FloatArray, grid: PixelGrid) -> tuple[FloatArray, IntArray]:
    """Squared distance and number of the nearest of the eight points around; inf if none."""
    count = rows.shape[1]
    closest = np.full(count, np.inf)
    offset = np.zeros(count, dtype=np.int64)
    for down, right in _AROUND:
        first, second = grid.pairs(down, right)
        squared = _squared_distances(rows, first, second)
        ahead = down * grid.width + right
        for here, there in ((first, ahead), (second, -ahead)):
            candidate = np.full(count, np.inf)
            candidate[here] = squared
            closer = candidate < closest
            np.copyto(closest, candidate, where=closer)
            np.copyto(offset, there, where=closer)
    return closest, grid.number[grid.pixels + offset].astype(np.int64)


def _search_window(
    rows: FloatArray,
    grid: PixelGrid,
    members: IntArray,
    half: int,
    closest: FloatArray,
    nearest: IntArray,
) -> None:
    """Look at the pixels up to `half` away from some points' but the eight next to these."""
    if len(members) == 0:
        return
    row, column = np.divmod(grid.pixels[members], grid.width)
    for down in range(-half, half + 1):
        for right in range(-half, half + 1):
            if max(abs(down), abs(right)) <= 1:
                continue
            inside = (row + down >= 0) & (row + down < grid.height)
            inside &= (column + right >= 0) & (column + right < grid.width)
            first = members[inside]
            second = grid.number[grid.pixels[first] + down * grid.width + right]
            first, second = first[second >= 0], second[second >= 0]
            squared = _squared_distances(rows, first, second)
            closer = squared < closest[first]
            closest[first[closer]] = squared[closer]
            nearest[first[closer]] = second[closer]


def _squared_distances(rows: FloatArray, first: IntArray, second: NDArray[np.int32]) -> FloatArray:
    total = np.zeros(len(first))
    for values in rows:
        total += (values[second] - values[first]) ** 2
    return total


def _reach_px(points: FloatArray, distance: FloatArray, camera: Camera) -> FloatArray:
    """How far away in the picture a point at `distance` can be, px; inf when unknown."""
    if camera.projection == "orthographic":
        return distance / min(camera.pixel_pitch_mm)
    x, y, z = points.T
    slope = np.maximum(np.abs(x), np.abs(y)) / z
    # Infinite distances (no neighbour) and points that reach the camera give no bound.
    beyond = z - distance
    reach = np.full(len(points), np.inf)
    known = beyond > 0
    factor = camera.steepest_px * np.sqrt(1 + slope[known] ** 2)
    reach[known] = factor * distance[known] / beyond[known]
    return reach


def _nearest(points: FloatArray, queries: IntArray | slice) -> IntArray:
    """Number of the nearest other point of each queried one."""
    # An unbalanced tree is built twice as fast and is searched as fast.
    tree = cKDTree(points, balanced_tree=False, compact_nodes=False)
    asked = points[queries]
    own = np.arange(len(points))[queries]
    found: IntArray = tree.query(asked, k=2, workers=-1)[1]
    # Of two equal points either may come first.
    return np.where(found[:, 0] == own, found[:, 1], found[:, 0])
