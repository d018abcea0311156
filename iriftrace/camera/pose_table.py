"""Tables of poses as text: their columns by name, or rows of matrices without names."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from iriftrace.camera.pose_set import aimed
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.number_table import is_numbers
from iriftrace.core.units import LENGTH_UNITS, stated_length_unit

ANGLES = ("azimuth_deg", "elevation_deg")
MATRIX = tuple(f"m{row}{column}" for row in range(4) for column in range(4))

_ORIGIN = ("x", "y", "z")
_QUATERNION = ("qx", "qy", "qz", "qw")
_TARGET = ("target_x", "target_y", "target_z")
_FIELD = re.compile(
    r"(?:(?P<axis>(?:target_)?[xyz])|(?:t|(?:.*\.)?(?:position|translation|pos)[._ ])(?P<at>[xyz])"
    r"|(?:q[._ ]?|(?:.*\.)?(?:orientation|quaternion)[._ ])(?P<part>[wxyz]))"
    rf"(?:(?:[ _/]+|(?=[\[(]))[\[(]?\s*(?P<unit>{'|'.join(LENGTH_UNITS)})\s*[\])]?)?"
)
"""Names of origins and quaternions: "x", "tx", "pose.position.x", "x [m]"; "qw", "q_w"."""
_NAMES = "m00 ... m33, or x, y, z with qx, qy, qz, qw, or x, y, z with target_x, target_y, target_z"


@frozen
class _Table:
    """Cells of a table (rows, columns), with the numbers of their lines for messages."""

    path: Path
    lines: list[int]
    cells: NDArray[np.object_]

    def numbers(self, columns: Sequence[int]) -> FloatArray:
        """(rows, columns) array."""
        for line, row in zip(self.lines, self.cells[:, columns], strict=True):
            for cell in row:
                if not _is_number(cell):
                    raise InputError(
                        f"{self.path}, line {line}: {cell!r} is not a number; correct it."
                    )
        return self.cells[:, columns].astype(np.float64)


def columns_of_table(text: str, path: Path) -> dict[str, object]:
    """Columns of a text table of poses by name, as `iriftrace.camera.pose_files.read_poses` reads.

    ``matrices`` are (n, 4, 4); ``aimed`` is true for poses that came from targets, which are in
    iriftrace's own convention.
    """
    split = [line.partition("#") for line in text.splitlines()]
    bare = [line.translate(_BRACKETS) if is_numbers(line) else line for line, _, _ in split]
    numbered = [(k, line.strip()) for k, line in enumerate(bare, 1) if line.strip()]
    if not numbered:
        raise InputError(f"{path} holds no pose; give at least one.")
    remarks = [remark.strip() for _, _, remark in split[: numbered[0][0]]]
    delimiter = next((d for d in ";," if any(d in line for _, line in numbered)), "")
    if delimiter == "," and all(re.search(r"[^,]\t", line) for _, line in numbered):
        # Commas between tabs are decimal signs.
        numbered = [(k, line.replace(",", ".")) for k, line in numbered]
        delimiter = ""
    try:
        rows = [
            next(csv.reader([line], delimiter=delimiter)) if delimiter else line.split()
            for _, line in numbered
        ]
    except csv.Error as error:
        raise InputError(f"{path} is not a table of poses ({error}); write it again.") from error
    for (line, _), row in zip(numbered, rows, strict=True):
        if len(row) != len(rows[0]):
            raise InputError(
                f"{path}, line {line} has {len(row)} columns, but the first row has "
                f"{len(rows[0])}; give all rows the same."
            )
    comma = "." if delimiter == ";" else ","
    cells = np.array([[cell.strip().replace(",", comma) for cell in row] for row in rows], object)
    lines = [line for line, _ in numbered]
    unit = next(filter(None, map(stated_length_unit, remarks)), "")
    stated: dict[str, object] = {"length_unit": unit} if unit else {}
    if any(map(_is_number, cells[0])):
        table = _Table(path, lines, cells)
        names = _header_in(remarks, len(cells[0]))
        return stated | (_named(table, names) if names else {"matrices": _unnamed(table)})
    if len(cells) == 1:
        raise InputError(f"{path} has a header but no pose below it; add one.")
    return stated | _named(_Table(path, lines[1:], cells[1:]), [name.lower() for name in cells[0]])


_BRACKETS = str.maketrans("", "", "[]")


def _header_in(remarks: Sequence[str], count: int) -> list[str]:
    """Names of columns in the last remark that has as many words and x, y and z among them."""
    for remark in reversed(remarks):
        words = re.split(r"[\s,;]+", remark.lower())
        if len(words) == count and set(_ORIGIN) <= {_known(word)[0] for word in words}:
            return words
    return []


def _known(name: str) -> tuple[str, str]:
    """A column's name as it is known here, and the length unit that it states, or ""."""
    found = _FIELD.fullmatch(name.strip())
    if found is None:
        return name, ""
    known = found["axis"] or found["at"] or f"q{found['part']}"
    return known, LENGTH_UNITS.get(found["unit"] or "", "")


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _unnamed(table: _Table) -> FloatArray:
    count, width = table.cells.shape
    if width == 16 or (width == 4 and count % 4 == 0):
        return table.numbers(range(width)).reshape(-1, 4, 4)
    if width == 4:
        raise InputError(
            f"{table.path} has {count} rows of 4 numbers, but 4x4 matrices need four rows each; is "
            "one missing?"
        )
    # Six or seven numbers could be Euler angles or a quaternion in either order: never guess.
    raise InputError(
        f"{table.path} has {width} numbers a row and no header, which has no one meaning; give 16, "
        f"or name the columns in a first line: {_NAMES}."
    )


def _named(table: _Table, names: list[str]) -> dict[str, object]:
    header = ", ".join(names)
    names, units = map(list, zip(*map(_known, names), strict=True))
    twice = [name for name in (*MATRIX, *_ORIGIN, *_QUATERNION, *_TARGET) if names.count(name) > 1]
    if twice:
        raise InputError(f"{table.path} has the column {twice[0]} twice; remove one.")

    def columns(wanted: Sequence[str]) -> FloatArray:
        return table.numbers([names.index(name) for name in wanted])

    forms = [MATRIX, _ORIGIN + _QUATERNION, _ORIGIN + _TARGET]
    complete = [set(form) <= set(names) for form in forms]
    if sum(complete) != 1:
        fault = "describes poses twice" if any(complete) else "does not describe poses"
        raise InputError(
            f"The header of {table.path} ({header}) {fault}; name the columns {_NAMES}."
        )
    read: dict[str, object] = {"aimed": complete[2]}
    if complete[0]:
        read["matrices"] = columns(MATRIX).reshape(-1, 4, 4)
    elif complete[1]:
        read["matrices"] = _from_quaternions(columns(_ORIGIN), columns(_QUATERNION), table)
    else:
        origins, targets = columns(_ORIGIN), columns(_TARGET)
        try:
            read["matrices"] = aimed(origins, targets)
        except InputError as error:
            raise InputError(f"{table.path}: {error}") from error
    known = evolve(table, cells=np.where(table.cells == "", "nan", table.cells))
    for name in set(ANGLES) & set(names):
        read[name] = known.numbers([names.index(name)])[:, 0]
    for name in {"convention", "length_unit"} & set(names):
        stated = table.cells[:, names.index(name)]
        read[name] = ", ".join(sorted(set(stated.tolist())))
    if any(units):
        read["length_unit"] = ", ".join(sorted(filter(None, set(units))))
    return read


def _from_quaternions(origins: FloatArray, quaternions: FloatArray, table: _Table) -> FloatArray:
    from scipy.spatial.transform import Rotation

    lengths = np.linalg.norm(quaternions, axis=1)
    wrong = ~(np.abs(lengths - 1.0) < 1e-3)
    if wrong.any():
        number = int(np.argmax(wrong))
        raise InputError(
            f"{table.path}, line {table.lines[number]}: the quaternion has length "
            f"{lengths[number]:g} instead of 1, so it is not a rotation; correct it."
        )
    matrices = np.tile(np.eye(4), (len(origins), 1, 1))
    matrices[:, :3, :3] = Rotation.from_quat(quaternions).as_matrix()
    matrices[:, :3, 3] = origins
    return matrices
