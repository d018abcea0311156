"""Names of the engines that bend rays, and of the places where rays are bent."""

from __future__ import annotations

from enum import StrEnum
from typing import Literal

Engine = Literal["auto", "shells", "cells"]

AUTO: Engine = "auto"
"""The scene file's engine, and the cells engine if its shells are too coarse."""

ENGINES = {
    "shells": "nested shells of equal refractive index",
    "cells": "ray equation through the field's own cells, order 4",
}
"""Engines that can be requested, with their descriptions."""


def may_use_field(engine: str) -> bool:
    """True if a requested engine bends rays by the field's own cells, or may come to do so."""
    return engine != "shells"


class Bending(StrEnum):
    """Where rays are bent; the value stands in headers and files."""

    LAYERS = "layers"
    SHELLS = "shells"
    SHELLS_WITHOUT_DERIVATIVES = "shells without derivatives"
    CELLS = "cells"

    @property
    def text(self) -> str:
        """Half a sentence."""
        return {
            Bending.LAYERS: "all along the layers",
            Bending.SHELLS: "at the shells alone",
            Bending.SHELLS_WITHOUT_DERIVATIVES: (
                "at the shells alone, as their files do not have the index's derivatives"
            ),
            Bending.CELLS: "continuously",
        }[self]

    @property
    def at_shells_alone(self) -> bool:
        """Whether rays run straight between shells."""
        return self in (Bending.SHELLS, Bending.SHELLS_WITHOUT_DERIVATIVES)
