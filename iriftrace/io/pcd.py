"""Clouds in PCD files of the Point Cloud Library, ASCII, binary and compressed.

The format: https://pointclouds.org/documentation/tutorials/pcd_file_format.html. Compressed data
are in the format of LibLZF (Marc Lehmann).
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import AnyArray, FloatArray
from iriftrace.core.errors import warn
from iriftrace.core.units import length_unit_of
from iriftrace.io.refusals import damaged

_IDENTITY = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
_KINDS = {"F": (4, 8), "I": (1, 2, 4, 8), "U": (1, 2, 4, 8)}
_COLOURS = {"rgb": ("red", "green", "blue"), "rgba": ("red", "green", "blue", "alpha")}
_SHIFT = {"red": 16, "green": 8, "blue": 0, "alpha": 24}


@frozen(eq=False)
class PcdCloud:
    """A cloud as its PCD file has it, row by row; what was not measured is NaN."""

    points: FloatArray  # (n, 3), in the file's unit
    columns: dict[str, AnyArray]  # (n,) or (n, count) by name, x, y and z among them
    length_unit: str  # that a comment states, or ""
    remarks: tuple[str, ...]  # size of the grid of an organised cloud, as lines of a .ply


def read_pcd(path: Path) -> PcdCloud:
    """Read the points of a PCD file and its further columns.

    Packed colours (``rgb``, ``rgba``) become ``red``, ``green``, ``blue`` and ``alpha``. Warned of
    is a VIEWPOINT other than the identity, which is not applied. Raises InputError for a file that
    is damaged or has no x, y and z.
    """
    try:
        return _read(path)
    except (ValueError, KeyError, IndexError) as error:
        raise damaged(path, error) from error


def _read(path: Path) -> PcdCloud:
    content = path.read_bytes()
    last = re.search(rb"^DATA[ \t]+(\w+)[ \t\r]*\n", content, re.MULTILINE)
    if last is None:
        raise ValueError("its header has no line DATA")
    lines = content[: last.start()].decode("ascii", errors="replace").splitlines()
    words = [line.split() for line in lines if line.strip() and not line.startswith("#")]
    header = {key.upper(): values for key, *values in words}
    names = header.get("FIELDS") or header.get("COLUMNS") or []
    if not {"x", "y", "z"} <= set(names):
        raise ValueError(f"its fields ({' '.join(names)}) have no x, y and z")
    width, height = (int(header.get(key, ["1"])[0]) for key in ("WIDTH", "HEIGHT"))
    kind = _row(names, header)
    table = _table(content[last.end() :], last[1].decode(), kind, width * height)
    # A name such as "_" is padding.
    columns = {name: table[str(i)] for i, name in enumerate(names) if name != "_"}
    for name in columns.keys() & _COLOURS.keys():
        if columns[name].dtype.itemsize == 4 and columns[name].ndim == 1:
            packed = columns.pop(name).view("<u4")
            for part in _COLOURS[name]:
                columns[part] = (packed >> _SHIFT[part]).astype(np.uint8)
    viewpoint = tuple(map(float, header.get("VIEWPOINT", _IDENTITY)))
    if viewpoint != _IDENTITY:
        warn(
            f"{path.name} states a VIEWPOINT ({' '.join(header['VIEWPOINT'])}), which is not "
            "applied; if its points are in the sensor's frame, give the motion to the part's.",
            argument="cloud_to_part",
        )
    return PcdCloud(
        np.column_stack([columns[axis] for axis in "xyz"]).astype(np.float64),
        columns,
        length_unit_of(lines, path.name),
        (f"obj_info num_cols {width}", f"obj_info num_rows {height}") if height > 1 else (),
    )


def _row(names: list[str], header: dict[str, list[str]]) -> np.dtype[np.void]:
    """A row of the table; its columns are named by their numbers, since padding repeats."""
    counts = header.get("COUNT", ["1"] * len(names))
    columns = []
    for i, column in enumerate(zip(names, header["TYPE"], header["SIZE"], counts, strict=True)):
        name, letter, size, count = column
        if int(size) not in _KINDS.get(letter, ()) or int(count) < 1:
            raise ValueError(f"its field {name} has type {letter}, size {size} and count {count}")
        columns.append((str(i), f"<{letter.lower()}{size}", (int(count),)[: int(count) > 1]))
    return np.dtype(columns)


def _table(data: bytes, form: str, kind: np.dtype[np.void], count: int) -> AnyArray:
    """The rows, (count,) structured, of the bytes behind the header."""
    if form == "ascii":
        rows = data.decode("ascii", errors="replace").splitlines()
        rows = [row for row in rows if row.strip()]
        if len(rows) != count:
            raise ValueError(f"it states {count:,} points and has {len(rows):,}")
        return np.atleast_1d(np.loadtxt(rows, dtype=kind)) if rows else np.empty(0, dtype=kind)
    columnwise = form == "binary_compressed"
    if columnwise:
        compressed, size = np.frombuffer(data, "<u4", 2).tolist()
        data = _decompressed(data[8 : 8 + compressed])
        if len(data) != size:
            raise ValueError(f"it states {size:,} bytes and has {len(data):,}")
    elif form != "binary":
        raise ValueError(f"its data are {form!r}")
    # Some writers end the file with a line break.
    if count < 0 or len(data) // kind.itemsize != count:
        raise ValueError(
            f"it states {count:,} points of {kind.itemsize} bytes and is shorter or longer"
        )
    if not columnwise:
        return np.frombuffer(data, kind, count)
    table, start = np.empty(count, dtype=kind), 0
    for name in kind.names or ():
        column = table[name]
        column[:] = np.frombuffer(data, column.dtype, column.size, start).reshape(column.shape)
        start += column.nbytes
    return table


def _decompressed(data: bytes) -> bytes:
    """Bytes that LibLZF compressed: literal runs, and copies of what was there before."""
    out, at = bytearray(), 0
    while at < len(data):
        control = data[at]
        if control < 32:
            out += data[at + 1 : at + control + 2]
            at += control + 2
            continue
        length = (control >> 5) + 2
        if length == 9:
            at += 1
            length += data[at]
        distance = ((control & 31) << 8) + data[at + 1] + 1
        at += 2
        start = len(out) - distance
        if start < 0:
            raise ValueError("its compressed data refer to what is before them")
        # A copy may overlap what it writes, and then repeats.
        run = out[start : start + length]
        out += run if length <= distance else (run * (length // distance + 1))[:length]
    return bytes(out)
