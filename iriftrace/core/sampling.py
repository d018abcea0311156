"""Sequences of numbers that fill a square evenly."""

from __future__ import annotations

import numpy as np

from iriftrace.core.arrays import FloatArray, as_float64

_STEPS = (0.7548776662466927, 0.5698402909980532)


def r2_sequence(count: int, start: float = 0.0) -> FloatArray:
    """Points (count, 2) in the unit square by Roberts' R2 sequence (2018), from number `start`."""
    return as_float64((np.arange(count)[:, None] + start) * _STEPS % 1.0)
