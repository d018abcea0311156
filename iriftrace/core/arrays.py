"""Array types by element type."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Float32Array = NDArray[np.float32]
NumberArray = NDArray[np.uint32]
Int32Array = NDArray[np.int32]
AnyIntArray = NDArray[np.integer[Any]]
AnyArray = NDArray[Any]
"""Arrays of any elements: columns of a table, structured rows, the content of a file."""

Variable = tuple[tuple[str, ...], AnyArray] | tuple[tuple[str, ...], AnyArray, Mapping[str, object]]
"""A variable of a dataset as xarray takes it: dimensions, values, and maybe attributes."""

Variables = dict[str, Variable]

Triple = tuple[float, float, float]
"""A vector in a file: its components along x, y and z."""


def as_float64(values: ArrayLike) -> FloatArray:
    """An array in double precision."""
    return np.asarray(values, dtype=np.float64)
