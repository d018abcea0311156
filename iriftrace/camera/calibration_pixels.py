"""Camera matrices that do not belong to pictures of the size that a calibration states, and
distortion coefficients in another order than OpenCV's."""

from __future__ import annotations

import re

import numpy as np

from iriftrace.camera.calibration_file import CalibrationValues
from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import warn
from iriftrace.core.files import text_in

FOCAL = (0.15, 200.0)
"""In widths of a picture: lenses without fisheye see 0.3 to 147 degrees."""

NEAR_CORNER = 0.05
"""Fraction of a picture's width and height; offsets from the middle are smaller, places larger."""

LARGEST_TANGENTIAL = 0.03
"""Larger p1 and p2 than those of lenses, which move points by a few pixels."""


_OTHER_ORDER = re.compile(r"k1[\W_]+k2[\W_]+k3[\W_]+p1[\W_]+p2", re.IGNORECASE)


def check_order(values: CalibrationValues, coefficients: FloatArray) -> None:
    """Refuse a file that names another order; warn of numbers that rather are of another one.

    These are a p1 or p2 so large that it is rather k3, and a p1 of 0, as k3 often is.
    """
    if values.path.is_file() and _OTHER_ORDER.search(text_in(values.path)):
        raise values.wrong(
            "it names its distortion coefficients in the order k1, k2, k3, p1, p2; write them in "
            "OpenCV's order k1, k2, p1, p2, k3"
        )
    p1, p2, k3 = (*coefficients, 0.0, 0.0, 0.0, 0.0, 0.0)[2:5]
    large = max(abs(p1), abs(p2)) > LARGEST_TANGENTIAL
    if large or (p1 == 0.0 != p2 and 0.0 < abs(k3) < LARGEST_TANGENTIAL):
        why = "more than lenses have" if large else "of which lenses have both or none"
        warn(
            f"{values.called} has the tangential distortion p1 = {p1:g}, p2 = {p2:g}, {why}; "
            "if its coefficients are k1, k2, k3, p1, p2, write them in OpenCV's order "
            "k1, k2, p1, p2, k3."
        )


def check_pixels(values: CalibrationValues, matrix: FloatArray, size: IntArray) -> None:
    """Refuse a camera matrix that is not of pictures of this size (width, height), in px."""
    focal, centre = matrix[0, 0], matrix[:2, 2]
    if not FOCAL[0] * size[0] <= focal <= FOCAL[1] * size[0]:
        raise values.wrong(
            f"the focal length is {focal:.4g} px for pictures {size[0]} px wide, which no such "
            "lens has; give the camera matrix and the size of the pictures in pixels"
        )
    off, swapped = (np.abs(centre / one - 0.5).max() for one in (size, size[::-1]))
    if swapped < 0.05 < off - swapped:
        raise values.wrong(
            f"its pictures are {size[0]} px wide and {size[1]} px high, but its principal point "
            f"({centre[0]:.0f}, {centre[1]:.0f}) px is the middle of pictures {size[1]} px wide; "
            "give the width first"
        )
    across, down = centre / size
    if max(abs(across), abs(down)) < NEAR_CORNER:
        raise values.wrong(
            f"its principal point ({centre[0]:.4g}, {centre[1]:.4g}) px is at the corner of the "
            "pictures, so it is counted from their middle; add half of their width and height"
        )
    if off > 0.5:
        warn(
            f"The principal point ({centre[0]:.0f}, {centre[1]:.0f}) px in {values.called} lies "
            f"outside the pictures of {size[0]} x {size[1]} px; if this is not a projector, the "
            "camera matrix is of another resolution."
        )
    elif abs(across - down) < 0.05 and min(abs(across - 0.5), abs(down - 0.5)) > 0.15:
        warn(
            f"The principal point ({centre[0]:.0f}, {centre[1]:.0f}) px in {values.called} is the "
            f"middle of pictures of about {2 * centre[0]:.0f} x {2 * centre[1]:.0f} px, and not of "
            f"{size[0]} x {size[1]} px; if the pictures were not cropped, the camera matrix is of "
            "another resolution."
        )
