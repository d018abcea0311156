"""A flat board of printed dots, which is seen through hot air next to a part."""

from __future__ import annotations

from math import floor
from pathlib import Path

import numpy as np
from attrs import evolve, field, frozen

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.core.files import write_whole
from iriftrace.part.part import Part
from iriftrace.part.sizes import BOARD_SIZE, BOARD_THICKNESS, PITCH
from iriftrace.part.standards import check_less, check_positive, plate

STRIP_MM = 12.0
"""Width of the strips along the lower and the left edge that hold the scale bars."""

LARGE = ((0, 0), (2, 0), (0, 1))
"""Columns and rows, from the middle, of the dots that are larger and tell right from up."""

LARGER = 1.5
"""Diameter of those over that of the others."""

MOST_DOTS = 100_000
COLUMNS = ("column", "row", "x_mm", "y_mm", "diameter_mm")


@frozen(eq=False)
class Board:
    """A board of dots in rows and columns.

    Its frame has x to the right, y up and z towards the viewer; the dots lie on z = 0 and one of
    them at the origin, the middle of the board.

    Attributes
    ----------
    size_mm : (2,) tuple
        Width and height.
    pitch_mm : float
        Between the centres of neighbouring dots.
    dot_mm : float
        Diameter of a dot; by default half the pitch.
    thickness_mm : float
        Of the board, behind the dots.

    Raises
    ------
    InputError
        A length is not positive, dots overlap, or they are fewer than nine or more than
        `MOST_DOTS`.
    """

    size_mm: tuple[float, float] = BOARD_SIZE
    pitch_mm: float = PITCH
    dot_mm: float = field()
    thickness_mm: float = BOARD_THICKNESS

    @dot_mm.default
    def _half_the_pitch(self) -> float:
        return 0.5 * self.pitch_mm

    def __attrs_post_init__(self) -> None:
        width, height = self.size_mm
        check_positive(
            "board",
            width=width,
            height=height,
            pitch=self.pitch_mm,
            dot=self.dot_mm,
            thickness=self.thickness_mm,
        )
        larger = "dots that are marked by their size touch their neighbours"
        check_less("board", ("dot", self.dot_mm), ("pitch", self.pitch_mm / LARGER), larger)
        across, down = self._halves
        if min(across, down) < 1 or (2 * across + 1) * (2 * down + 1) > MOST_DOTS:
            raise InputError(
                f"A board of {width:g} x {height:g} mm has {2 * max(across, 0) + 1:,} x "
                f"{2 * max(down, 0) + 1:,} dots at a pitch of {self.pitch_mm:g} mm, and 3 x 3 to "
                f"{MOST_DOTS:,} can be used; change size or pitch.",
                code="board.dot_count",
            )

    @property
    def _halves(self) -> tuple[int, int]:
        """Dots on each side of the middle one, across and up; both strips are kept free."""
        room = (0.5 * length - STRIP_MM - 0.5 * LARGER * self.dot_mm for length in self.size_mm)
        across, up = (floor(max(length, -1.0) / self.pitch_mm + 1e-9) for length in room)
        return across, up

    @property
    def places(self) -> IntArray:
        """(n, 2) array: column and row of each dot from the middle, row by row from the top."""
        across, up = self._halves
        row, column = np.mgrid[up : -up - 1 : -1, -across : across + 1]
        return np.column_stack((column.ravel(), row.ravel()))

    @property
    def centres(self) -> FloatArray:
        """(n, 3) array, mm, board's frame: centres of the dots, in the order of `places`."""
        flat = self.pitch_mm * self.places
        return np.column_stack((flat, np.zeros(len(flat))))

    @property
    def diameters(self) -> FloatArray:
        """(n,) array, mm."""
        marked = (self.places[:, None] == np.array(LARGE)).all(axis=2).any(axis=1)
        return np.where(marked, LARGER * self.dot_mm, self.dot_mm)

    @property
    def part(self) -> Part:
        """The board as a part: region ``plane +z`` has the dots, ``rest`` is the rest."""
        width, height = self.size_mm
        return evolve(plate(width, height, self.thickness_mm, cells=1), path="board")

    def save_centres(self, path: str | Path) -> Path:
        """Write the dots' centres, mm in the board's frame, as CSV with the columns `COLUMNS`."""
        rows = zip(self.places.tolist(), self.centres.tolist(), self.diameters, strict=True)
        lines = [
            f"{column},{row},{x:.6g},{y:.6g},{diameter:.6g}"
            for (column, row), (x, y, _), diameter in rows
        ]
        write_whole(path, "\n".join([",".join(COLUMNS), *lines, ""]))
        return Path(path)
