"""First and second derivatives of the index at the vertices of a shell: seven numbers each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iriftrace.core.arrays import FloatArray

HESSIAN_AXES = {
    "hessian_xx": (0, 0),
    "hessian_yy": (1, 1),
    "hessian_zz": (2, 2),
    "hessian_yz": (1, 2),
    "hessian_xz": (0, 2),
    "hessian_xy": (0, 1),
}
"""Elements of the Hessian in the order in which they are kept, and their axes."""

DERIVATIVES = 1 + len(HESSIAN_AXES)
"""Numbers per vertex: the gradient's magnitude, then the Hessian."""

PLY_COLUMNS = {"gradient": 3, **dict.fromkeys(HESSIAN_AXES, 1)}
"""Numbers of each quantity of a shell's file, all over the shell's step of the index.

Mitsuba makes an attribute ``vertex_gradient`` of columns ``gradient_1``, ``gradient_2`` ... and
needs the number also behind a single one, ``hessian_xx_1``. The gradient tells by how much a
``to_world`` has turned the mesh.
"""


def derivative_rows(magnitude: FloatArray, hessian: FloatArray, step: float = 1.0) -> FloatArray:
    """The derivatives that a :class:`iriftrace.shells.stack.Shell` keeps.

    Parameters
    ----------
    magnitude : (n,) array, 1/mm
        Of the gradient of n.
    hessian : (n, 3, 3) array, 1/mm^2, world
        Second derivatives of n, symmetric.
    step : float
        The shell's ``ext - int_``, by which all are divided.

    Returns
    -------
    (n, 7) array
    """
    columns = [magnitude, *(hessian[:, i, j] for i, j in HESSIAN_AXES.values())]
    return np.stack(columns, axis=1) / step


def radial_derivatives(
    normals: NDArray[np.floating], slope: float, bend: float, radius: float, step: float
) -> FloatArray:
    """The same where n depends on the distance from an axis, or from a plane, alone.

    Parameters
    ----------
    normals : (n, 3) array
        Unit normals along +grad(n), away from the axis, which is that of x.
    slope, bend : float, 1/mm and 1/mm^2
        First and second derivative of n along them.
    radius : float, mm
        Distance from the axis; infinite for a plane.
    step : float
        As for :func:`derivative_rows`.
    """
    unit = np.asarray(normals, dtype=np.float64)
    along = unit[:, :, None] * unit[:, None, :]
    around = np.diag((0.0, 1.0, 1.0)) - along
    return derivative_rows(np.full(len(unit), slope), bend * along + slope / radius * around, step)
