"""Light of a scene's second device: uniform, fringes, or a laser's line."""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, log2
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError

if TYPE_CHECKING:
    from iriftrace.camera.camera import Camera

LightKind = Literal["uniform", "fringes", "laser"]
Lines = Literal["columns", "rows"]

Pattern = Callable[[FloatArray], FloatArray]
"""From places (m, 2), px, in the device's picture to brightness (m,), 0 to 1."""


@frozen
class Light:
    """Light of the scene's second device.

    Its lens lights a plane that faces it evenly.

    Parameters
    ----------
    kind
        Uniform light; fringes, of which a photograph is taken at each phase step; or a laser's
        line, Gaussian across the middle of the device's picture.
    irradiance
        Where it is brightest, on a surface that faces the device at the depth of the part's middle,
        W/(m^2 nm).
    lines
        Fringes and the laser's line run along the columns of the device's picture or its rows.
    period
        Of the fringes, px.
    steps
        Number of phase steps, 3 or more.
    gray
        Then also take a photograph of each bit of the fringes' numbers, Gray-coded.
    line_radius
        Of the laser's line, where its irradiance is 1/e^2 of that in the middle, px.
    """

    kind: LightKind = "uniform"
    irradiance: float = 5.0
    lines: Lines = "columns"
    period: float = 16.0
    steps: int = 4
    gray: bool = False
    line_radius: float = 2.0

    def __attrs_post_init__(self) -> None:
        for name, choices in (("kind", LightKind), ("lines", Lines)):
            value, known = getattr(self, name), get_args(choices)
            if value not in known:
                raise InputError(
                    f"The {name} of light {value!r} is not known; use one of {', '.join(known)}.",
                    code="photo.unknown_light",
                    argument=name,
                )
        if self.steps < 3 or min(self.period, self.line_radius, self.irradiance) <= 0.0:
            raise InputError(
                f"Light of {self.irradiance:g} W/(m^2 nm) with {self.steps} steps of fringes of "
                f"{self.period:g} px, or a line of {self.line_radius:g} px, cannot be "
                "photographed; give at least 3 steps, and positive lengths and irradiance.",
                code="photo.light",
            )

    def patterns(self, device: Camera) -> dict[str, Pattern]:
        """The pattern of each photograph, by its name; "" where there is only one."""
        axis = 0 if self.lines == "columns" else 1
        size, period = device.resolution[axis], self.period

        def shifted(step: int) -> Pattern:
            # Fringes begin at the first pixel's outer edge.
            turns = 0.5 / period - step / self.steps
            return lambda places: (
                0.5 + 0.5 * np.cos(2.0 * np.pi * (places[:, axis] / period + turns))
            )

        def bit(number: int) -> Pattern:
            def value(places: FloatArray) -> FloatArray:
                fringe = np.floor((places[:, axis] + 0.5) / period).astype(np.int64)
                return ((fringe ^ fringe >> 1) >> number & 1).astype(np.float64)

            return value

        if self.kind == "uniform":
            return {"": lambda places: np.ones(len(places))}
        if self.kind == "laser":
            middle, radius = 0.5 * (size - 1), self.line_radius
            return {"": lambda places: np.exp(-2.0 * ((places[:, axis] - middle) / radius) ** 2)}
        found = {f"step_{step}": shifted(step) for step in range(self.steps)}
        bits = ceil(log2(max(size / period, 2.0))) if self.gray else 0
        return found | {f"gray_{n}": bit(n) for n in reversed(range(bits))}
