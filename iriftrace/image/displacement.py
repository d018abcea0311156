"""Displacement on the part and shift in the picture of every pixel, by hot air."""

from __future__ import annotations

from collections.abc import Collection
from typing import Literal

import numpy as np
from attrs import frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import BoolArray, FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.mesh.triangles import row_lengths, unit_vectors
from iriftrace.image.aov_image import AovImage, Status

USABLE = (Status.GOOD, Status.INDEX_MISMATCH)
"""Codes of the rays that have a displacement: both the straight and the refracted ray hit."""


@frozen(eq=False)
class DisplacementMap:
    """Displacement of every pixel, (height, width) arrays; 0 where it is not good."""

    norm: FloatArray  # distance between the straight and the refracted hit, mm
    lateral: FloatArray  # its part across the straight line of sight, mm, not negative
    # Its part along that line, mm; positive when the refracted hit lies farther from the camera.
    axial: FloatArray
    good: BoolArray  # True if the pixel's ray counts


@frozen(eq=False)
class ShiftMap:
    """Shift of every pixel's picture: `pixels` (height, width, 2), px, x right and y down.

    Row i, column j belongs to the pixel with its centre at (j, i). `good` is True where
    the pixel's ray counts; the shift is 0 where it does not.
    """

    pixels: FloatArray
    good: BoolArray


def good_mask(image: AovImage, include: Collection[int] = (Status.GOOD,)) -> BoolArray:
    """(height, width) bool: rays whose status is one of `include`.

    Raises InputError if that names a status whose rays do not have both hits, or names none.
    """
    unusable = sorted(set(include) - set(USABLE))
    if unusable or not include:
        raise InputError(
            f"rays of status {', '.join(map(str, unusable)) or 'none'} have no displacement; "
            f"only {' and '.join(str(int(code)) for code in USABLE)} can be included.",
            code="picture.no_displacement",
            argument="include",
        )
    status = image.channels["status.code"]
    good = np.zeros(status.shape, dtype=np.bool_)
    for code in include:
        good |= status == int(code)
    if Status.INDEX_MISMATCH in include:
        # Such rays may also miss the part.
        hit = (image.channels["part.face"] > 0) & (image.channels["path.length"] > 0)
        good &= hit | (status != Status.INDEX_MISMATCH)
    return good


def directions_to(camera: Camera, hits: FloatArray) -> FloatArray:
    """(n, 3) unit vectors, world, from the camera to n hits ((n, 3) array, mm, world)."""
    if camera.projection == "orthographic":
        return np.broadcast_to(camera.forward, hits.shape)
    return unit_vectors(hits - camera.origin)


def split_displacement(vectors: FloatArray, sight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Length of displacements across lines of sight, and signed length along them, (n,), mm.

    Displacements are (n, 3), mm, lines of sight (n, 3) unit vectors.
    """
    axial = np.einsum("ij,ij->i", vectors, sight)
    across = vectors - axial[:, None] * sight
    return row_lengths(across), axial


Component = Literal["norm", "along", "right", "down"]

NORM: Component = "norm"
"""The length of a displacement; the others are `signed_components`."""


def signed_components(
    vectors: FloatArray, sight: FloatArray, right: FloatArray
) -> dict[str, FloatArray]:
    """Signed components (n,), mm, of displacements at the lines of sight.

    ``along`` the line of sight, positive away from the camera; across it ``right`` and ``down`` in
    the picture. Displacements are (n, 3), mm, lines of sight (n, 3) unit vectors; `right` (3,) are
    the picture's rows, `Camera.matrix`'s first column.
    """
    rows = unit_vectors(right - (sight @ right)[:, None] * sight)
    axes = {"along": sight, "right": rows, "down": np.cross(sight, rows)}
    return {name: np.einsum("ij,ij->i", vectors, axis) for name, axis in axes.items()}


def displacement_map(image: AovImage, include: Collection[int] = (Status.GOOD,)) -> DisplacementMap:
    """Displacement of every pixel, as a whole and split at the line of sight, for use in Python.

    Parameters
    ----------
    image
        AOV image of one pose.
    include
        Codes of the rays that count; 0 and 5 are possible.

    Raises
    ------
    InputError
        `include` names rays without a displacement.
    """
    good = good_mask(image, include)
    sight = directions_to(image.camera, image.vector("straight", good))
    norm, lateral, axial = (np.zeros(good.shape, dtype=np.float64) for _ in range(3))
    norm[good] = image.channels["displacement.norm"][good]
    lateral[good], axial[good] = split_displacement(image.vector("displacement", good), sight)
    return DisplacementMap(norm, lateral, axial, good)


def shift_map(image: AovImage, include: Collection[int] = (Status.GOOD,)) -> ShiftMap:
    """Shift of every pixel: the position of its surface point with hot air minus that without.

    Parameters
    ----------
    image, include
        As for `displacement_map`.

    Raises
    ------
    InputError
        `include` names rays without a displacement.
    """
    good = good_mask(image, include)
    return ShiftMap(np.where(good[..., None], image.vector("shift.px"), 0.0), good)
