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

import io
import json
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Literal

import numpy as np
from attrs import frozen
from numpy.typing import ArrayLike

from iriftrace.camera.pose_set import PoseSet, refuse_distorted
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.files import array_in, text_in, whole_file
from iriftrace.core.mesh.transform import checked_matrix, nearest_rotations, rigid_motion
from iriftrace.core.plain import plain, structured
from iriftrace.core.units import LENGTH_UNITS, length_factor
from iriftrace.io.pose_table import ANGLES, MATRIX, ORIGIN, StatedPoses, read_table
from iriftrace.io.refusals import check_ending, check_exists, damaged
from iriftrace.io.robot_poses import ROBOTS, RobotName

SCHEMA = "iriftrace.poses/1"

Convention = Literal["opencv", "mitsuba", "opengl", "ros"]
OPENCV: Convention = "opencv"
"""The usual axes: x right, y down, z forward."""

CONVENTIONS: dict[str, FloatArray] = {
    # Columns: the convention's x, y and z in right, down, forward.
    "opencv": np.eye(3),
    "mitsuba": np.diag((-1.0, -1.0, 1.0)),
    "opengl": np.diag((1.0, -1.0, -1.0)),
    "ros": np.array(((0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0))),
}
"""Axes of each convention in iriftrace's own camera frame, (3, 3) arrays."""

_FORMATS = (".csv", ".json", ".npy")

_LARGEST_ROUNDING = 1e-3  # of printed rotations, which often have four digits


@frozen
class _JsonFile:
    """The content of a ``.json`` file of poses."""

    schema: str
    convention: str
    length_unit: str
    matrices: list[list[list[float]]]
    azimuth_deg: list[float | None]
    elevation_deg: list[float | None]


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
    convention: str = OPENCV,
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
        ``.npy``: an array (n, 4, 4) of camera-to-world matrices. ``.json``: what `write_poses`
        wrote. ``.csv``: a table whose first line names its columns, separated by comma, or by
        semicolon and then also with decimal commas. The columns are ``m00`` ... ``m33`` (row,
        column), or ``x y z qx qy qz qw`` (origin, quaternion camera to world), or
        ``x y z target_x target_y target_z`` (no roll, see `iriftrace.camera.pose_set.aimed`), or
        with a `robot` ``x y z`` and its own; besides, ``azimuth_deg``, ``elevation_deg`` and
        ``convention``. A unit may follow a name, as in ``x [m]``.
    convention : str
        Axes of the camera in the file's matrices and quaternions, one of `CONVENTIONS`.
    length_unit : str
        Unit of the file's positions.
    robot : str, optional
        Robot whose orientations the table has, one of `iriftrace.io.robot_poses.ROBOTS`.
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
        If the file cannot be read, has another form, states another convention or unit, or a pose
        is not a rigid motion.
    """
    path = Path(path)
    _axes(convention)  # An unknown one is refused also where no matrix needs it.
    factor = length_factor(length_unit)
    stated = _stated(path, robot)
    for name, said, given in (
        ("convention", stated.convention, convention),
        ("length_unit", stated.length_unit, length_unit),
    ):
        if said and _folded(said) != _folded(given):
            raise InputError(
                f"{path} states the {name.replace('_', ' ')} {said!r}, but is read with {given!r}, "
                "which would misplace every camera; read it with its own.",
                code="poses.contradict",
                argument=name,
            )
    matrices = np.array(stated.matrices, dtype=np.float64)
    refuse_distorted(matrices, _LARGEST_ROUNDING, f" of {path}")
    matrices[:, :3, :3] = nearest_rotations(matrices[:, :3, :3])
    matrices[:, :3, 3] *= factor
    if hand_eye is not None:
        if stated.is_aimed:
            raise InputError(
                f"{path} aims cameras at targets, but a hand-eye matrix belongs to poses of a "
                "flange; leave it out.",
                code="poses.aimed",
                argument="hand_eye",
            )
        matrices = matrices @ _hand_eye(hand_eye)
    if not stated.is_aimed:
        matrices = from_convention(matrices, convention)
    if base_to_part is not None:
        motion = rigid_motion(checked_matrix(base_to_part), "The motion from base to part")
        matrices = motion @ matrices
    unknown = np.full(len(matrices), np.nan)
    angles = (stated.azimuth_deg, stated.elevation_deg)
    return PoseSet(matrices, *(unknown if angle is None else angle for angle in angles))


def write_poses(
    path: str | Path,
    poses: PoseSet,
    convention: str = OPENCV,
    more: Mapping[str, object] = MappingProxyType({}),
) -> None:
    """Write camera poses, in mm, such that `read_poses` gives them back to the last bit.

    ``.csv`` and ``.json`` keep angles and state the convention, one of `CONVENTIONS`; ``.npy``
    holds the matrices alone; `more` are further entries of a ``.json``. An InputError if the ending
    or the convention is unknown, there is no pose, or the file cannot be written.
    """
    path = Path(path)
    check_ending(path, _FORMATS, "a file of poses")
    matrices = to_convention(poses.matrices, convention)
    if len(poses) == 0:
        raise InputError(
            f"There is no pose to write to {path}; choose at least one.", code="poses.empty"
        )
    match path.suffix.lower():
        case ".npy":
            buffer = io.BytesIO()
            np.save(buffer, matrices)
            content = buffer.getvalue()
        case ".json":
            angles = (poses.azimuth_deg, poses.elevation_deg)
            listed = ([None if np.isnan(x) else x for x in angle.tolist()] for angle in angles)
            described = _JsonFile(SCHEMA, convention, "mm", matrices.tolist(), *listed)
            content = (json.dumps({**plain(described), **more}) + "\n").encode()
        case _:
            lines = [",".join((*MATRIX, *ANGLES, "convention"))]
            angle_pairs = np.stack((poses.azimuth_deg, poses.elevation_deg), axis=1)
            for matrix, pair in zip(matrices, angle_pairs, strict=True):
                stated = ("" if np.isnan(x) else repr(x) for x in pair.tolist())
                lines.append(",".join((*map(repr, matrix.ravel().tolist()), *stated, convention)))
            content = ("\n".join(lines) + "\n").encode()
    with whole_file(path) as temporary:
        temporary.write_bytes(content)


def _folded(word: str) -> str:
    """A unit by its usual name, any other word in small letters."""
    return LENGTH_UNITS.get(word.strip().casefold(), word.strip().casefold())


def _axes(name: str) -> FloatArray:
    try:
        return CONVENTIONS[name]
    except KeyError:
        raise InputError(
            f"Unknown camera convention {name!r}; use one of {', '.join(CONVENTIONS)}.",
            code="poses.convention",
            argument="convention",
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
            "in metres; write '# unit: m' into its file, or give it in mm.",
            argument="hand_eye",
        )
    return motion


def _stated(path: Path, robot: RobotName | None) -> StatedPoses:
    """What a file states of its poses, in its own convention and unit."""
    check_ending(path, _FORMATS, "a file of poses")
    check_exists(path)
    kind = path.suffix.lower()
    if robot is not None and kind != ".csv":
        raise InputError(
            f"{path} cannot state orientations of a robot ({robot}); give a table (.csv) with the "
            f"columns {', '.join(ORIGIN + ROBOTS[robot].columns)}, or leave out the robot.",
            code="poses.robot",
            argument="robot",
        )
    try:
        match kind:
            case ".npy":
                return StatedPoses(_matrices(array_in(path.read_bytes())))
            case ".json":
                return _described(text_in(path))
            case _:
                return read_table(text_in(path), path, robot)
    except InputError:
        raise
    except ValueError as error:
        remedy = "write 4x4 camera-to-world matrices, (n, 4, 4), as .npy, or a table (.csv)"
        raise damaged(path, error, remedy) from error


def _matrices(values: ArrayLike) -> FloatArray:
    """An array (n, 4, 4); raises ValueError for anything else."""
    try:
        array = np.array(values, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        raise ValueError("it has something else than an array of numbers") from None
    if array.ndim != 3 or array.shape[1:] != (4, 4) or len(array) == 0:
        raise ValueError(f"its array has the shape {array.shape}")
    return array


def _described(text: str) -> StatedPoses:
    """The content of a ``.json``; raises ValueError with the fault."""
    try:
        data = json.loads(text)
    except RecursionError as error:
        raise ValueError(f"{error}") from error
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        raise ValueError(f"it has no schema {SCHEMA!r}")
    read = structured(data, _JsonFile)
    matrices = _matrices(read.matrices)
    azimuth, elevation = (np.array(x, dtype=float) for x in (read.azimuth_deg, read.elevation_deg))
    for angles in (azimuth, elevation):
        if angles.shape != (len(matrices),):
            raise ValueError(f"it has {len(matrices)} matrices, but {angles.size} angles")
    return StatedPoses(matrices, azimuth, elevation, read.convention, read.length_unit)
