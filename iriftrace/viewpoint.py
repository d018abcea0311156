"""Where a camera may stand: outside the part and the hot air."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from iriftrace.errors import InputError

if TYPE_CHECKING:
    from iriftrace.field import IndexField
    from iriftrace.part import Part
    from iriftrace.shell_stack import ShellStack

DIAGONAL = np.array((0.62, -0.42, 0.66))
"""From the part to a camera diagonally above it."""


def is_in_hot_air(
    points: ArrayLike, field: IndexField, hottest_allowed: float
) -> NDArray[np.bool_]:
    """Whether points lie in air thinner than a refractivity.

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


def default_viewpoint(part: Part, field: IndexField | None) -> NDArray[np.float64]:
    """A position diagonally above the part, outside the hot air.

    Parameters
    ----------
    part : Part
    field : IndexField, optional
        Without it the air is not asked.

    Returns
    -------
    (3,) array, mm, world
    """
    direction = DIAGONAL / np.linalg.norm(DIAGONAL)
    diagonal = float(np.linalg.norm(np.ptp(part.bounds, axis=0)))
    distances = np.linspace(1.0, 6.0, 101) * diagonal
    points = part.centre + distances[:, None] * direction
    if field is None:
        return np.asarray(points[0])
    ambient, hottest = field.ambient_refractivity, field.hottest_refractivity
    cold = ~is_in_hot_air(points, field, ambient - 0.02 * (ambient - hottest))
    return np.asarray(points[int(np.argmax(cold))])


def refuse_hot_camera(origin: ArrayLike, field: IndexField, stack: ShellStack) -> None:
    """Refuse a camera that stands inside the outermost shell.

    Raises
    ------
    InputError
        If the air at the camera is thinner than at the outermost shell.
    """
    outermost = max(shell.refractivity for shell in stack.shells)
    point = np.asarray(origin, dtype=np.float64).reshape(1, 3)
    if is_in_hot_air(point, field, outermost)[0]:
        temperature = float(field.air.temperature(field.sample(point))[0]) - 273.15
        raise InputError(
            f"The camera at {np.round(point[0], 1).tolist()} mm stands in the hot air (about "
            f"{temperature:.0f} degC), where the bending along its rays is not known; move it "
            "outside the outermost shell."
        )
