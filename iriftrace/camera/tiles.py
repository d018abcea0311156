"""Pixels and places of a picture: an order in which neighbouring rays run together, and masks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray

TILE = 4
"""Side of a tile, px. A packet of the ray query holds 16 rays (8 without AVX-512)."""

_WIDEST = 1 << 20
"""Pixels: more than any picture has."""


def pixels_in_tiles(width: int, height: int) -> NDArray[np.uint32]:
    """Row-major numbers of a picture's pixels, tile by tile, (width * height,) array.

    Tiles at the right and lower edge are smaller. Rays of a tile meet the same triangles far more
    often than those of as many pixels in a row.
    """
    whole = width - width % TILE

    def ordered(bands: NDArray[np.uint32]) -> NDArray[np.uint32]:
        count, rows, _ = bands.shape
        tiles = bands[..., :whole].reshape(count, rows, whole // TILE, TILE).swapaxes(1, 2)
        rest = bands[..., whole:]
        parts = tiles.reshape(count, rows * whole), rest.reshape(count, rows * (width - whole))
        return np.hstack(parts).ravel()

    pixels = np.arange(width * height, dtype=np.uint32).reshape(height, width)
    above = height - height % TILE
    bands = pixels[:above].reshape(above // TILE, TILE, width)
    return np.concatenate((ordered(bands), ordered(pixels[None, above:])))


def tile_numbers(places: FloatArray) -> IntArray:
    """Numbers (n,) that sort places (n, 2), px, tile by tile; what lies beyond comes somewhere."""
    pixels = np.nan_to_num(places).clip(0, _WIDEST).astype(np.int64)
    column, row = (pixels // TILE).T
    inner = pixels % TILE
    return np.asarray((row * _WIDEST + column) * TILE**2 + inner[:, 1] * TILE + inner[:, 0])


def within(places: FloatArray, low: FloatArray, high: FloatArray) -> BoolArray:
    """(n,) mask of the places (n, 2) in a rectangle; of NaN False."""
    # Axis by axis, which takes an eighth of the time of pairs.
    (u, v), (left, top), (right, bottom) = places.T, low, high
    return np.asarray((u >= left) & (u <= right) & (v >= top) & (v <= bottom))
