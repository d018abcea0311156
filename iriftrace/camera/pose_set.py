"""Camera poses in an order: checked matrices, aimed at targets, kept out of the hot air."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from attrs import evolve, field, frozen
from numpy.typing import ArrayLike, NDArray

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError

_FARTHEST_PUSH_MM = 10_000.0
_STEP_MM = 5.0
_RIGID_TOLERANCE = 1e-6  # that of iriftrace.Camera


def fixed(value: ArrayLike) -> FloatArray:
    """A float64 copy of an array that nobody can change."""
    array = np.array(value, dtype=np.float64)
    array.setflags(write=False)
    return array


@frozen(eq=False)
class PoseSet:
    """Camera poses in an order.

    Parameters
    ----------
    matrices : (n, 4, 4) array, mm, world
        Camera to world; columns x right, y down, z forward, origin.
    azimuth_deg, elevation_deg : (n,) array, degree
        Angles of the orbit that a pose was made from; NaN (the default) for a pose without.
    table_deg : (n,) array, degree
        Angle by which the part is turned on its table; NaN (the default) without one.

    Raises
    ------
    InputError
        If a matrix is not a rigid motion or the lengths differ.
    """

    matrices: FloatArray = field(converter=fixed)
    azimuth_deg: FloatArray = field(converter=fixed)
    elevation_deg: FloatArray = field(converter=fixed)
    table_deg: FloatArray = field(converter=fixed)

    @azimuth_deg.default
    @elevation_deg.default
    @table_deg.default
    def _no_angle(self) -> FloatArray:
        return np.full(len(self.matrices), np.nan)

    def __attrs_post_init__(self) -> None:
        if self.matrices.ndim != 3 or self.matrices.shape[1:] != (4, 4):
            raise InputError(
                f"Poses have the shape {self.matrices.shape}; give 4x4 matrices, (n, 4, 4).",
                code="poses.shape",
            )
        for name, angle in zip(
            ("azimuths", "elevations", "table angles"), self.angles, strict=True
        ):
            if angle.shape != (len(self),):
                raise InputError(
                    f"There are {angle.size} {name} for {len(self)} poses; give one for each.",
                    code="poses.angle_count",
                )
        refuse_distorted(self.matrices, _RIGID_TOLERANCE)

    def __len__(self) -> int:
        return len(self.matrices)

    @property
    def angles(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Azimuths, elevations and angles of the table, (n,) arrays, degree."""
        return self.azimuth_deg, self.elevation_deg, self.table_deg

    @property
    def origins(self) -> FloatArray:
        """(n, 3) array, mm, world: the pinholes."""
        return self.matrices[:, :3, 3]

    @property
    def forward(self) -> FloatArray:
        """(n, 3) unit vectors, world: the optical axes."""
        return self.matrices[:, :3, 2]

    def take(self, indices: ArrayLike) -> PoseSet:
        """The poses of some indices, in their order, or of a mask of n booleans."""
        chosen = np.atleast_1d(np.asarray(indices))
        if chosen.dtype != np.bool_:
            chosen = chosen.astype(np.int64)  # an empty list comes as float
        return PoseSet(self.matrices[chosen], *(angle[chosen] for angle in self.angles))


def joined(pose_sets: Iterable[PoseSet]) -> PoseSet:
    """All poses of several sets, one set after the other."""
    parts = [PoseSet(np.empty((0, 4, 4))), *pose_sets]
    angles = zip(*(poses.angles for poses in parts), strict=True)
    return PoseSet(
        np.concatenate([poses.matrices for poses in parts]), *map(np.concatenate, angles)
    )


def aimed(origins: ArrayLike, targets: ArrayLike) -> FloatArray:
    """Camera to world matrices (n, 4, 4) that look from origins at targets, without roll.

    Both are (n, 3) or (3,), mm, world. The camera's x-axis lies in the world's x-y plane and +z is
    up in the picture. A vertical line of sight leaves the x-axis open; it is then +y, the limit for
    a camera of azimuth 0 that nears the pole. An InputError if a camera stands on its target or a
    value is not finite.
    """
    eyes = np.atleast_2d(np.asarray(origins, dtype=np.float64))
    forward = np.asarray(targets, dtype=np.float64) - eyes
    distance = np.linalg.norm(forward, axis=1, keepdims=True)
    if not np.isfinite(distance).all():
        raise InputError(
            "A camera position or its target is not finite; give three numbers each.",
            code="poses.not_finite",
        )
    if not distance.all():
        where = eyes[int(np.argmin(distance))].tolist()
        raise InputError(
            f"A camera at {where} mm stands on its own target, so there is no line of sight; "
            "move one of them.",
            code="poses.on_target",
        )
    forward = forward / distance
    level = np.hypot(forward[:, 0], forward[:, 1])
    vertical = level < 1e-12  # rounding of the positions, not a direction
    right = np.zeros_like(forward)
    right[:, 0] = forward[:, 1]
    right[:, 1] = -forward[:, 0]
    right /= np.where(vertical, 1.0, level)[:, None]
    right[vertical] = (0.0, 1.0, 0.0)
    matrices = np.tile(np.eye(4), (len(eyes), 1, 1))
    matrices[:, :3, 0] = right
    matrices[:, :3, 1] = np.cross(forward, right)
    matrices[:, :3, 2] = forward
    matrices[:, :3, 3] = eyes
    return matrices


def offset_outward(
    poses: PoseSet, is_hot: Callable[[FloatArray], NDArray[np.bool_]]
) -> tuple[PoseSet, NDArray[np.bool_]]:
    """Move cameras back along their optical axes, by 5 mm at a time, out of the hot air.

    `is_hot` takes (n, 3) points, mm, world, and returns True for those where no camera may stand.
    The poses keep their orientations and angles, which identify a moved pose. Also returns an (n,)
    mask of the moved poses. Raises InputError if the air is still hot after 10 m.
    """
    matrices = np.array(poses.matrices)
    hot = np.asarray(is_hot(poses.origins), dtype=bool)
    moved = hot.copy()
    back = _STEP_MM
    while hot.any():
        if back > _FARTHEST_PUSH_MM:
            number = int(np.argmax(hot))
            raise InputError(
                f"The pose at {np.round(poses.origins[number], 1).tolist()} mm is still in the hot "
                f"air {_FARTHEST_PUSH_MM / 1000:g} m further back; check field and poses.",
                code="poses.in_hot_air",
            )
        inside = np.flatnonzero(hot)
        matrices[inside, :3, 3] = poses.origins[inside] - back * poses.forward[inside]
        hot[inside] = is_hot(matrices[inside, :3, 3])
        back += _STEP_MM
    return evolve(poses, matrices=matrices), moved


def refuse_distorted(matrices: FloatArray, tolerance: float, place: str = "") -> None:
    """Refuse poses (n, 4, 4) that are not rigid motions, with an InputError.

    The axes' scalar products may be off 0 and 1 by the tolerance; `place` follows "Pose 3" in the
    message, such as " of poses.csv".
    """
    finite = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    # Products of entries beyond 2, which no rotation has, could overflow.
    axes = np.clip(np.where(finite[:, None, None], matrices[:, :3, :3], np.eye(3)), -2.0, 2.0)
    affine = np.all(matrices[:, 3] == (0.0, 0.0, 0.0, 1.0), axis=1)
    products = np.swapaxes(axes, 1, 2) @ axes
    straight = np.abs(products - np.eye(3)).max(axis=(1, 2)) <= tolerance
    righthanded = np.asarray(np.linalg.det(axes) > 0)
    for holds, fault in (
        (finite, "holds a number that is not finite; correct or remove it"),
        (affine, "does not end with the row 0 0 0 1; is the matrix transposed?"),
        (straight, "is more than a rotation and a shift in mm; remove scale and shear"),
        (righthanded, "mirrors the picture, as no camera does; turn one of its axes round"),
    ):
        if not holds.all():
            end = "" if fault.endswith("?") else "."
            raise InputError(
                f"Pose {int(np.argmin(holds)) + 1}{place} {fault}{end}", code="poses.not_rigid"
            )
