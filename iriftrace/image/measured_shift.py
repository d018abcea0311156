"""Measured pixel shifts between a cold and a hot picture, read from a map or a list of markers.

A shift is the position of something in the hot picture minus its position in the cold one, in
pixels, u to the right and v down. Files count as OpenCV does: (0, 0) is the centre of the first
pixel. In the program pixel ``i`` covers ``[i, i + 1)``, as everywhere.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.files import array_in, sha256_of
from iriftrace.core.number_table import without_statistics
from iriftrace.image.exr_entries import exr_content

COLUMNS = ("u", "v", "du", "dv")
PAIRS = (("x", "y"), ("u", "v"), ("du", "dv"), ("dx", "dy"), ("r", "g"))
"""Names of the two channels of a map, in any case, also after a dot (``shift.px.X``)."""

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
    path : str
    sha256 : str
    """

    places: FloatArray
    shifts: FloatArray
    resolution: tuple[int, int] | None
    path: str
    sha256: str


def read_measured_shift(path: str | Path) -> MeasuredShift:
    """Read measured shifts.

    Parameters
    ----------
    path : path
        ``.exr`` with two channels (see `PAIRS`) or the channels ``shift.px.X`` and ``shift.px.Y``;
        ``.npy`` with an array (height, width, 2) or (2, height, width); in both, pixels that are
        not finite were not measured. Or ``.csv`` with the columns u, v, du, dv (others are
        ignored); rows without du or dv were not measured.

    Raises
    ------
    InputError
        The file is missing, damaged, of another kind, or has no measured shift.
    """
    file = Path(path)
    readers = {".exr": _exr_map, ".npy": _npy_map}
    kind = file.suffix.lower()
    if kind not in (*readers, ".csv", ".txt"):
        raise InputError(
            f"{file} is not a file of measured shifts; give a two-channel map (.exr, .npy) or "
            "markers with the columns u, v, du, dv (.csv)."
        )
    if not file.is_file():
        raise InputError(f"there is no file {file}; give the measured shift.")
    resolution = None
    if kind in readers:
        field = readers[kind](file)
        height, width = field.shape[:2]
        resolution = (width, height)
        row, column = np.nonzero(np.isfinite(field).all(axis=2))
        places = np.stack((column, row), axis=1).astype(np.float64)
        shifts = field[row, column]
    else:
        places, shifts = _markers(file)
    if len(shifts) == 0:
        raise InputError(f"{file} has no measured shift: none of its values is finite.")
    return MeasuredShift(places, shifts, resolution, str(file), sha256_of(file))


def _exr_map(file: Path) -> FloatArray:
    """(h, w, 2) array; NaN where an AOV image has no shift."""
    channels = exr_content(str(file), "write the map again")[1]
    names = _SHIFT if set(_SHIFT) <= set(channels) else _pair(sorted(channels), file)
    field = np.stack([channels[name] for name in names], axis=2).astype(np.float64)
    if "status.code" in channels:
        field[np.rint(channels["status.code"]) != 0] = np.nan
    return field


def _pair(names: list[str], file: Path) -> tuple[str, str]:
    short = {name.rpartition(".")[2].lower(): name for name in names}
    for across, down in PAIRS:
        if len(names) == 2 and set(short) == {across, down}:
            return short[across], short[down]
    raise InputError(
        f"{file} has the channels {', '.join(names)}, but a map of shifts has two, across and "
        "down, named " + ", ".join(f"{a} and {b}" for a, b in PAIRS) + "; rename them."
    )


def _npy_map(file: Path) -> FloatArray:
    try:
        numbers = np.asarray(array_in(file.read_bytes()), dtype=np.float64)
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"{file} is not a NumPy array of numbers ({error}).") from error
    if numbers.ndim == 3 and numbers.shape[2] == 2:
        return numbers
    if numbers.ndim == 3 and numbers.shape[0] == 2:
        return np.moveaxis(numbers, 0, 2)
    raise InputError(
        f"{file} has the shape {numbers.shape}, but a map of shifts is (height, width, 2) or "
        "(2, height, width): across and down."
    )


def _markers(file: Path) -> tuple[FloatArray, FloatArray]:
    try:
        text = file.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{file} is not text in UTF-8 ({error.reason}).") from error
    table = enumerate(without_statistics(text.splitlines(), file), 1)
    lines = [(k, line) for k, line in table if line.split("#")[0].strip()]
    delimiter = next((d for d in ";,\t" if lines and d in lines[0][1]), None)
    rows = [
        (k, [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))])
        if delimiter
        else (k, line.split())
        for k, line in lines
    ]
    names = [name.lower() for name in rows[0][1]] if rows else []
    if not set(COLUMNS) <= set(names):
        has = f"has the columns {', '.join(names)}" if names else "is empty"
        raise InputError(
            f"{file} {has}, but the first line of a list of "
            "markers names u, v, du, dv: position and shift, px, (0, 0) the first pixel's centre."
        )
    selected = [names.index(name) for name in COLUMNS]
    values = []
    for k, cells in rows[1:]:
        if len(cells) != len(names):
            raise InputError(
                f"{file}, line {k} has {len(cells)} columns, but the first one has {len(names)}."
            )
        chosen = [cells[column] for column in selected]
        if delimiter == ";":
            chosen = [cell.replace(",", ".") for cell in chosen]
        try:
            values.append([float(cell) if cell else np.nan for cell in chosen])
        except ValueError:
            raise InputError(
                f"{file}, line {k}: {', '.join(chosen)} are not four numbers; correct them."
            ) from None
    found = np.array(values, dtype=np.float64).reshape(-1, 4)
    found = found[np.isfinite(found).all(axis=1)]
    return found[:, :2], found[:, 2:]
