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

import codecs
import io
import json
import re
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from iriftrace.camera.pose_set import PoseSet, refuse_distorted
from iriftrace.camera.pose_table import (
    ANGLES,
    FRAME,
    MATRIX,
    columns_of_table,
    is_length_unit,
    unlike_robot,
)
from iriftrace.camera.robot_poses import RobotName
from iriftrace.camera.robot_programs import table_of_program
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.files import array_in, text_in, whole_file
from iriftrace.core.plain import TwiceError, once
from iriftrace.core.units import LENGTH_UNITS, length_factor
from iriftrace.geometry.transform import (
    checked_matrix,
    nearest_rotations,
    rigid_motion,
    stated_to_camera,
)

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
_FRAME = re.compile(r"unit|convention|ax[ei]s|coord|frame|system|direction|scale", re.IGNORECASE)
"""In names of what poses depend on."""

_LARGEST_ROUNDING = 1e-3  # of printed rotations, which often have four digits


def to_convention(matrices: ArrayLike, name: str) -> FloatArray:
    """Poses (..., 4, 4), camera to world with x right, y down, z forward, in another convention.

    The name is one of `CONVENTIONS`, else InputError.
    """
    return _with_axes(matrices, _axes(name))


def from_convention(matrices: ArrayLike, name: str) -> FloatArray:
    """The inverse of `to_convention`: camera-to-world matrices of a convention to x right, y down,
    z forward."""
    return _with_axes(matrices, _axes(name).T)


def read_poses(
    path: str | Path,
    convention: str = "opencv",
    *,
    length_unit: str = "mm",
    robot: RobotName | None = None,
    hand_eye: ArrayLike | None = None,
    base_to_part: ArrayLike | None = None,
) -> PoseSet:
    """Read poses of a camera, or of the robot that holds it.

    Parameters
    ----------
    path : str or Path
        ``.npy``: an array (n, 4, 4), (n, 16) or (4, 4), or without last rows, (n, 3, 4), (n, 12)
        or (3, 4). ``.json``: such a list, or an object with
        the list under ``matrices`` (and ``azimuth_deg``, ``elevation_deg``, ``convention``,
        ``length_unit``).
        Anything else is a text table with comma, semicolon (then also decimal commas) or blank
        between the columns and # before comments. Without a header: 16 or 12 numbers a row, the
        matrix row by row, or blocks of four rows of four. With a header, columns are found by name
        and others are ignored: ``m00`` ... ``m33`` (row, column), or ``x y z qx qy qz qw`` (origin,
        quaternion camera to world; also as ``tx``, ``x [m]``, ``pose.position.x``, ``q_w``), or
        ``x y z target_x target_y target_z`` (no roll, see `iriftrace.camera.pose_set.aimed`);
        or ``x y z`` with a robot's angles (see `iriftrace.camera.robot_poses`); besides,
        ``azimuth_deg``, ``elevation_deg``, ``convention``, ``length_unit``. A robot's program is
        the table of its positions (see `iriftrace.camera.robot_programs`).
    convention : str
        Axes of the camera in the file's matrices and quaternions, one of `CONVENTIONS`.
    length_unit : str
        Unit of the file's positions.
    robot : str, optional
        Robot that states the orientations, one of `iriftrace.camera.robot_poses.ROBOTS`. Needed
        where others may have the file's columns (``a b c``, ``rx ry rz``, ``q1`` to ``q4``);
        columns without names are then x, y, z and its angles.
    hand_eye : (4, 4) array, mm, optional
        Pose of the camera in the frame of the robot's flange, for files with poses of the flange:
        OpenCV's ``R_cam2gripper`` and ``t_cam2gripper`` of ``calibrateHandEye``.
    base_to_part : (4, 4) array, mm, optional
        Rigid motion from the frame in which the file has its poses, such as the robot's base, to
        the part's: OpenCV's ``R_base2world`` and ``t_base2world``.

    Returns
    -------
    PoseSet
        x right, y down, z forward, mm. Rotations printed with few digits are replaced by the
        nearest exact ones.

    Raises
    ------
    InputError
        If the file cannot be read, is malformed, states another convention or unit, does not say
        which robot's angles it has, or a pose is not a rigid motion.
    """
    path = Path(path)
    _axes(convention)  # An unknown one is refused also where no matrix needs it.
    factor = length_factor(length_unit)
    columns = _columns(path, robot)
    for name, given in (("convention", convention), ("length_unit", length_unit)):
        stated, read = map(_folded, (columns.get(name, given), given))
        if stated != read:
            raise InputError(
                f"{path} states {name} {stated!r}, but is read with {given!r}, which would "
                f"misplace every camera; read it with its own (--{name.replace('_', '-')})."
            )
    if unread := columns.get("unread"):
        warn(
            f"{path} has entries that are not read ({unread}); a unit belongs into length_unit, "
            "axes into convention, and matrices are from the camera to the world."
        )
    matrices = _stack(columns["matrices"], path)
    refuse_distorted(matrices, _LARGEST_ROUNDING, f" of {path}")
    matrices[:, :3, :3] = nearest_rotations(matrices[:, :3, :3])
    matrices[:, :3, 3] *= factor
    if columns.get("aimed", False):
        if hand_eye is not None:
            raise InputError(
                f"{path} aims cameras at targets, but a hand-eye matrix belongs to poses of a "
                "flange; leave it out (--hand-eye)."
            )
    else:
        if hand_eye is not None:
            matrices = matrices @ _hand_eye(hand_eye)
        matrices = from_convention(matrices, convention)
    if base_to_part is not None:
        motion = rigid_motion(checked_matrix(base_to_part), "The motion from base to part")
        matrices = motion @ matrices
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
            angles = (poses.azimuth_deg, poses.elevation_deg)
            listed = [[None if np.isnan(x) else x for x in angle.tolist()] for angle in angles]
            described = {
                "schema": SCHEMA,
                "convention": convention,
                "length_unit": "mm",
                "matrices": matrices.tolist(),
                **dict(zip(ANGLES, listed, strict=True)),
            }
            content = (json.dumps(described) + "\n").encode()
        case ".csv":
            lines = [",".join((*MATRIX, *ANGLES, "convention"))]
            angle_pairs = np.stack((poses.azimuth_deg, poses.elevation_deg), axis=1)
            for matrix, pair in zip(matrices, angle_pairs, strict=True):
                stated = ("" if np.isnan(x) else repr(x) for x in pair.tolist())
                lines.append(",".join((*map(repr, matrix.ravel().tolist()), *stated, convention)))
            content = ("\n".join(lines) + "\n").encode()
        case _:
            raise InputError(
                f"{path} has an ending that no format of poses has; use {', '.join(_FORMATS)}."
            )
    with whole_file(path) as temporary:
        temporary.write_bytes(content)


def _folded(word: object) -> object:
    """A unit by its usual name, any other word in small letters."""
    if not isinstance(word, str):
        return word
    return LENGTH_UNITS.get(word.strip().casefold(), word.strip().casefold())


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


def _hand_eye(matrix: ArrayLike) -> FloatArray:
    motion = rigid_motion(checked_matrix(matrix), "The hand-eye matrix")
    distance = float(np.linalg.norm(motion[:3, 3]))
    if 0.0 < distance < 1.0:
        warn(
            f"The hand-eye matrix has the camera {distance:.3g} mm from the flange, as if it were "
            "in metres; write '# unit: m' into its file, or give it in mm."
        )
    return motion


def _columns(path: Path, robot: RobotName | None) -> dict[str, object]:
    """What a file states of its poses, by name; ``aimed`` where they come from targets."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read poses from {path}: {error.strerror or error}.") from error
    kind = path.suffix.lower()
    if robot is not None and kind in (".npy", ".json"):
        raise unlike_robot(path, robot)
    if kind == ".npy":
        try:
            return {"matrices": array_in(content)}
        except ValueError as error:
            raise InputError(
                f"{path} is not a NumPy array ({error}); save one of 4x4 matrices."
            ) from error
    if b"\0" in content and not content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise InputError(f"{path} is not text; poses are read from {', '.join(_FORMATS)}.")
    text = text_in(path)
    if said := stated_to_camera(text):
        raise InputError(
            f"{path} says {said!r}, but poses lead from the camera to the world; write the "
            "inverse matrices."
        )
    if kind == ".json":
        return _object(text, path)
    if program := table_of_program(text, path):
        stated, text = program
        if robot not in (None, stated):
            raise unlike_robot(path, robot)
        robot = stated
    return columns_of_table(text, path, robot)


def _object(text: str, path: Path) -> dict[str, object]:
    try:
        data = json.loads(text, object_pairs_hook=once)
    except TwiceError as error:
        raise InputError(
            f"{path} has {error} twice; leave out the one that is not meant."
        ) from error
    except (json.JSONDecodeError, RecursionError) as error:
        raise InputError(f"{path} is not valid JSON ({error}); write it again.") from error
    columns = data if isinstance(data, dict) else {"matrices": data}
    if "matrices" not in columns:
        raise InputError(
            f"{path} has no entry 'matrices'; give the 4x4 camera-to-world matrices there."
        )
    # Whether poses were aimed is nothing that a file could state.
    known = ("matrices", "convention", *ANGLES)
    found = {key: columns[key] for key in known if key in columns}
    units = [key for key in columns if is_length_unit(key)]
    for key in units:
        found["length_unit"] = columns[key]
    rest = (f"{key}: {columns[key]}"[:60] for key in columns if key not in (*known, *units))
    found["unread"] = ", ".join(filter(FRAME.search, rest))
    return found


def _stack(values: object, path: Path) -> FloatArray:
    try:
        array = np.array(values, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        array = np.empty(0)
    if array.shape[-1:] == (12,):
        array = array.reshape(-1, 3, 4)
    if array.shape[-2:] == (3, 4):  # without the last row
        array = np.insert(array, 3, (0.0, 0.0, 0.0, 1.0), axis=-2)
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
