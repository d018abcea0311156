"""Points of a hot part carried back onto its drawing.

A size at the temperature of the drawing is fitted to the points where they lie on the drawing. Each
point keeps its place in its triangle and its distance from the surface, which is divided by the
triangle's stretch.
"""

from __future__ import annotations

import math

import numpy as np

from iriftrace.core.arrays import AnyIntArray, FloatArray
from iriftrace.core.blocks import blocks
from iriftrace.core.errors import InputError
from iriftrace.measuring.features.quantity import DRAWING
from iriftrace.measuring.uncertainty.inputs import Inputs
from iriftrace.part.growth import Growth
from iriftrace.part.part import Part


def check_growth(inputs: Inputs, growth: Growth | None) -> None:
    """Raise InputError for stated uncertainties of a growth that the part does not have."""
    stated = [name for name in ("expansion", "part") if name in inputs.stated()]
    if growth is None and stated:
        raise InputError(
            f"The uncertainty of {' and '.join(stated)} is stated, but the scene does not state "
            "how much its part has grown, so sizes are those of the hot part and do not depend on "
            "it; make the scene with the part's expansion and hot temperature, or leave it out.",
            code="uncertainty.of_no_growth",
            argument="uncertainty",
        )


def u_of_growth(
    inputs: Inputs, growth: Growth, hot: float, drawn: float, angle: bool
) -> float | None:
    """Standard uncertainty of a value on the drawing by the growth, in its unit; None if not known.

    To first order: the expansion scales the difference between the `hot` value and the `drawn`
    one, and a temperature changes all lengths by the same fraction, but no angle. Both are
    independent.
    """
    if inputs.expansion is None or inputs.part_temperature_k is None:
        return None
    by_temperature = 0.0 if angle else growth.expansion * inputs.part_temperature_k * drawn
    return math.hypot((hot - drawn) * inputs.expansion, by_temperature) / growth.factor


def drawing_cloud(points: FloatArray, face: AnyIntArray, part: Part) -> dict[str, FloatArray]:
    """The cloud `DRAWING` of points of a hot part; no cloud if it has not grown.

    Parameters
    ----------
    points : (n, 3) array, mm, world
        Points near the hot part.
    face : (n,) array of int
        Face of the part that each belongs to.
    part : Part
    """
    if part.growth is None:
        return {}
    if part.drawing is None:
        return {DRAWING: points / part.growth.factor}
    hot, drawn = part.vertices[part.faces], part.drawing[part.faces]
    stretch = _perimeters(hot) / _perimeters(drawn)
    found = np.empty(points.shape)
    for rows in blocks(len(points)):
        block, on = points[rows], face[rows]
        places = _barycentric(block, hot[on])
        foot, drawn_foot = (np.einsum("ij,ijk->ik", places, mesh[on]) for mesh in (hot, drawn))
        found[rows] = drawn_foot + (block - foot) / stretch[on, None]
    return {DRAWING: found}


def _barycentric(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Barycentric places (n, 3) in triangles (n, 3, 3) near points (n, 3); none is negative.

    Extrapolated beyond slivers, the rounding of their corners would become millimetres.
    """
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    arm = points - corners[:, 0]
    normal = np.cross(first, second)
    square = np.maximum(np.einsum("ij,ij->i", normal, normal), np.finfo(np.float64).tiny)
    b = np.einsum("ij,ij->i", np.cross(arm, second), normal) / square
    c = np.einsum("ij,ij->i", np.cross(first, arm), normal) / square
    places = np.clip(np.column_stack((1.0 - b - c, b, c)), 0.0, 1.0)
    return np.asarray(places / places.sum(axis=1, keepdims=True))


def _perimeters(corners: FloatArray) -> FloatArray:
    """Perimeters (m,) of triangles (m, 3, 3)."""
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    return np.asarray(sides.sum(axis=1))
