"""How steep the index is at the vertices of a shell, and how that changes: seven numbers each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

SECOND_DERIVATIVES = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
"""Axes of the second derivatives xx, yy, zz, yz, xz, xy, in the order in which they are kept."""

STEEPNESSES = 1 + len(SECOND_DERIVATIVES)
"""Numbers per vertex: the length of the gradient, then the second derivatives."""

FASTEST, SLOWEST = 0.0, 1.5
"""Limits of u u'' / u'^2 for the fall u of the index to the ambient, on ways out of all shells.

0 is a straight line, 1 an exponential; more has a longer tail.
"""

PLY_COLUMNS = {"gradient": 3, "straight": 3, "mixed": 3}
"""What a shell's file keeps: the gradient; xx, yy, zz; yz, xz, xy; all over the shell's step.

Mitsuba turns columns ``gradient_1``, ``straight_1`` ... into attributes ``vertex_gradient`` ... The
gradient tells by how much a ``to_world`` has turned the mesh.
"""


def steepness_rows(length: FloatArray, derivatives: FloatArray, step: float = 1.0) -> FloatArray:
    """What a :class:`iriftrace.shells.Shell` knows of the index around its vertices.

    Parameters
    ----------
    length : (n,) array, 1/mm
        Of the gradient of n.
    derivatives : (n, 3, 3) array, 1/mm^2, world
        Second derivatives of n, symmetric.
    step : float
        The shell's ``ext - int_``, by which all are divided.

    Returns
    -------
    (n, 7) array
    """
    columns = [length, *(derivatives[:, i, j] for i, j in SECOND_DERIVATIVES)]
    return np.stack(columns, axis=1) / step


def radial_steepness(
    normals: NDArray[np.floating],
    slope: float,
    bend: float,
    radius: float,
    step: float,
    fall: float | None = None,
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
        As for :func:`steepness_rows`.
    fall : float, optional
        For the outermost shell: by how much n is below the ambient's there. Then the part around
        the axis is that of the air outside, as of :func:`iriftrace.outer_air.outer_derivatives`.
    """
    unit = np.asarray(normals, dtype=np.float64)
    outer = unit[:, :, None] * unit[:, None, :]
    around = np.diag((0.0, 1.0, 1.0)) - outer
    nearness = 1.0
    if fall is not None:
        nearness /= 2.0 - np.clip(-fall * bend / slope**2, FASTEST, SLOWEST)
    derivatives = bend * outer + nearness * slope / radius * around
    return steepness_rows(np.full(len(unit), slope), derivatives, step)
