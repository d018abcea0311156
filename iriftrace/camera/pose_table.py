"""Tables of poses as text: their columns by name, or rows of matrices without names."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from iriftrace.camera.calibration_file import is_length_unit
from iriftrace.camera.pose_set import aimed
from iriftrace.camera.robot_poses import ROBOTS, RobotName, robots_of
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
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
_ANGLE = re.compile(
    r"(?P<name>[abcoprtw]|r[xyz]|q[1-4])"
    r"(?:(?:[ _]+|(?=[\[(]))[\[(]?\s*(?P<unit>deg|°|rad)\w*\s*[\])]?)?"
)
"""Names of a robot's angles: "a", "rx", "w [deg]", "rx_rad"."""
_CONVENTION = re.compile(r"\bconvention\W+(\w+)$", re.IGNORECASE)
FRAME = re.compile(
    r"unit|convention|ax[ei]s|coord|frame|system|direction|scale|offset|origin|handed|y[ -]up"
    r"|major|transpos|invers|extrinsic|relative|\bin (?:m|cm|met|centimet|inch)",
    re.IGNORECASE,
)
"""In remarks of what poses depend on."""
_DECIMAL_SIGNS = re.compile(r"(?:^|[;\t]) *[-+]?\d+([.,])\d+(?:[eE][-+]?\d+)? *(?=[;\t]|$)")
_ROLL = re.compile(r"(?:roll|twist|up)(?![a-z])")
_NAMES = (
    "m00 ... m33, or x, y, z with qx, qy, qz, qw, with target_x, target_y, target_z, or with the "
    "angles of a robot (such as a, b, c, of a KUKA)"
)


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


def columns_of_table(text: str, path: Path, robot: RobotName | None = None) -> dict[str, object]:
    """Columns of a text table of poses by name, as `iriftrace.camera.pose_files.read_poses` reads.

    ``matrices`` are (n, 4, 4); ``aimed`` is true for poses that came from targets, which are in
    iriftrace's own convention. With a `robot`, the orientations are in its columns; a table
    without names that has as many columns is x, y, z and these.
    """
    if _COLMAP.search(text):
        raise InputError(
            f"{path} is COLMAP's list of images, whose poses are from the world to the camera and "
            "have no scale; write matrices from the camera to the world, in mm."
        )
    # Excel reads "sep=;" in a first line.
    split = [line.partition("#") for line in re.sub(r"\Asep=.*", "", text).splitlines()]
    bare = [_without_brackets(line) if _is_numbers(line) else line for line, _, _ in split]
    numbered = [(k, line.strip()) for k, line in enumerate(bare, 1) if line.strip()]
    if not numbered:
        raise InputError(f"{path} holds no pose; give at least one.")
    if len({sign for _, line in numbered for sign in _DECIMAL_SIGNS.findall(line)}) > 1:
        raise InputError(
            f"{path} has decimal commas and points, of which one may stand between thousands; "
            "write all numbers with points."
        )
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
    read = [(stated_length_unit(remark), _CONVENTION.findall(remark)) for remark in remarks]
    unread = (remark for remark, found in zip(remarks, read, strict=True) if not any(found))
    stated: dict[str, object] = {"unread": ", ".join(filter(FRAME.search, unread))}
    stated.update(("length_unit", unit) for unit, _ in read if unit)
    stated.update(("convention", names[0]) for _, names in read if names)
    if any(map(_is_number, cells[0])):
        table = _Table(path, lines, cells)
        names = _header_in(remarks, len(cells[0]))
        if robot and not names and len(cells[0]) == 3 + len(ROBOTS[robot].columns):
            names = [*_ORIGIN, *ROBOTS[robot].columns]
        named = _named(table, names, robot) if names or robot else {"matrices": _unnamed(table)}
        return stated | named
    if len(cells) == 1:
        raise InputError(f"{path} has a header but no pose below it; add one.")
    names = [name.lower() for name in cells[0]]
    return stated | _named(_Table(path, lines[1:], cells[1:]), names, robot)


_COLMAP = re.compile(r"^#.*IMAGE_ID,\s*QW,\s*QX", re.MULTILINE)
_BRACKETS = str.maketrans("", "", "[]")


def _is_numbers(line: str) -> bool:
    """True for a line that can be numbers: no letters besides exponents, NaN and Inf."""
    bare = re.sub(r"\b(?:nan|inf(?:inity)?)\b", "", line, flags=re.IGNORECASE)
    return re.search(r"[A-DF-Za-df-z_]|(?![A-Za-z])[^\W\d_]", bare) is None


def _without_brackets(line: str) -> str:
    """A row of numbers without the brackets of nested lists and the comma after them."""
    bare = line.translate(_BRACKETS)
    return bare if bare == line else bare.rstrip(", ")


def _header_in(remarks: Sequence[str], count: int) -> list[str]:
    """Names of columns in the last remark that has as many words and x, y and z among them."""
    for remark in reversed(remarks):
        words = re.split(r"[\s,;]+", remark.lower())
        if len(words) == count and set(_ORIGIN) <= {_known(word)[0] for word in words}:
            return words
    return []


def _known(name: str) -> tuple[str, str]:
    """A column's name as it is known here, and the unit that it states, or ""."""
    angle = _ANGLE.fullmatch(name.strip())
    if angle:
        return angle["name"], (angle["unit"] or "").replace("°", "deg")
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
    if width == 12:
        return table.numbers(range(width))
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


def _named(table: _Table, names: list[str], robot: RobotName | None) -> dict[str, object]:
    header = ", ".join(names)
    known_names = [_known(name) for name in names]
    names = [name for name, _ in known_names]
    twice = [name for name in (*MATRIX, *_ORIGIN, *_QUATERNION, *_TARGET) if names.count(name) > 1]
    if twice:
        raise InputError(f"{table.path} has the column {twice[0]} twice; remove one.")

    def columns(wanted: Sequence[str]) -> FloatArray:
        return table.numbers([names.index(name) for name in wanted])

    forms = [MATRIX, _ORIGIN + _QUATERNION, _ORIGIN + _TARGET]
    complete = [set(form) <= set(names) for form in forms]
    if robot is None and not any(complete):
        robot = _only_robot(names, table.path)
    if robot is None and sum(complete) != 1:
        fault = "describes poses twice" if any(complete) else "does not describe poses"
        raise InputError(
            f"The header of {table.path} ({header}) {fault}; name the columns {_NAMES}."
        )
    read: dict[str, object] = {"aimed": robot is None and complete[2]}
    if robot is not None:
        orientation = ROBOTS[robot].columns
        if not set(_ORIGIN + orientation) <= set(names):
            raise unlike_robot(table.path, robot)
        read["matrices"] = _from_robot(
            columns(_ORIGIN), columns(orientation), robot, _units(known_names, orientation), table
        )
    elif complete[0]:
        read["matrices"] = columns(MATRIX).reshape(-1, 4, 4)
    elif complete[1]:
        read["matrices"] = _from_quaternions(columns(_ORIGIN), columns(_QUATERNION), table)
    else:
        if turned := [name for name in names if _ROLL.match(name)]:
            raise InputError(
                f"{table.path} aims cameras at targets, which states no roll, but has the columns "
                f"{', '.join(turned)}; write matrices or quaternions instead."
            )
        origins, targets = columns(_ORIGIN), columns(_TARGET)
        try:
            read["matrices"] = aimed(origins, targets)
        except InputError as error:
            raise InputError(f"{table.path}: {error}") from error
    known = evolve(table, cells=np.where(table.cells == "", "nan", table.cells))
    for name in set(ANGLES) & set(names):
        read[name] = known.numbers([names.index(name)])[:, 0]
    for number, name in enumerate(names):
        if name == "convention" or is_length_unit(name):
            stated = set(map(str.casefold, table.cells[:, number]))
            key = "convention" if name == "convention" else "length_unit"
            read[key] = ", ".join(sorted(stated))
    if units := _units(known_names, _ORIGIN + _TARGET):
        read["length_unit"] = ", ".join(units)
    return read


def _units(known_names: Sequence[tuple[str, str]], columns: Sequence[str]) -> list[str]:
    """Units that the names of some columns state."""
    return sorted({unit for name, unit in known_names if unit and name in columns})


def _only_robot(names: Sequence[str], path: Path) -> RobotName | None:
    """The robot whose columns these are; None for none, an InputError if they may be others'."""
    robots = robots_of(names) if set(_ORIGIN) <= set(names) else []
    if not robots or (len(robots) == 1 and ROBOTS[robots[0]].alone):
        return next(iter(robots), None)
    columns = dict.fromkeys(", ".join(ROBOTS[robot].columns) for robot in robots)
    raise InputError(
        f"{path} has orientations {' and '.join(columns)}, whose meaning differs between programs; "
        f"say whose they are (--robot {' or '.join(robots)})."
    )


def unlike_robot(path: Path, robot: RobotName) -> InputError:
    """The error of a file without the columns of a robot."""
    return InputError(
        f"{path} has no columns {', '.join(_ORIGIN + ROBOTS[robot].columns)}, in which poses of "
        f"the robot ({robot}) are stated; name them in a first line, or leave out --robot."
    )


def _from_robot(
    origins: FloatArray, values: FloatArray, robot: RobotName, units: list[str], table: _Table
) -> FloatArray:
    if ROBOTS[robot].rotation == "quaternion":
        _check_quaternions(values, table)
    if len(units) > 1:
        raise InputError(f"{table.path} has angles in {' and '.join(units)}; write all in one.")
    try:
        return _posed(ROBOTS[robot].matrices(values, "".join(units)), origins)
    except InputError as error:
        raise InputError(f"{table.path}: {error}") from error


def _from_quaternions(origins: FloatArray, quaternions: FloatArray, table: _Table) -> FloatArray:
    from scipy.spatial.transform import Rotation

    _check_quaternions(quaternions, table)
    return _posed(Rotation.from_quat(quaternions).as_matrix(), origins)


def _check_quaternions(quaternions: FloatArray, table: _Table) -> None:
    lengths = np.linalg.norm(quaternions, axis=1)
    wrong = ~(np.abs(lengths - 1.0) < 1e-3)
    if wrong.any():
        number = int(np.argmax(wrong))
        raise InputError(
            f"{table.path}, line {table.lines[number]}: the quaternion has length "
            f"{lengths[number]:g} instead of 1, so it is not a rotation; correct it."
        )


def _posed(rotations: FloatArray, origins: FloatArray) -> FloatArray:
    matrices = np.tile(np.eye(4), (len(origins), 1, 1))
    matrices[:, :3, :3] = rotations
    matrices[:, :3, 3] = origins
    return matrices
