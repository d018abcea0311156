"""Tables of poses (.csv): columns by their names."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from attrs import frozen

from iriftrace.camera.pose_set import aimed
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.io.refusals import damaged, not_read, one_unit
from iriftrace.io.robot_poses import QUATERNION, ROBOTS, RobotName

ANGLES = ("azimuth_deg", "elevation_deg")
MATRIX = tuple(f"m{row}{column}" for row in range(4) for column in range(4))
ORIGIN = ("x", "y", "z")

_TARGET = ("target_x", "target_y", "target_z")
_OWN = "m00 to m33, or x, y, z with qx, qy, qz, qw or with target_x, target_y, target_z"
_WITH_UNIT = re.compile(r"(?P<name>\w+)\s*\[\s*(?P<unit>[^\]\s]+)\s*\]")


@frozen
class StatedPoses:
    """What a file states of its poses.

    Matrices are (n, 4, 4) arrays, angles (n,), degree, or None. The convention and the unit of
    length are "" where it states none. `is_aimed` poses are those of cameras that look at targets,
    so that the axes of no convention are in the file.
    """

    matrices: FloatArray
    azimuth_deg: FloatArray | None = None
    elevation_deg: FloatArray | None = None
    convention: str = ""
    length_unit: str = ""
    is_aimed: bool = False


@frozen
class _Table:
    """Cells of a table by the names of its columns, with the numbers of the rows' lines."""

    path: Path
    lines: list[int]
    cells: dict[str, list[str]]

    def numbers(self, names: Sequence[str]) -> FloatArray:
        """(rows, columns) array of some columns."""
        return np.stack([self._numbers(self.cells[name]) for name in names], axis=1)

    def angles(self, name: str) -> FloatArray | None:
        """(rows,) array of a column that may be missing, or have empty cells, which are NaN."""
        if name not in self.cells:
            return None
        return self._numbers([cell or "nan" for cell in self.cells[name]])

    def _numbers(self, cells: Sequence[str]) -> FloatArray:
        values = np.empty(len(cells))
        for row, cell in enumerate(cells):
            try:
                values[row] = float(cell)
            except ValueError:
                found = f"line {self.lines[row]}: {cell!r} is not a number"
                raise damaged(self.path, found, "correct it") from None
        return values


def read_table(text: str, path: Path, robot: RobotName | None) -> StatedPoses:
    """Poses of a table whose first line names its columns, in the file's convention and unit.

    With a `robot`, the orientations are in its columns. Raises InputError for other columns than
    those of one form (see `iriftrace.io.poses.read_poses`).
    """
    table, names, units = _parsed(text, path)
    orientation = QUATERNION if robot is None else ROBOTS[robot]
    turned, looking = ORIGIN + orientation.columns, ORIGIN + _TARGET
    forms = (MATRIX, turned, looking) if robot is None else (turned,)
    named = sorted(name for name in names if name not in (*ANGLES, "convention"))
    form = next((form for form in forms if named == sorted(form)), None)
    if form is None or not set(units) <= {*ORIGIN, *_TARGET, *orientation.angles}:
        known = _OWN if robot is None else f"{', '.join(turned)} (of the robot {robot})"
        raise not_read(
            path,
            f"the columns {text.splitlines()[0][:200]!r}",
            f"name {known}, and besides only azimuth_deg, elevation_deg and convention, and state "
            "the robot if they are a robot's",
            argument="robot",
        )
    lengths = sorted({unit for name, unit in units.items() if name in looking})
    angle = one_unit(path, (unit for name, unit in units.items() if name in orientation.angles))
    if angle not in ("", "deg", "rad"):
        raise not_read(path, f"angles in {angle}", "write all in deg or all in rad")
    azimuth, elevation = map(table.angles, ANGLES)
    if form == MATRIX:
        matrices = table.numbers(MATRIX).reshape(-1, 4, 4)
    else:
        origins = table.numbers(ORIGIN)
        values = table.numbers(_TARGET if form == looking else orientation.columns)
        if form == turned and not orientation.angles:
            _check_quaternions(values, table)
        try:
            if form == looking:
                matrices = aimed(origins, values)
            else:
                matrices = np.tile(np.eye(4), (len(values), 1, 1))
                matrices[:, :3, :3] = orientation.matrices(values, angle)
                matrices[:, :3, 3] = origins
        except InputError as error:
            raise InputError(
                f"{path}: {error}", code=error.code, argument=error.argument
            ) from error
    return StatedPoses(
        matrices,
        azimuth,
        elevation,
        convention=", ".join(sorted(set(table.cells.get("convention", ())))),
        length_unit=", ".join(lengths),
        is_aimed=form == looking,
    )


def _parsed(text: str, path: Path) -> tuple[_Table, list[str], dict[str, str]]:
    """The table, its names in small letters, and the units that follow some of them."""
    first, _, below = text.partition("\n")
    mark = ";" if ";" in first else ","
    if mark == ";" and "." not in below:
        below = below.replace(",", ".")
    try:
        header, *rows = csv.reader([first, *below.splitlines()], delimiter=mark)
    except csv.Error as error:
        raise damaged(path, error, "write it again") from error
    numbered = [(k, row) for k, row in enumerate(rows, 2) if any(map(str.strip, row))]
    if not numbered:
        raise damaged(path, "it has no pose below the line with the names", "add one")
    for line, row in numbered:
        if len(row) != len(header):
            fault = f"line {line} has {len(row)} columns, but the first one names {len(header)}"
            raise damaged(path, fault, "give all rows the same")
    names, units = [], {}
    for title in map(str.strip, header):
        found = _WITH_UNIT.fullmatch(title)
        names.append((found["name"] if found else title).lower())
        if found:
            units[names[-1]] = found["unit"]
    columns = zip(*(map(str.strip, row) for _, row in numbered), strict=True)
    lines = [line for line, _ in numbered]
    return _Table(path, lines, dict(zip(names, map(list, columns), strict=True))), names, units


def _check_quaternions(quaternions: FloatArray, table: _Table) -> None:
    lengths = np.linalg.norm(quaternions, axis=1)
    wrong = ~(np.abs(lengths - 1.0) < 1e-3)
    if wrong.any():
        number = int(np.argmax(wrong))
        raise InputError(
            f"{table.path}, line {table.lines[number]}: the quaternion has length "
            f"{lengths[number]:g} instead of 1, so it is not a rotation; correct it.",
            code="poses.quaternion",
        )
