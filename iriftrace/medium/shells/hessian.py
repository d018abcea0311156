"""First and second derivatives of the index at the vertices of a shell: seven numbers each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iriftrace.core.arrays import Float32Array, FloatArray

HESSIAN_AXES = {
    "hessian_xx": (0, 0),
    "hessian_yy": (1, 1),
    "hessian_zz": (2, 2),
    "hessian_yz": (1, 2),
    "hessian_xz": (0, 2),
    "hessian_xy": (0, 1),
}
"""Elements of the Hessian in storage order, and their axes."""

DERIVATIVES = 1 + len(HESSIAN_AXES)
"""Numbers per vertex: the gradient's magnitude, then the Hessian."""

PLY_COLUMNS = {"gradient": 3, **dict.fromkeys(HESSIAN_AXES, 1)}
"""Numbers of each quantity of a shell's file, all over the shell's step of the index.

Mitsuba makes an attribute ``vertex_gradient`` of columns ``gradient_1``, ``gradient_2`` ... and
needs the number also behind a single one, ``hessian_xx_1``. The gradient shows by how much a
``to_world`` has rotated the mesh.
"""


def derivative_rows(magnitude: FloatArray, hessian: FloatArray, step: float = 1.0) -> FloatArray:
    """The derivatives (n, 7) that a `iriftrace.medium.shells.stack.Shell` keeps, over its step.

    Of the magnitude (n,) of the gradient of n, 1/mm, and the symmetric Hessian (n, 3, 3) of n,
    1/mm^2, world; `step` is the shell's ``ext - int_``.
    """
    columns = [magnitude, *(hessian[:, i, j] for i, j in HESSIAN_AXES.values())]
    return np.stack(columns, axis=1) / step


def radial_derivatives(
    normals: NDArray[np.floating], slope: float, bend: float, radius: float, step: float
) -> FloatArray:
    """The same if n depends only on the distance from the x axis or from a plane.

    `normals` (n, 3) are unit vectors along +grad(n), away from the axis; `slope` and `bend` the
    first and second derivative of n along them, 1/mm and 1/mm^2; `radius`, mm, is infinite for a
    plane; `step` as for :func:`derivative_rows`.
    """
    unit = np.asarray(normals, dtype=np.float64)
    along = unit[:, :, None] * unit[:, None, :]
    around = np.diag((0.0, 1.0, 1.0)) - along
    return derivative_rows(np.full(len(unit), slope), bend * along + slope / radius * around, step)


def vertex_columns(
    normals: Float32Array | None, derivatives: Float32Array | None
) -> dict[str, Float32Array]:
    """Mitsuba's vertex attributes of a shell, (n, 1) or (n, 3) each, by name."""
    if normals is None:
        return {}
    found = {"normal": normals}
    if derivatives is not None:
        found["gradient"] = normals * derivatives[:, :1]
        found |= {
            name: derivatives[:, column : column + 1]
            for column, name in enumerate(HESSIAN_AXES, start=1)
        }
    return found
