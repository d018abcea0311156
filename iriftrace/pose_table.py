"""Text tables of camera poses: rows of numbers, with or without named columns."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.errors import InputError
from iriftrace.pose_set import aimed

FloatArray = NDArray[np.float64]

ANGLES = ("azimuth_deg", "elevation_deg")
MATRIX = tuple(f"m{row}{column}" for row in range(4) for column in range(4))

_ORIGIN = ("x", "y", "z")
_QUATERNION = ("qx", "qy", "qz", "qw")
_TARGET = ("target_x", "target_y", "target_z")
_NAMES = "m00 ... m33, or x, y, z with qx, qy, qz, qw, or x, y, z with target_x, target_y, target_z"


@frozen
class _Rows:
    """Cells of a table, with the numbers of their lines in the file for messages."""

    lines: tuple[int, ...]
    cells: tuple[tuple[str, ...], ...]
    path: Path
    decimal_comma: bool

    def number(self, row: int, column: int) -> float:
        cell = self.cells[row][column]
        value = _number(cell, self.decimal_comma)
        if value is None:
            raise InputError(
                f"{self.path}, line {self.lines[row]}: {cell!r} is not a number; correct it."
            )
        return value

    def numbers(self, first: int, columns: list[int]) -> FloatArray:
        """(rows, columns) array from row `first` on."""
        rows = range(first, len(self.cells))
        return np.array([[self.number(row, column) for column in columns] for row in rows])


def read_pose_table(text: str, path: Path) -> dict[str, Any]:
    """Read poses from a text table; `iriftrace.pose_files.read_poses` describes it.

    Parameters
    ----------
    text : str
    path : Path
        For messages.

    Returns
    -------
    dict
        ``matrices`` (n, 4, 4), in the file's convention and unit; where the columns exist,
        ``azimuth_deg`` and ``elevation_deg`` (n,), ``convention``; ``aimed`` is true when the poses
        came from targets and are in iriftrace's own convention.

    Raises
    ------
    InputError
    """
    rows = _rows(text, path)
    widths = {len(cells) for cells in rows.cells}
    if len(widths) > 1:
        odd = next(k for k, cells in enumerate(rows.cells) if len(cells) != len(rows.cells[0]))
        raise InputError(
            f"{path}, line {rows.lines[odd]} has {len(rows.cells[odd])} columns, but the first row "
            f"has {len(rows.cells[0])}; give all rows the same."
        )
    if any(_number(cell, rows.decimal_comma) is not None for cell in rows.cells[0]):
        return {"matrices": _unnamed(rows)}
    names = [cell.lower() for cell in rows.cells[0]]
    if len(rows.cells) == 1:
        raise InputError(f"{path} has a header but no pose below it; add one.")
    return _named(rows, names)


def _rows(text: str, path: Path) -> _Rows:
    numbered = [(k, line.split("#")[0].strip()) for k, line in enumerate(text.splitlines(), 1)]
    numbered = [(k, line) for k, line in numbered if line]
    if not numbered:
        raise InputError(f"{path} holds no pose; give at least one.")
    delimiter = next((d for d in ";," if any(d in line for _, line in numbered)), "")
    try:
        cells = [
            next(csv.reader([line], delimiter=delimiter)) if delimiter else line.split()
            for _, line in numbered
        ]
    except csv.Error as error:
        raise InputError(f"{path} is not a table of poses ({error}); write it again.") from error
    return _Rows(
        lines=tuple(k for k, _ in numbered),
        cells=tuple(tuple(cell.strip() for cell in row) for row in cells),
        path=path,
        decimal_comma=delimiter == ";",
    )


def _number(cell: str, decimal_comma: bool) -> float | None:
    try:
        return float(cell.replace(",", ".") if decimal_comma else cell)
    except ValueError:
        return None


def _unnamed(rows: _Rows) -> FloatArray:
    width = len(rows.cells[0])
    if width == 16 or (width == 4 and len(rows.cells) % 4 == 0):
        return rows.numbers(0, list(range(width))).reshape(-1, 4, 4)
    if width == 4:
        raise InputError(
            f"{rows.path} has {len(rows.cells)} rows of 4 numbers, but 4x4 matrices need four rows "
            "each; is one missing?"
        )
    # Six or seven numbers could be Euler angles or a quaternion in either order: never guess.
    raise InputError(
        f"{rows.path} has {width} numbers a row and no header, which has no one meaning; give 16, "
        f"or name the columns in a first line: {_NAMES}."
    )


def _named(rows: _Rows, names: list[str]) -> dict[str, Any]:
    twice = [name for name in (*MATRIX, *_ORIGIN, *_QUATERNION, *_TARGET) if names.count(name) > 1]
    if twice:
        raise InputError(f"{rows.path} has the column {twice[0]} twice; remove one.")

    def columns(wanted: tuple[str, ...]) -> FloatArray:
        return rows.numbers(1, [names.index(name) for name in wanted])

    forms = [MATRIX, _ORIGIN + _QUATERNION, _ORIGIN + _TARGET]
    complete = [set(form) <= set(names) for form in forms]
    if sum(complete) != 1:
        fault = "describes poses twice" if any(complete) else "does not describe poses"
        raise InputError(
            f"The header of {rows.path} ({', '.join(names)}) {fault}; name the columns {_NAMES}."
        )
    read: dict[str, Any] = {"aimed": False}
    if complete[0]:
        read["matrices"] = columns(MATRIX).reshape(-1, 4, 4)
    elif complete[1]:
        read["matrices"] = _from_quaternions(columns(_ORIGIN), columns(_QUATERNION), rows)
    else:
        read["matrices"] = _aimed(columns(_ORIGIN), columns(_TARGET), rows)
        read["aimed"] = True
    for name in (name for name in ANGLES if name in names):
        place = names.index(name)
        read[name] = [
            rows.number(row, place) if rows.cells[row][place] else np.nan
            for row in range(1, len(rows.cells))
        ]
    if "convention" in names:
        stated = {row[names.index("convention")] for row in rows.cells[1:]}
        read["convention"] = ", ".join(sorted(stated))
    return read


def _aimed(origins: FloatArray, targets: FloatArray, rows: _Rows) -> FloatArray:
    try:
        return aimed(origins, targets)
    except InputError as error:
        raise InputError(f"{rows.path}: {error}") from error


def _from_quaternions(origins: FloatArray, quaternions: FloatArray, rows: _Rows) -> FloatArray:
    from scipy.spatial.transform import Rotation

    lengths = np.linalg.norm(quaternions, axis=1)
    wrong = ~(np.abs(lengths - 1.0) < 1e-3)
    if wrong.any():
        number = int(np.argmax(wrong))
        raise InputError(
            f"{rows.path}, line {rows.lines[number + 1]}: the quaternion has length "
            f"{lengths[number]:g} instead of 1, so it is no rotation; correct it."
        )
    matrices = np.tile(np.eye(4), (len(origins), 1, 1))
    matrices[:, :3, :3] = Rotation.from_quat(quaternions).as_matrix()
    matrices[:, :3, 3] = origins
    return matrices
