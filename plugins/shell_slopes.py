"""What a shell's file says of the index around it, in the world's axes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from iriftrace.steepness import PLY_COLUMNS, SECOND_DERIVATIVES

from .aligned import aligned

FloatArray = NDArray[np.float64]


def shell_slopes(shape: Any, step: float) -> tuple[Any, Any, Any] | None:
    """Gradient and second derivatives of the index at a shell; None if its file has none.

    Parameters
    ----------
    shape : mi.Mesh
        With vertex normals along the gradient.
    step : float
        Index outside less index inside; the file counts in these steps, so a shell without one
        bends nothing.

    Returns
    -------
    gradient : Float, 1/mm
    straight, mixed : Float, 1/mm^2
        xx, yy, zz, yz and xz, xy, as a kernel gathers them: three, four and two numbers per vertex.
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
    normals = np.array(shape.vertex_normals_buffer(), dtype=np.float64).reshape(-1, 3)
    normals = np.nan_to_num(normals)
    length = np.linalg.norm(gradient, axis=1, keepdims=True)
    if np.abs(gradient - length * normals).sum() > 1e-5 * length.sum():
        derivatives = _turned(derivatives, _turn(gradient, normals))

    def numbers(rows: FloatArray) -> Any:
        return mi.Float(aligned(np.ascontiguousarray(rows, dtype=np.float32).ravel()))

    gradient = step * length * normals
    return numbers(gradient), numbers(step * derivatives[:, :4]), numbers(step * derivatives[:, 4:])


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
