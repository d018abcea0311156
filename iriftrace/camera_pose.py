"""Poses of a camera: 4 x 4 matrices from its frame (x right, y down, z forward) to the world's."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from iriftrace.errors import InputError

FloatArray = NDArray[np.float64]


def look_at(origin: ArrayLike, target: ArrayLike, up: ArrayLike = (0.0, 0.0, 1.0)) -> FloatArray:
    """Pose of a camera that looks from one point at another.

    Parameters
    ----------
    origin, target : (3,) array, mm, world
    up : (3,) array, world
        Direction that is up in the picture. When it is parallel to the line of sight, +y takes its
        place (the limit of a camera that looks along +y while it rises).

    Returns
    -------
    (4, 4) array
        Camera to world; columns x right, y down, z forward, origin.

    Raises
    ------
    InputError
        If origin and target coincide or a value is not finite.
    """
    eye, aim, upward = (np.asarray(v, dtype=np.float64).reshape(3) for v in (origin, target, up))
    if not all(np.isfinite(v).all() for v in (eye, aim, upward)):
        raise InputError("A camera pose has a value that is not finite; give three numbers each.")
    forward = aim - eye
    distance = np.linalg.norm(forward)
    if distance == 0.0:
        raise InputError(
            f"Camera origin and target are the same point {eye.tolist()}, so there is no line of "
            "sight; move one of them."
        )
    forward = forward / distance
    right = np.cross(forward, upward)
    if np.linalg.norm(right) < 1e-9 * max(float(np.linalg.norm(upward)), 1e-300):
        right = np.cross(forward, (0.0, 1.0, 0.0))
    right = right / np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, 0] = right
    matrix[:3, 1] = np.cross(forward, right)
    matrix[:3, 2] = forward
    matrix[:3, 3] = eye
    return matrix
