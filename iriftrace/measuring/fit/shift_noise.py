"""Noise of shifts measured at scattered places, from differences between neighbours."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError

NEIGHBOURS = 16
"""Number of places, each one with its neighbours, through which a quadratic surface is fitted."""

FEWEST_PLACES = 30
_NORMAL_MEDIAN = 0.6745  # Median of a normal distribution's absolute values, of deviation 1.


def shift_noise(places: FloatArray, shifts: FloatArray) -> float:
    """Standard deviation, px, of one component of shifts (n, 2), px, at places (n, 2), px.

    Each shift is compared with the quadratic surface fitted to it and its neighbours (least
    squares). The median ignores the places where the shifts themselves change faster. Raises
    InputError for fewer than `FEWEST_PLACES` places.
    """
    if len(places) < FEWEST_PLACES:
        raise InputError(
            f"The noise of {len(places)} shifts cannot be estimated from their differences, as it "
            f"needs {FEWEST_PLACES}; state it in pixels, such as 0.05.",
            code="noise.unknown",
            argument="noise",
        )
    _, near = cKDTree(places).query(places, NEIGHBOURS)
    offset = places[near] - places[:, None]
    x, y = np.moveaxis(offset / np.abs(offset).max(), 2, 0)
    surface = np.stack((np.ones_like(x), x, y, x * x, x * y, y * y), axis=2)
    # Row 0 of each inverse gives the plane's value at the place, the first of its neighbours.
    weight = np.linalg.pinv(surface)[:, 0]
    fitted = np.einsum("nk,nkc->nc", weight, shifts[near])
    freedom = 1.0 - weight[:, 0]
    known = freedom > 1e-6
    rest = np.abs(shifts - fitted)[known] / np.sqrt(freedom[known])[:, None]
    return float(np.median(rest)) / _NORMAL_MEDIAN
