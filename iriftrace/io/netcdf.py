"""NetCDF files of results: their attributes, and reading, after a check in a child process.

HDF5 trusts the header of a file: a damaged file can make it run for ever or crash.
"""

from __future__ import annotations

import json
from functools import cache
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING

from iriftrace.core.files import MOST_PACKED
from iriftrace.core.isolated import ChildError, read_in_child
from iriftrace.core.plain import JsonObject
from iriftrace.io.refusals import check_exists, check_schema, damaged

if TYPE_CHECKING:
    import xarray as xr

_SMALL = 1 << 28
"""Bytes that any file may unpack to: what no pose sees packs a thousand times, but is never more.

A variable over ten million faces has 80 MB.
"""

_ROWS = 1 << 20


def json_attributes(values: JsonObject) -> dict[str, str | int | float]:
    """Attributes of a file; values that are not numbers or strings become JSON."""
    return {
        key: value if isinstance(value, str | int | float) else json.dumps(value)
        for key, value in values.items()
    }


def read_netcdf(path: Path, kind: str, schema: str, *, left_in_file: str = "") -> xr.Dataset:
    """Read a result of the command ``iriftrace KIND``.

    Variables over the dimension `left_in_file` are read on use from the file, which stays open as
    long as the dataset exists. Raises InputError if the file is missing, not netCDF, or not of the
    schema.
    """
    import xarray as xr

    remedy = f"give the .nc that `iriftrace {kind}` writes"
    check_exists(path, remedy)
    with path.open("rb") as file:
        if file.read(8) != b"\x89HDF\r\n\x1a\n":
            raise damaged(path, "it is no netCDF file", remedy)
    check_netcdf(path)
    try:
        dataset = xr.open_dataset(path, engine="h5netcdf")
        for variable in dataset.variables.values():
            if left_in_file not in variable.dims:
                variable.load()
    except Exception as error:  # xarray decodes what a damaged file states, with any error
        raise damaged(path, error, remedy) from error
    stated = dataset.attrs.get("schema")
    if not left_in_file or stated != schema:
        dataset.close()
    check_schema(path, stated, schema, f"run the {kind} again")
    return dataset


def check_netcdf(path: Path) -> None:
    """Refuse a file that HDF5 cannot read, or with variables too large for its size."""
    state = path.stat()
    fault = _fault(path.absolute(), state.st_size, state.st_mtime_ns)
    if fault:
        raise damaged(path, fault, "write it again")


@cache
def _fault(path: Path, size: int, _changed_ns: int) -> str:
    """Fault of a file in this state, from the child; "" if all of it can be read."""
    try:
        read_in_child(f"{__name__}:read_through", size, str(path), size)
    except ChildError as error:
        return str(error)
    return ""


def read_through(path: str, size: int) -> None:
    """Read all attributes and variables, part by part, in the child; returns nothing."""
    import h5py

    with h5py.File(path, "r") as file:
        dict(file.attrs)
        # Not groups and dimensions without values.
        variables = [
            found
            for found in file.values()
            if isinstance(found, h5py.Dataset)
            and "This is a netCDF dimension" not in str(dict(found.attrs).get("NAME", ""))
        ]
        stated = sum(prod(v.shape) * v.dtype.itemsize for v in variables)
        if stated > _SMALL + MOST_PACKED * size:
            raise ValueError(f"its {size:,} bytes would unpack to {stated:,}")
        for variable in variables:
            if not variable.shape:
                variable[...]
            for start in range(0, variable.shape[0] if variable.shape else 0, _ROWS):
                variable[start : start + _ROWS]
