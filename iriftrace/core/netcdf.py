"""Check netCDF files in a child process before they are opened.

HDF5 trusts the header of a file: a damaged file can make it run for ever or crash.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from iriftrace.core.child import ChildError, read_in_child
from iriftrace.core.errors import InputError


def check_netcdf(path: Path) -> None:
    """Refuse a file that HDF5 cannot read, or with variables too large for its size."""
    state = path.stat()
    fault = _fault(path.absolute(), state.st_size, state.st_mtime_ns)
    if fault:
        raise InputError(f"{path} is damaged or no netCDF file ({fault}); write it again.")


@cache
def _fault(path: Path, size: int, _changed_ns: int) -> str:
    """Fault of a file in this state, from the child; "" if all of it can be read."""
    try:
        read_in_child("iriftrace.core.netcdf_child:read_through", size, str(path), size)
    except ChildError as error:
        return str(error)
    return ""
