"""Errors of triangulated points to first order, from the offsets of the lines of sight alone."""

from __future__ import annotations

import numpy as np

from iriftrace.core.arrays import FloatArray
from iriftrace.core.mesh.triangles import unit_vectors
from iriftrace.measuring.two_devices.devices import Sensor, nearest_point, on_plane, phase_planes


def first_order_error(
    sensor: Sensor, points: FloatArray, offset: FloatArray, second_offset: FloatArray
) -> FloatArray:
    r"""Error X' - X (n, 3) of points whose lines of sight pass them at known offsets.

    The devices see X along the unit directions a and b, and their straight lines pass through
    :math:`X + \delta_c` and :math:`X + \delta_p`. With the normal m of the projector's plane

    .. math:: e = \delta_c + a \frac{m \cdot (\delta_p - \delta_c)}{m \cdot a}

    and for two cameras e is the midpoint between the two lines. The neglected terms are of second
    order: the offset is taken at X for the line that ends next to it.

    Points and offsets are (n, 3) arrays, mm, world; an offset is :math:`-(I - a a^T)` times the
    displacement, as `iriftrace.image.sightings.FaceSightings.offset` has it. A laser's sheet is
    assumed to pass through each point.
    """
    a, b = (unit_vectors(points - device.origin) for device in sensor.devices)
    if sensor.phase == "both":
        return nearest_point(offset, a, second_offset, b)[0]
    return on_plane(offset, a, second_offset, phase_planes(sensor.second, b, sensor.phase))


def first_order_size(
    points: FloatArray, normals: FloatArray, error: FloatArray, weights: FloatArray
) -> float:
    """Error, mm, of the diameter of the best-fit cylinder or sphere through points, to first order.

    Small errors (n, 3), mm, move, turn and widen the Gaussian best fit. The seven motions follow
    from least squares with weights (n,). Motions that no outward normal determines, such as that
    of a cylinder along its axis, are left at 0.
    """
    arm = points - np.average(points, axis=0, weights=weights)
    motions = np.column_stack((np.ones(len(points)), normals, np.cross(arm, normals)))
    along = np.einsum("ij,ij->i", error, normals)
    root = np.sqrt(weights)
    found, *_ = np.linalg.lstsq(motions * root[:, None], along * root, rcond=1e-6)
    return 2.0 * float(found[0])
