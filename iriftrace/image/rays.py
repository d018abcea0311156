"""The rays of one pose that count, extracted from its AOV image in double precision.

Arrays are stored by component, (3, n) and not (n, 3): NumPy processes long rows several times
faster than many short ones.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import FloatArray, IntArray, as_float64
from iriftrace.core.errors import InputError
from iriftrace.image.aov_image import AovImage
from iriftrace.image.displacement import good_mask


@frozen(eq=False)
class PoseRays:
    """Hits of the n rays of one pose that count, in the order of their pixels."""

    pixels: IntArray  # (n,) row-major numbers, rising
    face: IntArray  # (n,) faces under the straight hits
    position: FloatArray  # (3, n) straight hits, mm, camera frame
    distance: FloatArray  # (n,) length of the straight rays, mm
    incidence: FloatArray  # (n,) angles of incidence, rad


def rays_that_count(image: AovImage, include: Collection[int]) -> PoseRays:
    """Extract the rays with some status codes from an image.

    Raises InputError if `include` names rays without a displacement, or a ray has no face.
    """
    pixels = np.flatnonzero(good_mask(image, include))
    face = np.rint(image.channels["part.face"].ravel()[pixels]).astype(np.int64) - 1
    lost = int(np.count_nonzero(face < 0))
    if lost:
        raise InputError(
            f"{lost} good rays have no face in the channel part.face, so the "
            "image is damaged; render it again.",
            code="picture.no_face",
        )
    camera = image.camera
    offset = _components(image, "straight", pixels)
    offset -= camera.origin[:, None]
    position = _product(camera.matrix[:3, :3].T, offset)
    parallel = camera.projection == "orthographic"
    return PoseRays(
        pixels=pixels,
        face=face,
        position=position,
        distance=position[2] if parallel else _length(position),
        incidence=_channel(image, "incidence.angle", pixels),
    )


def bending(image: AovImage, rays: PoseRays) -> dict[str, FloatArray]:
    """Lengths of n rays' displacements, of their components at the line of sight, and of shifts.

    Arrays (n,) with the keys of the metrics: ``displacement_mm``, across and along the line of
    sight ``displacement_lateral_mm`` and ``displacement_axial_mm``, and ``shift_px``.
    """
    camera = image.camera
    vector = _product(camera.matrix[:3, :3].T, _components(image, "displacement", rays.pixels))
    if camera.projection == "orthographic":
        along, across = vector[2], vector[:2]
    else:
        sight = rays.position / rays.distance
        along = _sum_of_products(vector, sight)
        sight *= along
        vector -= sight
        across = vector
    return {
        "displacement_mm": _channel(image, "displacement.norm", rays.pixels),
        "displacement_lateral_mm": _length(across),
        "displacement_axial_mm": np.abs(along),
        "shift_px": _length(_components(image, "shift.px", rays.pixels)),
    }


def _channel(image: AovImage, name: str, pixels: IntArray) -> FloatArray:
    return image.channels[name].ravel()[pixels].astype(np.float64)


def _components(image: AovImage, name: str, pixels: IntArray) -> FloatArray:
    axes = [f"{name}.{axis}" for axis in "XYZ" if f"{name}.{axis}" in image.channels]
    vectors = np.empty((len(axes), len(pixels)))
    for row, axis in zip(vectors, axes, strict=True):
        row[:] = image.channels[axis].ravel()[pixels]
    return vectors


def _product(matrix: FloatArray, vectors: FloatArray) -> FloatArray:
    # Not by BLAS, whose threads wait for cores that the tracer's own threads still hold.
    return as_float64(np.einsum("ij,jn->in", matrix, vectors))


def _sum_of_products(first: FloatArray, second: FloatArray) -> FloatArray:
    """(n,) array: scalar products of the columns."""
    total: FloatArray = first[0] * second[0]
    for one, other in zip(first[1:], second[1:], strict=True):
        total += one * other
    return total


def _length(vectors: FloatArray) -> FloatArray:
    return np.sqrt(_sum_of_products(vectors, vectors))
