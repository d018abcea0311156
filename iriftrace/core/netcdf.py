"""NetCDF files looked through in a child process before anyone opens them.

HDF5 trusts what a file says of itself: a damaged one can keep it busy for ever or end the process.
"""

from __future__ import annotations

import sys
from functools import cache
from math import prod
from pathlib import Path

from iriftrace.core.child import ChildError, output_of, run_limited
from iriftrace.core.errors import InputError
from iriftrace.core.files import MOST_PACKED

_SECONDS, _BYTES_A_SECOND = 5, 10_000_000
"""Processor time of the child: imports take half a second, unpacking a second for 100 MB."""

_SMALL = 1 << 28
"""Bytes that any file may unpack to: what no pose sees packs a thousand times, but is never more.

A variable over ten million faces has 80 MB.
"""

_MEMORY = 3 << 30
"""Address space of the child: its libraries take less than 1 GB, and it reads by and by."""

_ROWS = 1 << 20


def check_netcdf(path: Path) -> None:
    """Refuse a file of which HDF5 cannot read all, or that states variables too large for it."""
    state = path.stat()
    fault = _fault(path.absolute(), state.st_size, state.st_mtime_ns)
    if fault:
        raise InputError(f"{path} is damaged or no netCDF file ({fault}); write it again.")


@cache
def _fault(path: Path, size: int, _changed_ns: int) -> str:
    """What the child says of a file in this state; "" where all of it can be read."""
    try:
        output_of("iriftrace.core.netcdf", str(path), str(size))
    except ChildError as error:
        return str(error)
    return ""


def _read_through(path: str, size: int) -> bytes:
    """Read all attributes and variables, by and by; there is nothing to hand over."""
    import h5netcdf

    with h5netcdf.File(path, "r") as file:
        dict(file.attrs)
        stated = sum(prod(v.shape) * v.dtype.itemsize for v in file.variables.values())
        if stated > _SMALL + MOST_PACKED * size:
            raise ValueError(f"its {size:,} bytes would unpack to {stated:,}")
        for variable in file.variables.values():
            dict(variable.attrs)
            if not variable.shape:
                variable[...]
            for start in range(0, variable.shape[0] if variable.shape else 0, _ROWS):
                variable[start : start + _ROWS]
    return b""


if __name__ == "__main__":
    _size = int(sys.argv[2])
    run_limited(
        lambda: _read_through(sys.argv[1], _size), _MEMORY, _SECONDS + _size // _BYTES_A_SECOND
    )
