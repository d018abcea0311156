"""Pictures in space: a parallel view rendered off screen, under the labels of its box.

Grid and labels are drawn here, because VTK's cube axes (pyvista's ``show_grid``) have round numbers
only where the box itself ends at round numbers, write them slanted in a font of their own, and
need room around the box that depends on the view.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import product
from typing import Any

import numpy as np
import pyvista as pv
from attrs import frozen
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import SetupError
from iriftrace.figures.style import DPI, TEXT_COLOUR, even_ticks, number

SIZE_PX = (1600, 1200)
"""Width and height of the figures."""

_GRID_COLOUR = "#d3d7dc"
_LABEL_COLOUR = "0.25"
_TICK_GAP_PX = 12.0
_CORNER_PX = 14.0
_NAME_GAP_PX = 48.0
_LABEL_WIDTH_PX = 44.0
# Room for the labels of the box: left, right, below, above.
_MARGINS_PX = (200.0, 80.0, 100.0, 20.0)


@frozen(eq=False)
class Box:
    """Box along x, y and z: its (2, 3) bounds, mm, world, and round coordinates on each side."""

    bounds: FloatArray
    ticks: tuple[FloatArray, FloatArray, FloatArray]

    @property
    def centre(self) -> FloatArray:
        """(3,) array, mm, world."""
        return np.asarray(self.bounds.mean(axis=0))

    @property
    def diagonal(self) -> float:
        """Length of the space diagonal, mm."""
        return float(np.linalg.norm(np.ptp(self.bounds, axis=0)))

    @property
    def corners(self) -> FloatArray:
        """(8, 3) array, mm, world."""
        choice = np.array(list(product((0, 1), repeat=3)))
        return np.asarray(np.take_along_axis(self.bounds, choice, axis=0))


@frozen(eq=False)
class View:
    """Parallel projection of the world onto a picture of some width and height.

    `towards` is a (3,) unit vector from the scene to the viewer, not vertical; the point `centre`,
    mm, world, lies in the middle of the picture.
    """

    towards: FloatArray
    centre: FloatArray
    px_per_mm: float
    size_px: tuple[int, int]

    @property
    def right(self) -> FloatArray:
        """(3,) unit vector, world, to the right in the picture."""
        across = np.cross((0.0, 0.0, 1.0), self.towards)
        return np.asarray(across / np.linalg.norm(across), dtype=np.float64)

    @property
    def up(self) -> FloatArray:
        """(3,) unit vector, world, upwards in the picture."""
        return np.asarray(np.cross(self.towards, self.right), dtype=np.float64)

    def pixels(self, points: ArrayLike) -> FloatArray:
        """(n, 2) array, px from the picture's lower left corner, of (n, 3) points, mm, world."""
        offset = np.asarray(points, dtype=np.float64).reshape(-1, 3) - self.centre
        plane = np.stack((offset @ self.right, offset @ self.up), axis=1)
        return plane * self.px_per_mm + np.asarray(self.size_px) / 2.0

    def apply_to(self, plotter: pv.Plotter, box: Box) -> None:
        """Set up a plotter with nothing outside a box."""
        # The view's centre lies at most one diagonal from the box's own.
        radius = 2.0 * box.diagonal
        camera = plotter.camera
        camera.parallel_projection = True
        camera.focal_point = self.centre
        camera.position = self.centre + 2.0 * radius * self.towards
        camera.up = (0.0, 0.0, 1.0)
        camera.parallel_scale = self.size_px[1] / 2.0 / self.px_per_mm
        camera.clipping_range = (0.5 * radius, 3.5 * radius)


def view_direction(forward: FloatArray, upwards: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Direction of view in which a camera stands at the right and looks to the left.

    From the optical axis and the up direction of the camera's picture, (3,) unit vectors, world.
    Returns the direction from the scene to the viewer, and the horizontal one across the axis on
    the viewer's side.
    """
    level = np.array((1.0, 1.0, 0.0))
    # A camera that looks straight down has no horizontal axis: its picture's up is used instead.
    along = forward * level if np.hypot(*forward[:2]) > 0.05 else upwards * level
    along = along / np.linalg.norm(along)
    side = np.cross((0.0, 0.0, 1.0), along)
    turns = np.radians((10.0, 25.0, 40.0))[:, None]
    return oblique(np.cos(turns) * side - np.sin(turns) * along), side


def oblique(level: FloatArray) -> FloatArray:
    """The level unit vector, of (k, 3), in which a box shows most depth, raised by 20 degrees.

    Seen along x or y, a box has no depth; the best direction has the least difference of |x|
    and |y|.
    """
    ends_on = np.abs(np.abs(level[:, 0]) - np.abs(level[:, 1])).round(6)
    elevation = np.radians(20.0)
    towards: FloatArray = np.cos(elevation) * level[ends_on.argmin()]
    towards[2] += np.sin(elevation)
    return towards


def box_around(points: FloatArray) -> Box:
    """Box around (n, 3) points, mm, world, with a little room outside them."""
    low, high = points.min(axis=0), points.max(axis=0)
    longest = float((high - low).max())
    bounds = np.stack((low - 0.02 * longest, high + 0.02 * longest))
    most = [max(2, round(7 * extent / longest)) for extent in np.ptp(bounds, axis=0)]
    x, y, z = (even_ticks((a, b), n) for (a, b), n in zip(bounds.T.tolist(), most, strict=True))
    return Box(bounds, (x, y, z))


def fitting_view(towards: FloatArray, box: Box, size_px: tuple[int, int]) -> View:
    """The view along a direction in which a box and its labels fill the picture."""
    unit = View(towards, box.centre, 1.0, size_px)
    spread = unit.pixels(box.corners)
    left, right, below, above = _MARGINS_PX
    room = np.array((size_px[0] - left - right, size_px[1] - below - above))
    scale = float((room / np.ptp(spread, axis=0)).min())
    # The labels' margins differ, so the box does not lie in the middle of the picture.
    middle = (spread.min(axis=0) + spread.max(axis=0)) / 2.0 - np.asarray(size_px) / 2.0
    shift = np.array((left - right, below - above)) / 2.0 / scale
    across, along = middle - shift
    centre = unit.centre + across * unit.right + along * unit.up
    return View(towards, centre, scale, size_px)


def add_box(plotter: pv.Plotter, view: View, box: Box) -> None:
    """Draw grids on the two walls behind the scene and on its floor, or its ceiling from below."""
    bounds, ticks = box.bounds, box.ticks
    behind = np.where(view.towards > 0.0, bounds[0], bounds[1])
    segments = []
    for normal in range(3):
        for along in {0, 1, 2} - {normal}:
            across = 3 - normal - along
            for tick in (*bounds[:, across], *ticks[across]):
                ends = np.tile(behind, (2, 1))
                ends[:, across] = tick
                ends[:, along] = bounds[:, along]
                segments.append(ends)
    lines = pv.line_segments_from_points(np.concatenate(segments))
    plotter.add_mesh(lines, color=_GRID_COLOUR, line_width=1.5, lighting=False)


def label_box(axes: Axes, view: View, box: Box) -> None:
    """Write coordinates and names along the box's front lower edges and its left upright edge."""
    bounds, ticks = box.bounds, box.ticks
    # Seen from below, the floor's far edges are the lower ones in the picture.
    side = view.towards if view.towards[2] > 0.0 else -view.towards
    front = np.where(side > 0.0, bounds[1], bounds[0])
    floor = bounds[0, 2]
    upright = min(
        ((x, y) for x in bounds[:, 0] for y in bounds[:, 1]),
        key=lambda corner: view.pixels((*corner, floor))[0, 0],
    )
    middle = view.pixels(box.centre)[0]
    starts = ((0.0, front[1], floor), (front[0], 0.0, floor), (*upright, 0.0))
    for axis, (start, name) in enumerate(zip(starts, "xyz", strict=True)):
        edge = np.tile(np.asarray(start, dtype=np.float64), (len(ticks[axis]) + 2, 1))
        edge[:, axis] = (*bounds[:, axis], *ticks[axis])
        positions = view.pixels(edge)
        ends, positions = positions[:2], positions[2:]
        outward = _outward(ends, middle)
        steps = np.abs(np.diff(positions, axis=0)).max(axis=1)
        every = math.ceil(_LABEL_WIDTH_PX / steps.min()) if len(steps) else 1
        for tick, position in list(zip(ticks[axis], positions, strict=True))[::every]:
            # Near a corner the label would meet that of the next edge.
            if np.linalg.norm(ends - position, axis=1).min() > _CORNER_PX:
                _write(axes, position + _TICK_GAP_PX * outward, number(tick), outward, 8)
        gap = _NAME_GAP_PX + _LABEL_WIDTH_PX * abs(outward[0])
        _write(axes, ends.mean(axis=0) + gap * outward, f"{name} (mm)", outward, 9)


def _outward(positions: FloatArray, middle: FloatArray) -> FloatArray:
    """Unit vector in the picture across a row of positions, away from the middle."""
    along = positions[-1] - positions[0]
    across = np.array((-along[1], along[0])) / max(float(np.linalg.norm(along)), 1e-9)
    return np.asarray(across * np.sign(across @ (positions.mean(axis=0) - middle)))


def _write(axes: Axes, position: FloatArray, text: str, outward: FloatArray, size: int) -> None:
    sideways = abs(outward[0]) > 0.35
    axes.text(
        float(position[0]),
        float(position[1]),
        text,
        fontsize=size,
        color=_LABEL_COLOUR,
        ha=("left" if outward[0] > 0 else "right") if sideways else "center",
        va=("bottom" if outward[1] > 0 else "top") if abs(outward[1]) > 0.35 else "center",
    )


@contextmanager
def off_screen(size_px: tuple[int, int]) -> Iterator[pv.Plotter]:
    """A plotter that blends in the order of drawing and needs OpenGL, but no display."""
    # When VTK tries several kinds of windows, it reports each one that fails.
    with pv.vtk_verbosity("off"):
        plotter = pv.Plotter(
            off_screen=True, window_size=list(size_px), theme=pv.themes.DocumentTheme()
        )
        try:
            # Without a working OpenGL the window is unchanged, and drawing would end the process.
            if not opens(plotter.render_window):
                raise SetupError(
                    "the 3-D figure needs an OpenGL library that draws without a display, and none "
                    "was found; install Mesa's EGL (on Debian and Ubuntu: apt-get install libegl1) "
                    "or leave the figure out.",
                    code="figure.no_opengl",
                )
            plotter.enable_anti_aliasing("msaa", multi_samples=8)
            plotter.renderer.SetUseOIT(False)
            yield plotter
        finally:
            plotter.close()


def opens(window: Any) -> bool:
    """True if a window of VTK has a working OpenGL."""
    window.Initialize()
    return bool(window.GetInitialized())


def titled_figure(title: str, subtitle: str) -> Figure:
    """An empty figure with a title and a line below it."""
    width, height = SIZE_PX
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
    figure.text(0.5, 0.96, title, ha="center", va="center", fontsize=12)
    figure.text(0.5, 0.92, subtitle, ha="center", va="center", fontsize=9, color=TEXT_COLOUR)
    return figure


def add_picture(
    figure: Figure,
    view: View,
    box: Box,
    draw: Callable[[pv.Plotter], None],
    corner_px: tuple[int, int] = (0, 0),
) -> Axes:
    """Render the objects that `draw` adds to a plotter before the grids of a box; label the box.

    The picture's lower left corner goes to `corner_px`, pixel for pixel; the axes have the pixels
    of the view as coordinates.
    """
    with off_screen(view.size_px) as plotter:
        add_box(plotter, view, box)
        draw(plotter)
        view.apply_to(plotter, box)
        picture = np.asarray(plotter.screenshot(return_img=True))
    (width, height), (columns, rows) = SIZE_PX, view.size_px
    left, foot = corner_px
    axes = figure.add_axes((left / width, foot / height, columns / width, rows / height))
    axes.imshow(picture, extent=(0, columns, 0, rows), interpolation="nearest")
    axes.set_axis_off()
    label_box(axes, view, box)
    return axes
