"""Rows of a cloud in which numbers such as -9999 stand for a point that was not measured."""

from __future__ import annotations

import re

import numpy as np

from iriftrace.core.arrays import BoolArray, FloatArray

_FEWEST = 3
"""Rows with one number in them, without which it may be a stray point."""

_FAR = 10.0
"""Distance from the other points, in diagonals of the box around nine tenths of them."""

_MARK = re.compile(r"9{3}[9.]*|10{4,}|1e\+\d+")
"""Numbers that programs write for none, in six digits: all nines, and powers of ten from 1e4 on."""

_SAMPLE = 100_000


def marked_rows(rows: FloatArray, measured: BoolArray) -> dict[str, BoolArray]:
    """Masks (m,) of the measured rows (m, 3) with a mark, by the axis and the mark.

    A mark is a number that three or more rows have exactly, much farther from the rest than these
    are from each other. It is one of nines or a power of ten, unless the whole rows are equal.
    """
    found = {}
    left = measured.copy()
    while (marked := _outermost(rows, left)) is not None:
        name, mask = marked
        found[name] = mask
        left &= ~mask
    return found


def _outermost(rows: FloatArray, left: BoolArray) -> tuple[str, BoolArray] | None:
    """Name and rows of a mark at an end of an axis; None where there is none."""
    if not left.any():
        return None
    for axis in range(3):
        column = np.where(left, rows[:, axis], np.nan)
        for value in (np.nanmax(column), np.nanmin(column)):
            mask = column == value
            if mask.sum() < _FEWEST:
                continue
            same = not np.ptp(rows[mask], axis=0).any()
            if not same and not _MARK.fullmatch(f"{abs(value):g}"):
                continue
            rest = rows[left & ~mask]
            if len(rest) < _FEWEST:
                continue
            low, middle, high = np.quantile(rest[:: len(rest) // _SAMPLE + 1], (0.05, 0.5, 0.95), 0)
            if abs(value - middle[axis]) > _FAR * np.linalg.norm(high - low):
                return f"at {'xyz'[axis]} = {value:g}, far from the others", mask
    return None
