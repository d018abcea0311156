"""Signs of the components of measured shifts: axes that point the other way."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import warn

FAR_BETTER = 0.5
"""Other signs are taken for the right ones if they leave less than this fraction."""

_OTHERS = {
    (1.0, -1.0): ("dv", "v points down"),
    (-1.0, 1.0): ("du", "u points to the right"),
    (-1.0, -1.0): ("du and dv", "shifts are the hot position minus the cold one"),
}


def warn_of_signs(residual: Callable[[FloatArray], float], path: str) -> None:
    """Warn if measured shifts with other signs match the simulated ones far better.

    `residual` is the rms, px, that shifts leave whose components are multiplied by (2,) signs.
    """
    given = residual(np.ones(2))
    left = {signs: residual(np.array(signs)) for signs in _OTHERS}
    best = min(left, key=lambda signs: left[signs])
    if left[best] < FAR_BETTER * given:
        name, convention = _OTHERS[best]
        warn(
            f"With the other sign of {name}, the shifts of {path} leave {left[best]:.3g} px "
            f"instead of {given:.3g} px, so they seem to have other axes ({convention} here); if "
            f"so, turn the sign of {name} in the file."
        )
