"""NumPy arrays laid out so that the kernels that read them stay the same."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

BYTES = 128
"""The widest vector that Dr.Jit loads: 16 numbers of 8 bytes."""


def aligned(values: NDArray[Any]) -> NDArray[Any]:
    """Copy an array of one dimension to memory that starts at a multiple of 128 bytes.

    Dr.Jit reads NumPy's own memory where it can, and writes into the kernel whether an address is
    aligned. NumPy's addresses are so by chance, and each other combination compiles a kernel anew.
    """
    memory = np.empty(values.nbytes + BYTES, dtype=np.uint8)
    start = -memory.ctypes.data % BYTES
    copy = memory[start : start + values.nbytes].view(values.dtype)
    copy[:] = values
    return copy
