"""Clouds in E57 files (ASTM E2807), read by libE57 in a child process."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from iriftrace.core.arrays import FloatArray
from iriftrace.core.child import ChildError, output_of, run_limited
from iriftrace.core.errors import InputError

_SECONDS, _BYTES_A_SECOND = 5, 1_000_000
_MEMORY, _MEMORY_A_BYTE = 3 << 30, 64
"""Limits of the child: imports take half a second and less than 1 GB of address space."""


def read_e57(path: Path) -> FloatArray:
    """Read the points (n, 3) of the one scan of an E57 file, at its pose, in the file's unit.

    The standard's unit is the metre; some programs write mm. Points that the file marks as invalid
    are left out; those at the scanner's origin are NaN.
    """
    if find_spec("pye57") is None:
        raise InputError(
            f"{path} is an E57 file, which needs pye57: pip install 'iriftrace[e57]'; or export "
            "the cloud as .ply."
        )
    try:
        points = output_of(__name__, str(path), str(path.stat().st_size))
    except ChildError as error:
        raise InputError(f"{path} cannot be read ({error}); export the cloud again.") from error
    return np.frombuffer(points).reshape(-1, 3)


def _points(path: str) -> bytes:
    import pye57

    try:
        file = pye57.E57(path)
        scans = file.scan_count
        scan = file.read_scan(0, ignore_missing_fields=True) if scans == 1 else {}
        origin = file.get_header(0).translation if scans == 1 else None
    except pye57.libe57.E57Exception as error:
        # Where in its own source the library noticed comes after four asterisks.
        raise ValueError(str(error).partition("****")[0].strip()) from error
    if scans != 1:
        raise ValueError(
            f"it holds {scans} scans, and the air is another for each sensor's position: "
            "give each scan as a file of its own"
        )
    rows = np.stack([scan[f"cartesian{axis}"] for axis in "XYZ"], axis=1)
    rows = rows.astype(np.float64)
    # Not measured, like (0, 0, 0) in a file without poses.
    rows[(rows == origin).all(axis=1)] = np.nan
    return rows.tobytes()


if __name__ == "__main__":
    _size = int(sys.argv[2])
    run_limited(
        lambda: _points(sys.argv[1]),
        _MEMORY + _MEMORY_A_BYTE * _size,
        _SECONDS + _size // _BYTES_A_SECOND,
    )
