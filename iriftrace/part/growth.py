"""Thermal growth: a part that was drawn at one temperature and is measured at another."""

from __future__ import annotations

import re

import numpy as np
from attrs import frozen

from iriftrace.core.errors import InputError
from iriftrace.core.units import PLAUSIBLE_K

_COMMENT = re.compile(r"comment\s+thermal expansion (\S+) /K from (\S+) K to (\S+) K\s*")


@frozen
class Growth:
    """Linear thermal expansion, 1/K, from the temperature of the drawing to that of the part, K."""

    expansion: float
    reference_k: float
    hot_k: float

    def __attrs_post_init__(self) -> None:
        values = (self.expansion, self.reference_k, self.hot_k)
        if not (np.isfinite(values).all() and abs(self.expansion) < 1e-3):
            raise InputError(
                f"thermal expansion of {self.expansion:g} per kelvin from {self.reference_k:g} K "
                f"to {self.hot_k:g} K is not that of a solid; steel has about 14e-6/K.",
                code="part.unlikely_expansion",
                argument="expansion",
            )
        if min(self.reference_k, self.hot_k) < PLAUSIBLE_K[0]:
            raise InputError(
                f"thermal expansion from {self.reference_k:g} K to {self.hot_k:g} K is that of a "
                'part colder than any here; give both temperatures with their unit, "20 degC".',
                code="part.too_cold",
            )

    @property
    def factor(self) -> float:
        """Length at the hot temperature over that at the reference temperature."""
        return 1.0 + self.expansion * (self.hot_k - self.reference_k)

    def comment(self) -> str:
        """A line for the header of a mesh file, which `of_header` reads."""
        return (
            f"thermal expansion {self.expansion!r} /K from {self.reference_k!r} K to "
            f"{self.hot_k!r} K"
        )

    @classmethod
    def of_header(cls, lines: list[str]) -> Growth | None:
        """The growth stated in a header; None if missing or not numeric."""
        for match in filter(None, map(_COMMENT.fullmatch, lines)):
            try:
                return cls(*(float(word) for word in match.groups()))
            except ValueError:
                return None
        return None
