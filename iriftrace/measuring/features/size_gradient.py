"""Derivative of a fitted diameter by the points of the fit."""

from __future__ import annotations

import numpy as np

from iriftrace.core.arrays import FloatArray, as_float64
from iriftrace.core.errors import InputError
from iriftrace.core.mesh.triangles import row_lengths, unit_vectors
from iriftrace.measuring.features.feature import Feature


def size_gradient(feature: Feature, points: FloatArray) -> FloatArray:
    r"""Derivative (n, 3) of the diameter of a feature by the points (n, 3), mm, fitted with it.

    The distance :math:`r_i` of a point from the feature grows with its own motion along the unit
    normal :math:`n_i` and falls by J dp with the feature's parameters p (place, axis, diameter,
    cone angle). By the implicit function theorem for the minimum of :math:`\sum r_i^2`,
    :math:`dp = J^+ (n_i \cdot dx_i)`. The products of residuals and second derivatives are
    neglected; they change it by residuals over radius, 1e-4 and less. The diameter of a cone is
    that at the feature's position, as `Feature.at` has it.

    Raises
    ------
    InputError
        For a feature without a diameter.
    """
    if feature.size_mm is None:
        raise InputError(
            f"A {feature.kind} has no diameter, of which a derivative is computed; choose a "
            "cylinder, cone, sphere or circle.",
            code="feature.no_diameter",
            argument="feature",
        )
    arm = points - feature.position
    if feature.direction is None:
        outward = unit_vectors(arm)
        columns = [*outward.T]
    else:
        axis, angle = feature.direction, feature.half_angle or 0.0
        height = arm @ axis
        across = arm - np.outer(height, axis)
        outward = np.cos(angle) * unit_vectors(across) - np.sin(angle) * axis
        sides = np.linalg.svd(axis[None])[2][1:]
        columns = [*(outward @ sides.T).T]
        if feature.kind != "circle":  # whose points lie in a plane and do not turn it
            columns += [*(np.cross(arm, outward) @ sides.T).T]
        if feature.half_angle is not None:
            beyond = row_lengths(across) - 0.5 * feature.size_mm
            columns.append(beyond * np.sin(angle) + height * np.cos(angle))
    radius = np.full(len(points), np.cos(feature.half_angle or 0.0))
    inverse = np.linalg.pinv(np.column_stack((radius, *columns)))
    return as_float64(2.0 * inverse[0][:, None] * outward)
