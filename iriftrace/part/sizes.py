"""Sizes of standard parts and of the board of dots where none are given, mm."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Self

from iriftrace.core.errors import InputError
from iriftrace.core.units import Length

CYLINDER_DIAMETER, CYLINDER_LENGTH = Length(27.0), Length(170.0)
CYLINDER_SEGMENTS, CYLINDER_STATIONS = 60, 12

SPHERE_DIAMETER, SPHERE_SEGMENTS = Length(25.0), 240
SPACING = Length(100.0)
"""Distance between the centres of a ball bar's spheres."""

PLATE_LENGTH, PLATE_WIDTH, PLATE_THICKNESS = Length(100.0), Length(60.0), Length(10.0)
PLATE_CELLS = 40

PITCH, BOARD_THICKNESS = Length(3.0), Length(5.0)


class BoardSize(tuple[Length, Length]):
    """Width and height of a board, mm; in a text "300x200"."""

    def __new__(cls, value: str | Iterable[float]) -> Self:
        pieces = re.split(r"\s*[x,]\s*", value.strip()) if isinstance(value, str) else value
        size = super().__new__(cls, map(Length, pieces))
        if len(size) != 2:
            raise InputError(
                f'"{value}" is not the size of a board; give width and height in mm, 300x200.',
                code="board.size",
                argument="size",
            )
        return size

    def __str__(self) -> str:
        return "x".join(f"{side:g}" for side in self)


BOARD_SIZE = BoardSize((300.0, 200.0))
