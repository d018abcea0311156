"""The printable page of a board of dots: vector graphics of exact size, with scale bars."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure

from iriftrace.core.files import whole_file
from iriftrace.part.board import STRIP_MM, Board

INCH_MM = 25.4
_BARS_MM = (1000.0, 500.0, 200.0, 100.0, 50.0, 20.0, 10.0)


def write_board(path: str | Path, board: Board) -> tuple[float, float]:
    """Draw a board as a PDF page of its size, for printing without scaling.

    Two scale bars, along the lower and the left edge, show whether the printer kept the size in
    both directions.

    Parameters
    ----------
    path : path
    board : Board

    Returns
    -------
    tuple of float, mm
        Lengths of the scale bars, across and up.
    """
    width, height = board.size_mm
    figure = Figure(figsize=(width / INCH_MM, height / INCH_MM))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(-width / 2, width / 2), ylim=(-height / 2, height / 2))
    axes.set_axis_off()
    diameters = board.diameters
    dots = EllipseCollection(
        diameters,
        diameters,
        np.zeros(len(diameters)),
        units="xy",
        offsets=board.centres[:, :2],
        offset_transform=axes.transData,
        facecolors="black",
        linewidths=0.0,
    )
    axes.add_collection(dots)
    across, up = (_bar(length - 2.0 * STRIP_MM) for length in board.size_mm)
    _draw_bar(axes, (-across / 2, -height / 2 + 0.75 * STRIP_MM), (across, 0.0))
    _draw_bar(axes, (-width / 2 + 0.75 * STRIP_MM, -up / 2), (0.0, up))
    text = (
        f"iriftrace board {width:g} x {height:g} mm, pitch {board.pitch_mm:g} mm, dots "
        f"{board.dot_mm:g} mm. Print at 100 %: the bars measure {across:g} mm and {up:g} mm."
    )
    axes.text(0.0, -height / 2 + 0.25 * STRIP_MM, text, ha="center", va="center", fontsize=7)
    with whole_file(Path(path)) as temporary, mpl.rc_context({"pdf.fonttype": 42}):
        figure.savefig(temporary, format="pdf", metadata={"CreationDate": None})
    return across, up


def _bar(room: float) -> float:
    """Length of a scale bar, mm, that fits into a room of this length."""
    return next((length for length in _BARS_MM if length <= room), _BARS_MM[-1])


def _draw_bar(axes: Axes, start: tuple[float, float], along: tuple[float, float]) -> None:
    """A line with a tick at each end, across it, mm."""
    (x, y), (dx, dy) = start, along
    ends = (x, y), (x + dx, y + dy)
    across, up = (0.0, 0.2 * STRIP_MM) if dx else (0.2 * STRIP_MM, 0.0)
    ticks = (((px - across, px + across), (py - up, py + up)) for px, py in ends)
    for xs, ys in (tuple(zip(*ends, strict=True)), *ticks):
        axes.plot(xs, ys, color="black", linewidth=0.5, solid_capstyle="butt")
