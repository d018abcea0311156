"""How finely the rays of one pose sample the part: three readings of "resolution".

The method's paper takes the distance to the nearest neighbour among the hit points, across and
along the optical axis. Nearest can mean in three dimensions (``nn3d``) or in the plane across the
axis (``nnxy``); on a plane tilted about a pixel axis the nearest point in either sense lies at the
same depth, so that the axial value is 0. The main reading is therefore the larger step to the next
pixel's hit on the same smooth patch of the surface.
"""

from __future__ import annotations

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from iriftrace.camera import Camera

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# One half of the eight pixels around a pixel, as (rows, columns); each pair of pixels is met once.
_AROUND = ((0, 1), (1, -1), (1, 0), (1, 1))

# A point nearer than the candidate lies less than this many pixels away (2 is the exact bound for
# an undistorted camera). All points within one pixel have been looked at.
_CERTAIN_PX = 1.5


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
    number: IntArray
    width: int
    height: int

    def pairs(self, rows: int, columns: int) -> tuple[IntArray, IntArray]:
        """Numbers of the points that have a point `rows` below and `columns` to the right."""
        column = self.pixels % self.width
        inside = self.pixels < (self.height - rows) * self.width
        if columns:
            inside &= (column < self.width - columns) if columns > 0 else (column >= -columns)
        first = np.flatnonzero(inside)
        second = self.number[self.pixels[first] + rows * self.width + columns]
        both = second >= 0
        return first[both], second[both]


def pixel_grid(good: NDArray[np.bool_]) -> PixelGrid:
    """Grid of the points of a (height, width) mask, numbered row by row."""
    pixels = np.flatnonzero(good)
    number = np.full(good.size, -1, dtype=np.int64)
    number[pixels] = np.arange(len(pixels))
    height, width = good.shape
    return PixelGrid(pixels, number, width, height)


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
    for rows, columns in ((0, 1), (1, 0)):
        first, second = grid.pairs(rows, columns)
        same = group[first] == group[second]
        first, second = first[same], second[same]
        across = np.sqrt((x[second] - x[first]) ** 2 + (y[second] - y[first]) ** 2)
        lateral[first] = np.maximum(lateral[first], across)
        axial[first] = np.maximum(axial[first], np.abs(z[second] - z[first]))
    lateral[lateral < 0] = np.nan
    axial[axial < 0] = np.nan
    return Spacing(lateral, axial)


def nearest_in_plane(points: FloatArray) -> Spacing:
    """Step from each point to the one nearest to it across the optical axis.

    Parameters
    ----------
    points
        (n, 3) hit points, mm, camera frame; at least two.
    """
    return _step_to(points, _nearest(points[:, :2], slice(None)))


def nearest_in_space(points: FloatArray, grid: PixelGrid, camera: Camera) -> Spacing:
    """Step from each point to the one nearest to it in three dimensions.

    The nearest point nearly always belongs to one of the eight pixels around: a point at distance d
    is seen at most ``f d sqrt(1 + (x/z)^2) / (z - d)`` pixels away, and if that is too few to leave
    the eight, none was overlooked. Only the other points are looked up in a k-d tree.

    Parameters
    ----------
    points
        (n, 3) hit points, mm, camera frame; at least two.
    grid
        Their pixels.
    camera
        The camera that sees them.
    """
    x, y, z = np.ascontiguousarray(points.T)
    closest = np.full(len(points), np.inf)
    offset = np.zeros(len(points), dtype=np.int64)
    for rows, columns in _AROUND:
        first, second = grid.pairs(rows, columns)
        squared = (x[second] - x[first]) ** 2
        squared += (y[second] - y[first]) ** 2
        squared += (z[second] - z[first]) ** 2
        ahead = rows * grid.width + columns
        for here, there in ((first, ahead), (second, -ahead)):
            candidate = np.full(len(points), np.inf)
            candidate[here] = squared
            closer = candidate < closest
            np.copyto(closest, candidate, where=closer)
            np.copyto(offset, there, where=closer)
    # A point without any neighbour finds itself here; it is among the doubtful ones below.
    nearest = grid.number[grid.pixels + offset]
    doubtful = np.flatnonzero(~(_reach_px(points, np.sqrt(closest), camera) < _CERTAIN_PX))
    if len(doubtful):
        nearest[doubtful] = _nearest(points, doubtful)
    return _step_to(points, nearest)


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
    factor = max(camera.focal_px) * np.sqrt(1 + slope[known] ** 2)
    reach[known] = factor * distance[known] / beyond[known]
    return reach


def _nearest(points: FloatArray, queries: IntArray | slice) -> IntArray:
    """Number of the nearest other point of each queried one."""
    # An unbalanced tree is built twice as fast and is searched as fast.
    tree = cKDTree(points, balanced_tree=False)
    asked = points[queries]
    own = np.arange(len(points))[queries]
    found: IntArray = tree.query(asked, k=2, workers=-1)[1]
    # Of two equal points either may come first.
    return np.where(found[:, 0] == own, found[:, 1], found[:, 0])


def _step_to(points: FloatArray, there: IntArray) -> Spacing:
    step = points[there] - points
    return Spacing(np.sqrt(step[:, 0] ** 2 + step[:, 1] ** 2), np.abs(step[:, 2]))
