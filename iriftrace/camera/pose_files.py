"""Poses in files and in the camera conventions of other programs.

Every matrix here is camera to world, its columns the camera's axes and origin. The conventions name
the camera's axes differently; the world, z up, is the same in all of them:

=========  =======  =======  ========  ==============================================
name       x        y        z         used by
=========  =======  =======  ========  ==============================================
opencv     right    down     forward   iriftrace, OpenCV, COLMAP, ROS optical frames
mitsuba    left     up       forward   Mitsuba 3, Kern et al. (2025)
opengl     right    up       backward  OpenGL, Blender, NeRF data sets
ros        forward  left     up        ROS bodies (REP 103)
=========  =======  =======  ========  ==============================================
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from attrs import evolve, frozen
from numpy.typing import ArrayLike, NDArray

from iriftrace.camera.pose_set import PoseSet, aimed, refuse_distorted
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.files import array_in, whole_file
from iriftrace.core.units import length_factor
from iriftrace.geometry.transform import nearest_rotations

SCHEMA = "iriftrace.poses/1"

CONVENTIONS: dict[str, FloatArray] = {
    # Columns: the convention's x, y and z in right, down, forward.
    "opencv": np.eye(3),
    "mitsuba": np.diag((-1.0, -1.0, 1.0)),
    "opengl": np.diag((1.0, -1.0, -1.0)),
    "ros": np.array(((0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0))),
}
"""Axes of each convention in iriftrace's own camera frame, (3, 3) arrays."""

_FORMATS = (".csv", ".txt", ".json", ".npy")
_LARGEST_ROUNDING = 1e-3  # of printed rotations, which often have four digits

ANGLES = ("azimuth_deg", "elevation_deg")
MATRIX = tuple(f"m{row}{column}" for row in range(4) for column in range(4))

_ORIGIN = ("x", "y", "z")
_QUATERNION = ("qx", "qy", "qz", "qw")
_TARGET = ("target_x", "target_y", "target_z")
_NAMES = "m00 ... m33, or x, y, z with qx, qy, qz, qw, or x, y, z with target_x, target_y, target_z"


def to_convention(matrices: ArrayLike, name: str) -> FloatArray:
    """Poses (..., 4, 4), camera to world with x right, y down, z forward, in another convention.

    The name is one of `CONVENTIONS`, else InputError.
    """
    return _with_axes(matrices, _axes(name))


def from_convention(matrices: ArrayLike, name: str) -> FloatArray:
    """The inverse of `to_convention`: camera-to-world matrices of a convention to x right, y down,
    z forward."""
    return _with_axes(matrices, _axes(name).T)


def read_poses(path: str | Path, convention: str = "opencv", *, length_unit: str = "mm") -> PoseSet:
    """Read camera poses.

    Parameters
    ----------
    path : str or Path
        ``.npy``: an array (n, 4, 4), (n, 16) or (4, 4). ``.json``: such a list, or an object with
        the list under ``matrices`` (and ``azimuth_deg``, ``elevation_deg``, ``convention``,
        ``length_unit``).
        Anything else is a text table with comma, semicolon (then also decimal commas) or blank
        between the columns and # before comments. Without a header: 16 numbers a row, the matrix
        row by row, or blocks of four rows of four. With a header, columns are found by name and
        others are ignored: ``m00`` ... ``m33`` (row, column), or ``x y z qx qy qz qw`` (origin,
        quaternion camera to world), or ``x y z target_x target_y target_z`` (no roll, see
        `iriftrace.camera.pose_set.aimed`); besides, ``azimuth_deg``, ``elevation_deg``,
        ``convention``.
    convention : str
        Axes of the camera in the file's matrices and quaternions, one of `CONVENTIONS`.
    length_unit : str
        Unit of the file's positions.

    Returns
    -------
    PoseSet
        x right, y down, z forward, mm. Rotations printed with few digits are replaced by the
        nearest exact ones.

    Raises
    ------
    InputError
        If the file cannot be read, is malformed, states another convention or unit, or a pose is
        not a rigid motion.
    """
    path = Path(path)
    _axes(convention)  # An unknown one is refused also where no matrix needs it.
    factor = length_factor(length_unit)
    columns = _columns(path)
    for name, given in (("convention", convention), ("length_unit", length_unit)):
        stated = columns.get(name, given)
        if stated != given:
            raise InputError(
                f"{path} states {name} {stated!r}, but is read with {given!r}, which would "
                "misplace every camera; read it with its own."
            )
    matrices = _stack(columns["matrices"], path)
    refuse_distorted(matrices, _LARGEST_ROUNDING, f" of {path}")
    matrices[:, :3, :3] = nearest_rotations(matrices[:, :3, :3])
    if not columns.get("aimed", False):
        matrices = from_convention(matrices, convention)
    matrices[:, :3, 3] *= factor
    return PoseSet(matrices, *(_angles(columns, name, len(matrices), path) for name in ANGLES))


def write_poses(path: str | Path, poses: PoseSet, convention: str = "opencv") -> None:
    """Write camera poses, in mm, such that `read_poses` gives them back to the last bit.

    ``.csv`` (with header) and ``.json`` keep angles and state the convention, one of `CONVENTIONS`;
    ``.npy`` and ``.txt`` (blocks of four rows) hold the matrices alone. An InputError if the ending
    or the convention is unknown, there is no pose, or the file cannot be written.
    """
    path = Path(path)
    matrices = to_convention(poses.matrices, convention)
    if len(poses) == 0:
        raise InputError(f"There is no pose to write to {path}; choose at least one.")
    match path.suffix.lower():
        case ".npy":
            buffer = io.BytesIO()
            np.save(buffer, matrices)
            content = buffer.getvalue()
        case ".txt":
            rows = ([" ".join(map(repr, row)) for row in matrix] for matrix in matrices.tolist())
            blocks = map("\n".join, rows)
            content = ("\n\n".join(blocks) + "\n").encode()
        case ".json":
            content = (json.dumps(_described(poses, matrices, convention)) + "\n").encode()
        case ".csv":
            content = _as_table(poses, matrices, convention).encode()
        case _:
            raise InputError(
                f"{path} has an ending that no format of poses has; use {', '.join(_FORMATS)}."
            )
    with whole_file(path) as temporary:
        temporary.write_bytes(content)


def _axes(name: str) -> FloatArray:
    try:
        return CONVENTIONS[name]
    except KeyError:
        raise InputError(
            f"Unknown camera convention {name!r}; use one of {', '.join(CONVENTIONS)}."
        ) from None


def _with_axes(matrices: ArrayLike, axes: FloatArray) -> FloatArray:
    turned = np.array(matrices, dtype=np.float64)
    # Only signs and places change, so nothing is rounded; + 0 turns -0 into 0.
    turned[..., :3, :3] = turned[..., :3, :3] @ axes + 0.0
    return turned


def _columns(path: Path) -> dict[str, object]:
    """What a file states of its poses, by name; ``aimed`` where they come from targets."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read poses from {path}: {error.strerror or error}.") from error
    kind = path.suffix.lower()
    if kind == ".npy":
        try:
            return {"matrices": array_in(content)}
        except ValueError as error:
            raise InputError(
                f"{path} is not a NumPy array ({error}); save one of 4x4 matrices."
            ) from error
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(
            f"{path} is not text; poses are read from {', '.join(_FORMATS)}."
        ) from None
    return _object(text, path) if kind == ".json" else _table(text, path)


def _object(text: str, path: Path) -> dict[str, object]:
    try:
        data = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise InputError(f"{path} is not valid JSON ({error}); write it again.") from error
    columns = data if isinstance(data, dict) else {"matrices": data}
    if "matrices" not in columns:
        raise InputError(
            f"{path} has no entry 'matrices'; give the 4x4 camera-to-world matrices there."
        )
    # Whether poses were aimed is nothing that a file could state.
    known = ("matrices", "convention", "length_unit", *ANGLES)
    return {key: columns[key] for key in known if key in columns}


def _stack(values: object, path: Path) -> FloatArray:
    try:
        array = np.array(values, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        array = np.empty(0)
    if array.shape in ((4, 4), (16,)):
        array = array[None]
    if array.size and array.shape[1:] in ((4, 4), (16,)):
        return array.reshape(-1, 4, 4)
    raise InputError(
        f"{path} holds no list of 4x4 matrices; give 16 numbers for every pose, row by row."
    )


def _angles(columns: dict[str, object], name: str, count: int, path: Path) -> FloatArray:
    try:
        angles = np.array(columns.get(name, [np.nan] * count), dtype=np.float64)
    except (ValueError, TypeError):
        angles = np.empty(0)
    if angles.shape != (count,):
        raise InputError(
            f"{path} has {count} poses, but '{name}' is not a list of as many numbers."
        )
    return angles


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


def _table(text: str, path: Path) -> dict[str, object]:
    """Columns of a text table of poses, as `read_poses` describes it, by name.

    ``matrices`` are (n, 4, 4); ``aimed`` is true for poses that came from targets, which are in
    iriftrace's own convention.
    """
    numbered = [(k, line.split("#")[0].strip()) for k, line in enumerate(text.splitlines(), 1)]
    numbered = [(k, line) for k, line in numbered if line]
    if not numbered:
        raise InputError(f"{path} holds no pose; give at least one.")
    delimiter = next((d for d in ";," if any(d in line for _, line in numbered)), "")
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
    if any(map(_is_number, cells[0])):
        return {"matrices": _unnamed(_Table(path, lines, cells))}
    if len(cells) == 1:
        raise InputError(f"{path} has a header but no pose below it; add one.")
    return _named(_Table(path, lines[1:], cells[1:]), [name.lower() for name in cells[0]])


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
    twice = [name for name in (*MATRIX, *_ORIGIN, *_QUATERNION, *_TARGET) if names.count(name) > 1]
    if twice:
        raise InputError(f"{table.path} has the column {twice[0]} twice; remove one.")

    def columns(selected: Sequence[str]) -> FloatArray:
        return table.numbers([names.index(name) for name in selected])

    forms = [MATRIX, _ORIGIN + _QUATERNION, _ORIGIN + _TARGET]
    complete = [set(form) <= set(names) for form in forms]
    if sum(complete) != 1:
        fault = "describes poses twice" if any(complete) else "does not describe poses"
        raise InputError(
            f"The header of {table.path} ({', '.join(names)}) {fault}; name the columns {_NAMES}."
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
    if "convention" in names:
        stated = table.cells[:, names.index("convention")]
        read["convention"] = ", ".join(sorted(set(stated.tolist())))
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


def _described(poses: PoseSet, matrices: FloatArray, convention: str) -> dict[str, object]:
    angles = (poses.azimuth_deg, poses.elevation_deg)
    listed = [[None if np.isnan(x) else x for x in angle.tolist()] for angle in angles]
    return {
        "schema": SCHEMA,
        "convention": convention,
        "length_unit": "mm",
        "matrices": matrices.tolist(),
        **dict(zip(ANGLES, listed, strict=True)),
    }


def _as_table(poses: PoseSet, matrices: FloatArray, convention: str) -> str:
    angles = np.stack((poses.azimuth_deg, poses.elevation_deg), axis=1)
    lines = [",".join((*MATRIX, *ANGLES, "convention"))]
    for matrix, pair in zip(matrices, angles, strict=True):
        stated = ("" if np.isnan(x) else repr(x) for x in pair.tolist())
        lines.append(",".join((*map(repr, matrix.ravel().tolist()), *stated, convention)))
    return "\n".join(lines) + "\n"
