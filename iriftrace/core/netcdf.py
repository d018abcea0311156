"""NetCDF files looked through in a child process before anyone opens them.

HDF5 trusts what a file says of itself: a damaged one can keep it busy for ever or end the process.
"""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
from functools import cache
from math import prod
from pathlib import Path

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
    """Refuse a file of which HDF5 cannot read all.

    Raises
    ------
    InputError
        It is damaged, no netCDF file, or states variables that cannot be in it.
    """
    state = path.stat()
    fault = _fault(path.absolute(), state.st_size, state.st_mtime_ns)
    if fault:
        raise InputError(f"{path} is damaged or no netCDF file ({fault}); write it again.")


@cache
def _fault(path: Path, size: int, _changed_ns: int) -> str:
    """What the child says of a file in this state; "" where all of it can be read."""
    done = subprocess.run(
        [sys.executable, "-m", "iriftrace.core.netcdf", str(path), str(size)],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=False,
    )
    if done.returncode < 0:
        return f"reading it ends with {signal.Signals(-done.returncode).name}"
    lines = done.stderr.decode(errors="replace").split("\n")
    return "" if done.returncode == 0 else next(filter(None, reversed(lines)), "it is unreadable")


def _read_through(path: str, size: int) -> None:
    """Read all attributes and variables, by and by."""
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


if __name__ == "__main__":
    _size = int(sys.argv[2])
    for _kind, _limit in (
        (resource.RLIMIT_AS, _MEMORY),
        (resource.RLIMIT_CPU, _SECONDS + _size // _BYTES_A_SECOND),
        (resource.RLIMIT_CORE, 0),
    ):
        resource.setrlimit(_kind, (_limit, _limit))
    try:
        _read_through(sys.argv[1], _size)
    except Exception as _error:  # HDF5 and its two layers of Python let any through
        sys.stderr.write(" ".join(str(_error).split()))
        os._exit(1)
    # Closing what is damaged can hang, too.
    os._exit(0)
