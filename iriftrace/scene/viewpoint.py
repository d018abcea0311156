"""Places for cameras: outside the part and the hot air."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from iriftrace.core.errors import InputError
from iriftrace.core.units import ZERO_CELSIUS_K
from iriftrace.geometry.query import Surface
from iriftrace.geometry.topology import open_edges

if TYPE_CHECKING:
    from iriftrace.field.index_field import IndexField
    from iriftrace.part.part import Part
    from iriftrace.shells.stack import Shell, ShellStack


DIAGONAL = np.array((0.62, -0.42, 0.66))
"""From the part to a camera diagonally above it."""


def is_in_hot_air(
    points: ArrayLike, field: IndexField, hottest_allowed: float
) -> NDArray[np.bool_]:
    """Mask of points that lie in air thinner than a refractivity.

    Parameters
    ----------
    points : (n, 3) array, mm, world
    field : IndexField
    hottest_allowed : float
        n - 1 below which air counts as hot; outside the data the air is ambient.

    Returns
    -------
    (n,) array of bool
    """
    refractivity = field.sample(np.asarray(points, dtype=np.float64))
    return np.asarray(np.nan_to_num(refractivity, nan=np.inf) < hottest_allowed)


def default_viewpoint(
    part: Part, field: IndexField | None, stack: ShellStack, nearest_mm: float = 0.0
) -> NDArray[np.float64]:
    """A position diagonally above the part, outside the hot air.

    Parameters
    ----------
    part : Part
    field : IndexField, optional
        Without it, the hot air is the box around the shells.
    stack : ShellStack
    nearest_mm : float, mm
        Distance that the whole part keeps from the camera.

    Returns
    -------
    (3,) array, mm, world
    """
    direction = DIAGONAL / np.linalg.norm(DIAGONAL)
    diagonal = float(np.linalg.norm(np.ptp(part.bounds, axis=0)))
    first = max(diagonal, nearest_mm + 0.5 * diagonal)
    points = part.centre + np.linspace(first, first + 5.0 * diagonal, 101)[:, None] * direction
    if field is None:
        low, high = _box(stack)
        cold = np.any((points < low) | (points > high), axis=1)
    else:
        ambient, hottest = field.ambient_refractivity, field.hottest_refractivity
        cold = ~is_in_hot_air(points, field, ambient - 0.02 * (ambient - hottest))
    return np.asarray(points[int(np.argmax(cold))])


def refuse_camera_inside(
    origin: ArrayLike, part: Part, stack: ShellStack, field: IndexField | None
) -> None:
    """Refuse a camera that stands in the part or inside the outermost shell.

    Parameters
    ----------
    origin : (3,) array, mm, world
    part : Part
    stack : ShellStack
    field : IndexField, optional
        Without it, the closed shells are asked.

    Raises
    ------
    InputError
    """
    point = np.asarray(origin, dtype=np.float64).reshape(1, 3)
    place = f"The camera at {np.round(point[0], 1).tolist()} mm stands"
    if part.closed and part.surface.inside(point)[0]:
        raise InputError(f"{place} in the part, where there is nothing to see; move it outside.")
    if field is None:
        layers = [s.layer for s in stack.shells if _encloses(s, point)]
        if layers:
            raise InputError(
                f"{place} inside shell {max(layers)}, in the hot air, where the bending along its "
                "rays is not known; move it outside the outermost shell."
            )
        return
    outermost = max(shell.refractivity for shell in stack.shells)
    if is_in_hot_air(point, field, outermost)[0]:
        temperature = float(field.air.temperature(field.sample(point))[0]) - ZERO_CELSIUS_K
        raise InputError(
            f"{place} in the hot air (about {temperature:.0f} degC), where the bending along its "
            "rays is not known; move it outside the outermost shell."
        )


def _encloses(shell: Shell, point: NDArray[np.float64]) -> bool:
    closed = len(open_edges(shell.faces)) == 0
    return closed and bool(Surface(shell.vertices, shell.faces).inside(point)[0])


def _box(stack: ShellStack) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest and highest corner of the box around all shells, mm."""
    low = np.min([shell.vertices.min(axis=0) for shell in stack.shells], axis=0)
    high = np.max([shell.vertices.max(axis=0) for shell in stack.shells], axis=0)
    return low.astype(np.float64), high.astype(np.float64)
