"""NetCDF files looked through in a child process before anyone opens them.

HDF5 trusts what a file says of itself: a damaged one can keep it busy for ever or end the process.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from iriftrace.core.child import ChildError, read_in_child
from iriftrace.core.errors import InputError


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
        read_in_child("iriftrace.core.netcdf_child:read_through", size, str(path), size)
    except ChildError as error:
        return str(error)
    return ""
