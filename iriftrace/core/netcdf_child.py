"""Child process that reads a netCDF file, as `iriftrace.core.netcdf` asks for."""

from __future__ import annotations

from math import prod

import h5py

from iriftrace.core.files import MOST_PACKED

_SMALL = 1 << 28
"""Bytes that any file may unpack to: what no pose sees packs a thousand times, but is never more.

A variable over ten million faces has 80 MB.
"""

_ROWS = 1 << 20


def read_through(path: str, size: int) -> None:
    """Read all attributes and variables, part by part; returns nothing."""
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
