"""How much each metric counts when poses are ranked."""

from __future__ import annotations

import math

from attrs import asdict, frozen

from iriftrace.errors import InputError


@frozen
class Weights:
    """How much each metric counts in the score; as given, not scaled to a sum of 1.

    Raises
    ------
    InputError
        If a weight is negative or not finite, or all are zero.
    """

    displacement: float = 0.5
    coverage: float = 0.2
    axial: float = 0.15
    lateral: float = 0.15

    def __attrs_post_init__(self) -> None:
        given = asdict(self)
        wrong = {name: w for name, w in given.items() if not (math.isfinite(w) and w >= 0)}
        if wrong:
            name, weight = next(iter(wrong.items()))
            raise InputError(
                f"The weight of {name} is {weight}, which would make its bad values good; "
                "give zero or a positive number."
            )
        if sum(given.values()) <= 0:
            raise InputError(
                "All weights are zero, so every pose would be equally good; "
                "make at least one positive."
            )

    def as_dict(self) -> dict[str, float]:
        """Name of each metric and its weight."""
        return {name: float(weight) for name, weight in asdict(self).items()}
