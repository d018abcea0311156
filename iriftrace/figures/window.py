"""A window for scenes, results, fields and parts that are turned with the mouse, or its image."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
import xarray as xr
from matplotlib.colors import to_rgb

from iriftrace.core.errors import InputError, SetupError
from iriftrace.core.plain import JsonObject
from iriftrace.figures import space
from iriftrace.figures.draw import add_picture_to
from iriftrace.figures.page import write_page
from iriftrace.figures.picture import SpacePicture
from iriftrace.figures.pictures import picture_of
from iriftrace.figures.style import even_ticks
from iriftrace.image.aov_image import AovImage
from iriftrace.measuring.two_devices.correction import Correction
from iriftrace.measuring.two_devices.scan import Scan
from iriftrace.medium.index_field import IndexField
from iriftrace.part.part import Part
from iriftrace.tracing.render import Rendering
from iriftrace.tracing.scene import Scene

_WITHOUT_DISPLAY = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")


def view(
    shown: Scene
    | Rendering
    | AovImage
    | Scan
    | Correction
    | xr.Dataset
    | pv.PolyData
    | IndexField
    | Part,
    output: str | Path | None = None,
    *,
    numbers: JsonObject | None = None,
    title: str = "iriftrace",
) -> None:
    """Show a scene, a result, a field or a part, in a window that stays open until it is closed.

    Parameters
    ----------
    shown
        A scene with part, shells cut open, devices and bent rays; the image of a pose with its
        hits, coloured by displacement; a simulated measurement, a correction, or the points of a
        cloud with the columns of `measure`, `correct` or `write_surface`, coloured by the error; a
        sweep with its cameras, coloured by score; a field, cut open; a part with its regions.
    output
        Write, without a window, an image (.png), or a page (.html) that works offline.
    numbers
        JSON values that lie next to a cloud and name its part, devices and field.
    title
        Title of the window.

    Raises
    ------
    InputError
        There is nothing to show, files of the scene or sweep cannot be read, or the output has
        another ending.
    SetupError
        There is no display for a window, or no OpenGL for drawing without one.
    """
    ending = None if output is None else Path(output).suffix.lower()
    if ending not in (None, ".png", ".html"):
        raise InputError(
            f"{output} ends in neither .png nor .html, the formats of an image and a page; rename "
            "it.",
            code="file.ending",
        )
    picture = picture_of(shown, numbers)
    if output is not None and ending == ".html":
        write_page(output, picture)
        return
    if output is not None:
        write_image(output, picture)
        return
    window = _window(title)
    _set_up(window, picture)
    # Here nested transparent shells are seen from all sides.
    window.enable_depth_peeling()
    window.show()


def write_image(
    output: str | Path, picture: SpacePicture, size_px: tuple[int, int] = space.SIZE_PX
) -> None:
    """Draw a picture into a PNG; in a smaller one its text is larger. Raises SetupError."""
    with space.off_screen(size_px) as plotter:
        _set_up(plotter, picture)
        plotter.screenshot(str(output))


def _window(title: str) -> Any:
    with pv.vtk_verbosity("off"):
        plotter = pv.Plotter(title=title, theme=pv.themes.DocumentTheme())
    # VTK draws into memory if there is no display.
    window: Any = plotter.render_window
    if any(window.IsA(name) for name in _WITHOUT_DISPLAY):
        plotter.close()
        raise SetupError(
            "There is no display on which a window could open; draw into a file instead.",
            code="window.no_display",
            argument="output",
        )
    return plotter


def _set_up(plotter: Any, picture: SpacePicture) -> None:
    plotter.view_vector(picture.towards.tolist(), viewup=(0.0, 0.0, 1.0))
    legend = picture.legend.items()
    _add_legend(plotter, {name: look for name, look in legend if name not in picture.hidden})
    add_picture_to(plotter, picture)
    plotter.add_text("\n".join(filter(None, (picture.subtitle, picture.note))), font_size=10)
    if picture.mark:
        plotter.add_text(picture.mark, position="lower_edge", font_size=10)
    low, high = np.reshape(plotter.bounds, (3, 2)).T
    # VTK writes numbers at even steps from end to end: the box ends at round ones.
    step = float(np.diff(even_ticks((0.0, float((high - low).max()) or 1.0), 10))[0])
    first = np.floor(low / step)
    last = np.maximum(np.ceil(high / step), first + 1.0)
    titles = {f"{axis}title": f"{axis} (mm)" for axis in "xyz"}
    labels = {f"n_{axis}labels": int(n) for axis, n in zip("xyz", last - first + 1.0, strict=True)}
    bounds = step * np.stack((first, last), axis=1).ravel()
    plotter.show_grid(bounds=bounds, **titles, **labels, color="#666666", font_size=13, fmt="%.4g")
    plotter.add_axes()
    plotter.reset_camera(bounds=bounds)
    # Room for the labels.
    plotter.camera.zoom(0.9)


def _add_legend(plotter: pv.Plotter, colours: Mapping[str, Any]) -> None:
    """Name the colours in black at the upper left, since light ones cannot be read as text."""
    if not colours:
        return
    height = min(0.024 * len(colours), 0.93)
    entries = [[name, "black"] for name in colours]
    add: Any = plotter.add_legend
    legend = add(entries, face="rectangle", bcolor=None, size=(0.25, height))
    legend.SetPosition(0.0, 0.96 - height)
    legend.ScalarVisibilityOn()
    for number, colour in enumerate(colours.values()):
        symbol = pv.wrap(legend.GetEntrySymbol(number))
        rgb = (255.0 * np.asarray(to_rgb(colour), dtype=np.float64)).astype(np.uint8)
        symbol.point_data.set_array(np.tile(rgb, (symbol.n_points, 1)), "rgb")
        symbol.GetPointData().SetActiveScalars("rgb")
        legend.SetEntrySymbol(number, symbol)
