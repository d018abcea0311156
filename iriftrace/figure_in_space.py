"""What all figures in space have in common: the rendered picture, its box, size and titles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pyvista as pv
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from iriftrace.figure_surfaces import off_screen
from iriftrace.figure_view import Box, View, add_box, label_box

SIZE_PX = (1600, 1200)
"""Width and height of the figures."""

_DPI = 200
_TITLE_COLOURS = ("0", "0.35")


def rendered(view: View, box: Box, draw: Callable[[pv.Plotter], None]) -> NDArray[np.uint8]:
    """(height, width, 3) array: what `draw` adds to a plotter, before the grids of the box.

    Raises
    ------
    SetupError
        This machine has no OpenGL that draws without a display.
    """
    with off_screen(view.size_px) as plotter:
        add_box(plotter, view, box)
        draw(plotter)
        view.apply_to(plotter, box)
        return np.asarray(plotter.screenshot(return_img=True))


def titled_figure(title: str, subtitle: str) -> Figure:
    """An empty figure with a title and a line below it."""
    width, height = SIZE_PX
    figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI)
    for text, y, size, colour in zip(
        (title, subtitle), (0.96, 0.92), (12, 9), _TITLE_COLOURS, strict=True
    ):
        figure.text(0.5, y, text, ha="center", va="center", fontsize=size, color=colour)
    return figure


def add_picture(
    figure: Figure,
    picture: NDArray[np.uint8],
    view: View,
    box: Box,
    corner_px: tuple[int, int] = (0, 0),
) -> Axes:
    """Put a rendered picture, pixel for pixel, under the labels of its box.

    Parameters
    ----------
    figure
        From `titled_figure`.
    picture, view, box
        What was rendered, and how.
    corner_px
        Where the picture's lower left corner goes.

    Returns
    -------
    Axes
        Whose coordinates are the pixels of the view.
    """
    (width, height), (columns, rows) = SIZE_PX, view.size_px
    left, foot = corner_px
    axes = figure.add_axes((left / width, foot / height, columns / width, rows / height))
    axes.imshow(picture, extent=(0, columns, 0, rows), interpolation="nearest")
    axes.set_axis_off()
    label_box(axes, view, box)
    return axes
