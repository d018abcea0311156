"""Clouds in PTX files of Leica Cyclone and other programs for laser scanners.

Two lines with the numbers of columns and rows, four of the scanner's place and axes, four of the
4x4 matrix by which row vectors are multiplied, then a row ``x y z intensity`` for every direction,
with ``r g b`` where the scan has colours. Coordinates are in the scanner's frame, in metres.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from iriftrace.core.arrays import AnyArray, FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.files import text_in
from iriftrace.core.number_table import numbers
from iriftrace.geometry.transform import apply, checked_matrix, rigid_motion

_HEADER = 10
_COLUMNS = ("intensity", "red", "green", "blue")


def read_ptx(path: Path) -> tuple[FloatArray, dict[str, AnyArray]]:
    """Read the points (n, 3), m, of the one scan of a PTX file, at its pose, and its columns (n,).

    Directions without a point, at (0, 0, 0) of the scanner, are NaN. Raises InputError for a file
    that is damaged or has several scans.
    """
    lines = [line for line in text_in(path).splitlines() if line.strip()]
    try:
        count = int(lines[0]) * int(lines[1])
        matrix = np.array([line.split() for line in lines[6:_HEADER]], dtype=np.float64)
    except (ValueError, IndexError) as error:
        raise InputError(f"{path} does not begin as a PTX file; export it again.") from error
    rows = lines[_HEADER:]
    if len(rows) > count > 0 and rows[count].strip().isdecimal():
        raise InputError(
            f"{path} holds several scans, and the air is another for each sensor's position: give "
            "each scan as a file of its own."
        )
    if len(rows) != count or count <= 0:
        raise InputError(
            f"{path} states {count:,} points and holds {len(rows):,}; export the scan again."
        )
    motion = rigid_motion(checked_matrix(matrix.T, f"of {path}"), f"The matrix of {path}")
    table = numbers(rows, None, path, "points")
    points = table[:, :3].copy()
    points[~points.any(axis=1)] = np.nan
    return apply(motion, points), dict(zip(_COLUMNS, table[:, 3:].T, strict=False))
