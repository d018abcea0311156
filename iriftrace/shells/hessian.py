"""How steep the index is at the vertices of a shell, and how that changes: seven numbers each."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from iriftrace.core.arrays import FloatArray

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
    """What a :class:`iriftrace.shells.contour.Shell` knows of the index around its vertices.

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
        the axis is that of the air outside (`outer_derivatives`).
    """
    unit = np.asarray(normals, dtype=np.float64)
    outer = unit[:, :, None] * unit[:, None, :]
    around = np.diag((0.0, 1.0, 1.0)) - outer
    nearness = 1.0
    if fall is not None:
        nearness /= 2.0 - np.clip(-fall * bend / slope**2, FASTEST, SLOWEST)
    derivatives = bend * outer + nearness * slope / radius * around
    return steepness_rows(np.full(len(unit), slope), derivatives, step)


# MERGE outer_air: How the index's gradient turns on its way out to the ambient, seen from the out

PLACES = 6
"""Places on each way, at equal shares of an exponential fall."""

LEAST_COSINE = 0.2
"""Between way and gradient; what lies flatter counts as this."""

ON_FACE_MM = 1e-4
"""How far beside a cell a place may lie."""


def outer_derivatives(
    grid: pv.UnstructuredGrid,
    places: NDArray[np.floating],
    gradient: FloatArray,
    level: float,
    ambient: float,
) -> FloatArray:
    r"""Second derivatives that describe the air outside the outermost shell.

    A ray that goes out in direction w from a place with gradient g, where the index is still u
    below the ambient's, meets gradients of the mean direction

    .. math:: \bar g \parallel g + \frac{u}{|g| \cos\theta} H w \quad \text{(the part across g)}

    at the mean distance :math:`u / (|g| \cos\theta) / (2 - r)`, both weighted by the change of the
    index. Here :math:`\cos\theta = w \cdot g / |g|` and :math:`r = -u H_{nn} / |g|^2`: 0 where the
    index rises linearly to the ambient's, 1 where it does exponentially. H is chosen so that this
    holds for the way along g and, in the mean of opposite ones, for those at 45 degrees to it.

    Parameters
    ----------
    grid : pyvista.UnstructuredGrid
        With point arrays ``"refractivity"`` and ``"gradient"``.
    places : (n, 3) array, mm
        On the shell.
    gradient : (n, 3) array, 1/mm
        Of the index there.
    level, ambient : float
        n - 1 of the shell and of the ambient air.

    Returns
    -------
    (n, 3, 3) array, 1/mm^2
    """
    steep = np.linalg.norm(gradient, axis=1)
    known = steep > 0.0
    derivatives = np.zeros((len(places), 3, 3))
    steep, start = steep[known], np.asarray(places, dtype=np.float64)[known]
    axes = _frames(gradient[known] / steep[:, None])
    out = axes[:, 0]
    fading = (ambient - level) / steep

    def tilt(way: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Part across the gradient of the mean one for 1 along it, and the mean distance."""
        cosine = np.einsum("ij,ij->i", way, out)
        mean, distance = _mean_outside(grid, start, way, fading / cosine, level, ambient)
        local = np.einsum("iaj,ij->ia", axes, mean)
        return local[:, 1:] / np.maximum(local[:, :1], LEAST_COSINE), distance

    straight, distance = tilt(out)
    local = np.zeros((len(start), 3, 3))
    for side in (1, 2):
        across = axes[:, side]
        there, back = (tilt((out + sign * across) / np.sqrt(2.0))[0] for sign in (1.0, -1.0))
        local[:, side, 1:] = 0.5 * (there - back)
    local[:, 0, 1:] = straight
    local[:, 1:, 0] = straight
    local = 0.5 * (local + local.transpose(0, 2, 1))
    nearest = fading / (2.0 - FASTEST)
    local[:, 0, 0] = -np.minimum(2.0 - fading / np.maximum(distance, nearest), SLOWEST)
    local *= (steep / fading)[:, None, None]
    derivatives[known] = axes.transpose(0, 2, 1) @ local @ axes
    return derivatives


def _frames(normals: FloatArray) -> FloatArray:
    """Right-handed axes, (n, 3, 3), whose first rows are the normals."""
    away = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    second = np.cross(normals, away)
    second /= np.linalg.norm(second, axis=1, keepdims=True)
    return np.stack((normals, second, np.cross(normals, second)), axis=1)


def _mean_outside(
    grid: pv.UnstructuredGrid,
    start: FloatArray,
    way: FloatArray,
    fading: FloatArray,
    level: float,
    ambient: float,
) -> tuple[FloatArray, FloatArray]:
    """Mean of the gradient's direction on ways out, and mean distance, weighted by the change of n.

    Where nothing is found, as at the end of the data, the direction is that of the way.
    """
    shares = (np.arange(PLACES) + 0.5) / PLACES
    distance = -np.log(1.0 - shares) * fading[:, None]
    asked = start[:, None, :] + distance[:, :, None] * way[:, None, :]
    found = pv.PolyData(asked.reshape(-1, 3)).sample(grid, tolerance=ON_FACE_MM)
    inside = np.asarray(found.point_data["vtkValidPointMask"]) != 0
    index = np.where(inside, found.point_data["refractivity"], ambient).reshape(-1, PLACES)
    gradient = np.where(inside[:, None], found.point_data["gradient"], 0.0)
    length = np.linalg.norm(gradient, axis=1, keepdims=True)
    unit = np.divide(gradient, length, out=np.zeros_like(gradient), where=length > 0.0)
    unit = unit.reshape(-1, PLACES, 3)

    ends = np.empty((len(start), PLACES + 1))
    ends[:, 0], ends[:, 1:-1], ends[:, -1] = level, 0.5 * (index[:, :-1] + index[:, 1:]), ambient
    cosine = np.maximum(np.einsum("ijk,ik->ij", unit, way), LEAST_COSINE)
    weight = np.maximum(np.diff(ends, axis=1), 0.0) / cosine
    weight[(unit == 0.0).all(axis=2)] = 0.0
    total = weight.sum(axis=1, keepdims=True)
    weight = np.divide(weight, total, out=np.zeros_like(weight), where=total > 0.0)
    mean = np.einsum("ij,ijk->ik", weight, unit)
    mean[total[:, 0] == 0.0] = way[total[:, 0] == 0.0]
    return mean, (weight * distance).sum(axis=1)
