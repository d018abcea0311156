"""Pixels in tiles: a permutation for every size of a picture, whole tiles first in every band."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from iriftrace.camera.tiles import TILE, pixels_in_tiles

SIZES = st.integers(min_value=1, max_value=23)


@given(width=SIZES, height=SIZES)
def test_each_pixel_once(width: int, height: int) -> None:
    """No ray is lost and none is traced twice, whatever is left at the edges."""
    order = pixels_in_tiles(width, height)
    assert np.array_equal(np.sort(order), np.arange(width * height))


@given(width=SIZES, height=SIZES)
def test_tiles_are_small(width: int, height: int) -> None:
    """The pixels of each tile, edges included, stand together and within 4 x 4."""
    order = pixels_in_tiles(width, height).astype(int)
    x, y = order % width, order // width
    across = -(-width // TILE)
    tile = (y // TILE) * across + x // TILE
    assert (np.diff(tile) >= 0).all()
