"""The ragged arrays of a sweep's netCDF file, written pose by pose: one is in memory at a time."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from iriftrace.face_sightings import COLUMNS, FaceSightings

SIGHTING = "sighting"
"""Dimension of the rows of all poses."""

_CHUNK = 65_536
# Higher levels make the files 1 to 3 % smaller and take several times as long.
_LEVEL = 4


def append_sightings(path: Path, rows: int, sightings: Iterable[FaceSightings]) -> None:
    """Add what each pose sees to a netCDF file that lacks it.

    Parameters
    ----------
    path : Path
    rows : int
        Number of rows of all poses.
    sightings : iterable of FaceSightings
        Of each pose, in their order.
    """
    import h5netcdf

    with h5netcdf.File(path, "r+") as file:
        file.dimensions[SIGHTING] = rows
        columns = {}
        for name, (kind, unit, text) in COLUMNS.items():
            column = file.create_variable(
                f"{SIGHTING}_{name}",
                (SIGHTING,),
                np.dtype(kind),
                chunks=(min(_CHUNK, max(rows, 1)),),
                compression="gzip",
                compression_opts=_LEVEL,
                shuffle=True,
            )
            column.attrs["units"] = unit
            column.attrs["long_name"] = text
            columns[name] = column
        start = 0
        for found in sightings:
            if len(found) == 0:
                continue
            for name, column in columns.items():
                column[start : start + len(found)] = getattr(found, name)
            start += len(found)
