"""Measured pixel shifts between a cold and a hot picture, read from a map or a list of markers.

A shift is the position of something in the hot picture minus its position in the cold one, in
pixels, u to the right and v down. Positions count as in OpenCV: (0, 0) is the centre of the first
pixel, so pixel ``i`` covers ``[i - 0.5, i + 0.5)``.

Correlation programs write a row for each point and mark those that they did not find.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from attrs import evolve, frozen

from iriftrace.core.arrays import BoolArray, FloatArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.files import FileOrigin, array_in, sha256_of
from iriftrace.io.exr import exr_content
from iriftrace.io.refusals import check_ending, check_exists, damaged, not_read
from iriftrace.io.table import listed, read_table

COLUMNS = ("u", "v", "du", "dv")
PAIRS = (("x", "y"), ("u", "v"), ("du", "dv"), ("dx", "dy"), ("r", "g"))
"""Names of the two channels of a map, in any case, also after a dot (``shift.px.X``)."""

MARKS: dict[str, Callable[[FloatArray], BoolArray]] = {
    "valid": lambda values: values == 0.0,
    "flags": lambda values: values != 0.0,  # OpenPIV
    "sigma": lambda values: values < 0.0,  # VIC-3D
}
"""Columns of markers, in any case, with the values that mark a place as not found."""

MOST_ZEROS = 0.02
"""Fraction of shifts of exactly (0, 0) above which they are taken for places not found."""

_SHIFT = ("shift.px.X", "shift.px.Y")


@frozen(eq=False)
class MeasuredShift:
    """Shifts measured at n places of a picture.

    Attributes
    ----------
    places : (n, 2) array, px
        Image positions; the centre of the first pixel is (0, 0).
    shifts : (n, 2) array, px
    resolution : (2,) int or None
        Width and height of a map; None for markers.
    origin : FileOrigin
        The file, its path as it was given.
    failed, zeros : int
        Numbers of places that were left out: marked as not found, and shifts of exactly (0, 0).
    doubt : str
        Remark on many shifts of exactly (0, 0) that were not left out; "" if there are few.
    """

    places: FloatArray
    shifts: FloatArray
    resolution: tuple[int, int] | None
    origin: FileOrigin
    failed: int = 0
    zeros: int = 0
    doubt: str = ""


def read_measured_shift(path: str | Path, *, without_zeros: bool | None = None) -> MeasuredShift:
    """Read measured shifts.

    Parameters
    ----------
    path : path
        ``.exr`` with two channels (see `PAIRS`) or the channels ``shift.px.X`` and ``shift.px.Y``;
        ``.npy`` with an array (height, width, 2) or (2, height, width); in both, pixels that are
        not finite were not measured. Or ``.csv`` with the columns u, v, du, dv; rows without du or
        dv were not measured, nor those marked by a column ``valid`` of 0 or false, ``flags`` other
        than 0 (OpenPIV) or a negative ``sigma`` (VIC-3D). Other columns are ignored.
    without_zeros : bool, optional
        Whether to leave out shifts of exactly (0, 0), which many programs write where they found
        nothing. By default they count, with a warning if there are many.

    Raises
    ------
    InputError
        The file is missing, damaged, of another kind, has no measured shift, or is an EXR of a part
        of the picture.

    Warns
    -----
    IriftraceWarning
        More than 2 % of the shifts are exactly (0, 0), unless `without_zeros` is given.
    """
    file = Path(path)
    kind = file.suffix.lower()
    check_ending(file, (".exr", ".npy", ".csv", ".txt"), "a file of measured shifts")
    check_exists(file)
    resolution, failed, rendered = None, 0, False
    if kind in (".exr", ".npy"):
        field, rendered = _exr_map(file) if kind == ".exr" else (_npy_map(file), False)
        height, width = field.shape[:2]
        resolution = (width, height)
        row, column = np.nonzero(np.isfinite(field).all(axis=2))
        places = np.stack((column, row), axis=1).astype(np.float64)
        shifts = field[row, column]
    else:
        places, shifts, failed = _markers(file)
    if len(shifts) == 0:
        marked = f", and {failed:,} rows are marked as not found" if failed else ""
        raise InputError(
            f"{file} has no measured shift: none of its values is finite{marked}.",
            code="shift.not_measured",
        )
    origin = FileOrigin(str(file), sha256_of(file))
    read = MeasuredShift(places, shifts, resolution, origin, failed)
    if without_zeros:
        return _without_zeros(read)
    # A rendering has exact zeros where there is no hot air.
    found = read if rendered else _with_doubt(read)
    if found.doubt and without_zeros is None:
        warn(
            f"{found.doubt}; leave them out with without_zeros=True, or keep them with False.",
            argument="without_zeros",
        )
    return found


def _without_zeros(read: MeasuredShift) -> MeasuredShift:
    measured = (read.shifts != 0.0).any(axis=1)
    if not measured.any():
        raise InputError(
            f"All {len(measured):,} shifts of {read.origin.path} are exactly 0, so none is left; "
            "correlate the pictures again.",
            code="shift.not_measured",
        )
    zeros = int((~measured).sum())
    return evolve(read, places=read.places[measured], shifts=read.shifts[measured], zeros=zeros)


def _with_doubt(read: MeasuredShift) -> MeasuredShift:
    zeros = (read.shifts == 0.0).all(axis=1)
    if zeros.mean() <= MOST_ZEROS:
        return read
    doubt = (
        f"{zeros.sum():,} of {len(zeros):,} shifts of {read.origin.path} are exactly 0 in both "
        "components, as many programs write where they found nothing"
    )
    return evolve(read, doubt=doubt)


def _exr_map(file: Path) -> tuple[FloatArray, bool]:
    """(h, w, 2) array, NaN where an AOV image has no shift, and whether it is such an image."""
    channels = exr_content(str(file), "write the map again")[1]
    rendered = set(_SHIFT) <= set(channels)
    names = _SHIFT if rendered else _pair(sorted(channels), file)
    field = np.stack([channels[name] for name in names], axis=2).astype(np.float64)
    if "status.code" in channels:
        field[np.rint(channels["status.code"]) != 0] = np.nan
    return field, rendered


def _pair(names: list[str], file: Path) -> tuple[str, str]:
    short = {name.rpartition(".")[2].lower(): name for name in names}
    for across, down in PAIRS:
        if len(names) == 2 and set(short) == {across, down}:
            return short[across], short[down]
    known = ", ".join(f"{a} and {b}" for a, b in PAIRS)
    raise not_read(file, f"the channels {', '.join(names)}", f"name the two of a map {known}")


def _npy_map(file: Path) -> FloatArray:
    try:
        numbers = np.asarray(array_in(file.read_bytes()), dtype=np.float64)
    except (OSError, ValueError, TypeError) as error:
        raise damaged(file, error, "give a NumPy array of numbers") from error
    if numbers.ndim == 3 and numbers.shape[2] == 2:
        return numbers
    if numbers.ndim == 3 and numbers.shape[0] == 2:
        return np.moveaxis(numbers, 0, 2)
    remedy = "give a map (height, width, 2) or (2, height, width): across and down"
    raise not_read(file, f"an array of the shape {numbers.shape}", remedy)


def _markers(file: Path) -> tuple[FloatArray, FloatArray, int]:
    """Places and shifts of the rows that were found, and the number of those that were not."""
    table = read_table(file)
    names = [column.name.casefold() for column in table.columns]
    if any(names.count(name) != 1 for name in COLUMNS):
        remedy = "name u, v, du, dv: position and shift, px, (0, 0) the first pixel's centre"
        raise not_read(file, f"the columns {listed(table.names)}", remedy)
    failed = np.zeros(len(table.cells), dtype=bool)
    for name in (name for name in MARKS if name in names):
        failed |= MARKS[name](table.numbers([names.index(name)])[:, 0])
    found = table.where(~failed).numbers([names.index(name) for name in COLUMNS])
    found = found[np.isfinite(found).all(axis=1)]
    return found[:, :2], found[:, 2:], int(failed.sum())
