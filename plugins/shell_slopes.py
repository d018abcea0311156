"""What a shell's file says of the index around it, in the world's axes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from iriftrace.steepness import PLY_COLUMNS, SECOND_DERIVATIVES

FloatArray = NDArray[np.float64]


def shell_slopes(shape: Any, normals: FloatArray, step: float) -> FloatArray | None:
    """How steep the index is at a shell, and how that changes; None if its file does not say.

    Parameters
    ----------
    shape : mi.Mesh
    normals : (n, 3) array
        Its vertex normals, along the gradient.
    step : float
        Index outside less index inside; the file counts in these steps, so a shell without one
        bends nothing.

    Returns
    -------
    (n, 7) array
        The gradient's part along the normal, 1/mm, and the second derivatives xx, yy, zz, yz, xz,
        xy, 1/mm^2.
    """
    import mitsuba as mi

    values = mi.traverse(shape)
    known = []
    for name, size in PLY_COLUMNS.items():
        attribute = values.get(f"vertex_{name}", None)
        if attribute is None or len(attribute) != size * shape.vertex_count():
            return None
        known.append(np.nan_to_num(np.array(attribute, dtype=np.float64).reshape(-1, size)))
    gradient, derivatives = known[0], np.hstack(known[1:])
    normals = np.nan_to_num(normals)
    length = np.linalg.norm(gradient, axis=1, keepdims=True)
    if np.abs(gradient - length * normals).sum() > 1e-5 * length.sum():
        derivatives = _turned(derivatives, _turn(gradient, normals))
    return step * np.hstack((length, derivatives))


def _turn(before: FloatArray, after: FloatArray) -> FloatArray:
    """Rotation (3, 3) that takes vectors into unit vectors, in least squares (Kabsch 1976).

    A mesh's ``to_world`` turns its normals, but not what else its file knows.
    """
    left, _, right = np.linalg.svd(after.T @ before)
    sign = np.sign(np.linalg.det(left) * np.linalg.det(right))
    turn: FloatArray = left @ np.diag((1.0, 1.0, sign)) @ right
    return turn


def _turned(derivatives: FloatArray, turn: FloatArray) -> FloatArray:
    """Second derivatives, (n, 6) in the file's order, after a rotation."""
    full = np.empty((len(derivatives), 3, 3))
    for column, (i, j) in enumerate(SECOND_DERIVATIVES):
        full[:, i, j] = full[:, j, i] = derivatives[:, column]
    full = turn @ full @ turn.T
    return np.stack([full[:, i, j] for i, j in SECOND_DERIVATIVES], axis=1)
