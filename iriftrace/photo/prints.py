"""Prints on a surface: dots, a checkerboard or a bitmap, as the fraction of ink at a place.

Places (n, 2), mm, are in the print's own frame, x to the right, y up, the origin in its middle.
Edges are blurred over widths (n, 2), mm, across and up: the footprint of a sample of the picture.
"""

from __future__ import annotations

import re
from functools import cached_property
from pathlib import Path
from typing import Protocol, Self

import numpy as np
from attrs import field, frozen
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

from iriftrace.core.arrays import FloatArray, as_float64
from iriftrace.core.errors import InputError
from iriftrace.core.files import text_in
from iriftrace.io.refusals import check_exists, damaged
from iriftrace.part.board import COLUMNS, Board


class Print(Protocol):
    """What is printed on a surface."""

    def ink(self, places: FloatArray, blur: FloatArray) -> FloatArray:
        """Fraction of ink (n,), 0 to 1, at places (n, 2), mm, blurred over widths (n, 2), mm."""


@frozen(eq=False)
class Dots:
    """Dots of ink.

    Attributes
    ----------
    centres : (n, 2) array, mm
    diameters : (n,) array, mm
    """

    centres: FloatArray = field(converter=as_float64)
    diameters: FloatArray = field(converter=as_float64)

    @classmethod
    def of_board(cls, board: Board) -> Self:
        """The dots of a board, whose frame has its middle dot at the origin."""
        return cls(board.centres[:, :2], board.diameters)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.centres)

    def ink(self, places: FloatArray, blur: FloatArray) -> FloatArray:
        """Fraction of ink; see `Print`."""
        blur = blur.mean(axis=1)
        reach = 0.5 * self.diameters.max() + blur.max(initial=0.0)
        distance, dot = self._tree.query(places, distance_upper_bound=reach)
        # No dot is near where the distance is infinite.
        radius = 0.5 * np.append(self.diameters, 0.0)[dot]
        return as_float64(_covered(radius - distance, blur))


@frozen
class Checkerboard:
    """Squares in columns and rows, the first one at the upper left of ink, on white."""

    squares: tuple[int, int] = (10, 7)  # columns and rows
    square_mm: float = 10.0

    def __attrs_post_init__(self) -> None:
        if min(self.squares) < 1 or not self.square_mm > 0.0:
            raise InputError(
                f"A checkerboard of {self.squares[0]} x {self.squares[1]} squares of "
                f"{self.square_mm:g} mm cannot be printed; give at least one square, and a "
                "positive size.",
                code="photo.checkerboard",
            )

    def ink(self, places: FloatArray, blur: FloatArray) -> FloatArray:
        """Fraction of ink; see `Print`."""
        colour, inside = np.ones(len(places)), np.ones(len(places))
        axes = zip((places * (1.0, -1.0)).T, blur.T, self.squares, strict=True)
        for place, width, count in axes:
            along = place / self.square_mm + 0.5 * count
            # Distance to the next line between squares: positive in the first, third ... square.
            within = np.clip(along, 0.5, count - 0.5)
            edge = 0.5 - np.abs((within + 0.5) % 2.0 - 1.0)
            colour *= np.clip(2.0 * edge * self.square_mm / width, -1.0, 1.0)
            inside *= _covered((0.5 * count - np.abs(along - 0.5 * count)) * self.square_mm, width)
        return 0.5 * (1.0 + colour) * inside


@frozen(eq=False)
class Bitmap:
    """A picture, 0 black to 1 white, bilinear between its pixels and white around it.

    Attributes
    ----------
    white : (h, w) array
        Its first row is at the top.
    width_mm : float
        Of the whole picture; pixels are square.
    """

    white: FloatArray = field(converter=as_float64)
    width_mm: float

    def ink(self, places: FloatArray, blur: FloatArray) -> FloatArray:
        """Fraction of ink; see `Print`. Pixels much smaller than the blur are not averaged."""
        height, width = self.white.shape
        column, row = (places * (1.0, -1.0)).T * width / self.width_mm
        at = np.stack((row + 0.5 * (height - 1), column + 0.5 * (width - 1)))
        return 1.0 - as_float64(map_coordinates(self.white, at, order=1, cval=1.0))


def read_print(text: str, width_mm: float | None = None) -> Print:
    """Read the dots of ``iriftrace part board`` (.csv) or a picture, or understand ``"10x7"``.

    The latter are the columns and rows of a checkerboard. It and a picture need their width, mm.

    Raises InputError for anything else.
    """
    path = Path(text)
    if path.suffix.lower() == ".csv":
        check_exists(path, "give the table that `iriftrace part board` wrote")
        try:
            lines = filter(str.strip, text_in(path).splitlines()[1:])
            table = np.array([line.split(",")[2:5] for line in lines], dtype=np.float64)
            if not (
                table.shape[1:] == (3,) and np.isfinite(table).all() and (table[:, 2] > 0.0).all()
            ):
                raise ValueError("it has no dots, or some without place or diameter")
        except (ValueError, OverflowError) as error:
            raise damaged(path, error, f"its columns are {', '.join(COLUMNS)}") from error
        return Dots(table[:, :2], table[:, 2])
    if width_mm is None or not width_mm > 0.0:
        raise InputError(
            f"The width of the print {text} is not known; give it in mm.",
            code="photo.print_width",
            argument="print_width",
        )
    squares = re.fullmatch(r"(\d+)x(\d+)", text)
    if squares:
        columns, rows = map(int, squares.groups())
        return Checkerboard((columns, rows), width_mm / max(columns, 1))
    check_exists(path, "give a table of dots, a picture, or the squares of a checkerboard, 10x7")
    from PIL import Image

    try:
        with Image.open(path) as picture:
            values = np.asarray(picture if picture.mode.startswith("I") else picture.convert("L"))
    except Exception as error:  # Pillow lets any through
        raise damaged(path, error, "give a .png or .tiff") from error
    return Bitmap(values / np.iinfo(values.dtype).max, width_mm)


def _covered(inside: FloatArray, blur: FloatArray) -> FloatArray:
    """Fraction of a sample on the near side of an edge, from its distance (n,), mm, from there."""
    return np.clip(0.5 + inside / blur, 0.0, 1.0)
