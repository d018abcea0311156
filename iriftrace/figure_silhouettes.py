"""Lines in a picture where the part ends or hides a farther piece of itself."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from numpy.typing import NDArray

from iriftrace.camera import Camera
from iriftrace.exr import AovImage

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


def draw_silhouettes(axes: Axes, image: AovImage, seen: BoolArray) -> None:
    """Draw the pixel edges that are silhouettes.

    Parameters
    ----------
    axes
        With the picture's pixels as its units.
    image
        AOV image of the pose.
    seen
        (h, w) mask of the pixels that see the part.
    """
    distance, slope = _distance_and_slope(image)
    face = image.channels["part.face"]
    for axis in (0, 1):
        ends = np.diff(seen, axis=axis)
        one, other = _neighbours(face, axis)
        apart = (one > 0) & (other > 0) & (one != other)
        step = np.abs(np.diff(distance, axis=axis))
        # A slanted surface steps by its slope; a silhouette by several times that.
        hides = apart & (step > 5.0 * np.maximum(*_neighbours(slope, axis)))
        axes.add_collection(
            LineCollection(
                list(_pixel_edges(ends | hides, axis)),
                colors="0.15",
                linewidths=0.8,
                capstyle="projecting",
            ),
            autolim=False,
        )


def _neighbours(pixels: NDArray[Any], axis: int) -> tuple[NDArray[Any], NDArray[Any]]:
    return (pixels[:-1], pixels[1:]) if axis == 0 else (pixels[:, :-1], pixels[:, 1:])


def _distance_and_slope(image: AovImage) -> tuple[FloatArray, FloatArray]:
    """Distance to the straight hit and its largest change to a pixel on the same plane, mm."""
    camera = Camera.from_dict(image.header["camera"])
    width, height = image.resolution
    offset = image.vector("straight").reshape(-1, 3) - camera.origin
    if camera.projection == "pinhole":
        distance = np.linalg.norm(offset, axis=1).reshape(height, width)
        pixel = distance / min(camera.focal_px)
    else:
        distance = (offset @ camera.forward).reshape(height, width)
        pixel = np.full_like(distance, max(camera.pixel_pitch_mm))
    # Near grazing incidence the tangent exceeds what the part's size allows; 85 degrees is enough.
    incidence = np.minimum(image.channels["incidence.angle"].astype(np.float64), np.radians(85.0))
    return distance, pixel * (0.1 + np.tan(incidence))


def _pixel_edges(marked: BoolArray, axis: int) -> FloatArray:
    """(n, 2, 2) array, px: ends (column, row) of the edges behind the marked pixels."""
    row, column = np.nonzero(marked)
    start = np.stack((column, row + 1) if axis == 0 else (column + 1, row), axis=1)
    along = (1, 0) if axis == 0 else (0, 1)
    return np.stack((start, start + along), axis=1).astype(np.float64)
