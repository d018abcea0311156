"""An interactive window for scenes, results, fields and parts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import singledispatch
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
import xarray as xr
from matplotlib import colormaps
from matplotlib.colors import to_rgb

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, SetupError
from iriftrace.core.mesh.triangles import polydata
from iriftrace.core.units import ZERO_CELSIUS_K, counted
from iriftrace.figures import space
from iriftrace.figures.scene import (
    COLOUR_MAP,
    SECOND_COLOUR,
    SIGHT_COLOUR,
    add_device,
    add_shells,
    celsius_of,
)
from iriftrace.figures.style import even_ticks
from iriftrace.figures.sweep_space import add_surroundings
from iriftrace.image.aov_image import AovImage
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.source import FieldSource, stated_source, synthetic_mark
from iriftrace.part.part import Part
from iriftrace.sweep.faces import displacement_limits
from iriftrace.tracing.scene import Scene

Draw = Callable[[pv.Plotter], None]

CLOUD_COLUMNS = {
    "error_normal": "error along the normal (um)",
    "displacement": "displacement (um)",
    "correction": "correction (um)",
}
"""Columns of clouds, mm, by which points are coloured, and their labels."""

SCALAR_BAR: Any = {
    **{"vertical": True, "position_x": 0.84, "position_y": 0.2, "height": 0.6},
    **{"title_font_size": 22, "label_font_size": 18, "fmt": "%.4g"},
}
"""Next to the drawn objects, not over its axes."""

_WITHOUT_DISPLAY = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")


def view(
    shown: Scene | AovImage | xr.Dataset | pv.PolyData | IndexField | Part,
    picture: str | Path | None = None,
    *,
    source: FieldSource | None = None,
    title: str = "iriftrace",
) -> None:
    """Show a scene, a result, a field or a part, in a window that stays open until it is closed.

    Parameters
    ----------
    shown
        A scene with part, shells cut open and devices; the image of a pose with its hits, coloured
        by displacement; a sweep with its cameras, coloured by score; the points of a cloud with
        the columns of `measure`, `correct` or `write_surface`, coloured by the error; a field, cut
        open; a part with its regions.
    picture
        Draw without a window into this .png.
    source
        Source of the field of a cloud, which cannot state its own.
    title
        Title of the window.

    Raises
    ------
    InputError
        There is nothing to show, or files of the scene or sweep cannot be read.
    SetupError
        There is no display for a window, or no OpenGL for drawing without one.
    """
    draw, stated = _drawing(shown)
    mark = synthetic_mark(source or stated)

    def draw_marked(plotter: pv.Plotter) -> None:
        draw(plotter)
        if mark:
            plotter.add_text(mark, position="lower_edge", font_size=10)

    if picture is not None:
        with space.off_screen(space.SIZE_PX) as plotter:
            _set_up(plotter, draw_marked)
            plotter.screenshot(str(picture))
        return
    window = _window(title)
    _set_up(window, draw_marked)
    # Here nested transparent shells are seen from all sides.
    window.enable_depth_peeling()
    window.show()


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
            argument="picture",
        )
    return plotter


def _set_up(plotter: Any, draw: Draw) -> None:
    plotter.view_isometric()
    draw(plotter)
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


@singledispatch
def _drawing(shown: object) -> tuple[Draw, FieldSource | None]:
    """The function that draws a result, and the source of its field."""
    raise InputError(
        f"An object of the type {type(shown).__name__} cannot be shown; give what load_scene, "
        "read_exr, read_sweep, read_field or read_part returns.",
        code="window.wrong_type",
    )


@_drawing.register
def _scene(scene: Scene) -> tuple[Draw, FieldSource | None]:
    state = scene.air.states[0]
    shells = None if state.files and state.files.shells is None else state.shells
    blockers = [(body.vertices, body.faces) for body in scene.blockers]
    named = {"part": space.PART_COLOUR, "camera": SIGHT_COLOUR}
    if scene.second is not None:
        named[scene.second_id.replace("_", " ")] = SECOND_COLOUR
    if blockers:
        named["blocks the view"] = space.BLOCKER_COLOUR

    def draw(plotter: pv.Plotter) -> None:
        _add_legend(plotter, named)
        space.add_part(plotter, scene.part)
        space.add_blockers(plotter, blockers)
        add_device(plotter, scene.camera, scene.part, SIGHT_COLOUR)
        if scene.second is not None:
            add_device(plotter, scene.second, scene.part, SECOND_COLOUR)
        if shells is None:
            return
        celsius = celsius_of(shells)
        towards, side = space.view_direction(scene.camera.forward, -scene.camera.matrix[:3, 1])
        plotter.view_vector(towards.tolist(), viewup=(0.0, 0.0, 1.0))
        add_shells(plotter, shells, scene.part.centre, side)
        plotter.add_text(
            f"{counted(len(shells.shells), 'shell')}, air of {celsius[0]:.0f} degC (blue) to "
            f"{celsius[-1]:.0f} degC (yellow)",
            font_size=10,
        )

    return draw, None if shells is None else shells.source


@_drawing.register
def _pose(image: AovImage) -> tuple[Draw, FieldSource | None]:
    from iriftrace.image.displacement import good_mask
    from iriftrace.io.exr import read_part_of

    part, good = read_part_of(image), good_mask(image)
    if not good.any():
        raise InputError(
            "The image has no good ray, so there is nothing to show.", code="picture.no_good_ray"
        )
    hits = pv.PolyData(image.vector("straight", good).astype(np.float64))
    moved = 1e3 * image.channels["displacement.norm"][good].astype(np.float64)
    named = {"part without a displacement": space.PART_COLOUR, "camera": SIGHT_COLOUR}

    def draw(plotter: pv.Plotter) -> None:
        _add_legend(plotter, named)
        space.add_part(plotter, part)
        _add_points(plotter, hits, moved, CLOUD_COLUMNS["displacement"])
        add_device(plotter, image.camera, part, SIGHT_COLOUR)

    return draw, stated_source(image.header.get("field"))


@_drawing.register
def _sweep(dataset: xr.Dataset) -> tuple[Draw, FieldSource | None]:
    from iriftrace.planning.summary import summarise
    from iriftrace.sweep.reload import surroundings_of
    from iriftrace.sweep.store import attribute

    summary = summarise(dataset)
    surroundings = surroundings_of(dataset)
    length = 0.05 * float(summary.distance.max())

    def draw(plotter: pv.Plotter) -> None:
        cones = pv.PolyData(summary.origins)
        cones["aim"] = summary.matrices[:, :3, 2]
        cones[summary.score.title] = summary.score.values
        shape = pv.Cone(center=(0.5 * length, 0.0, 0.0), height=length, radius=0.4 * length)
        shape.rotate_y(180.0, point=shape.center, inplace=True)
        plotter.add_mesh(
            cones.glyph(orient="aim", scale=False, geom=shape),
            scalars=summary.score.title,
            cmap="viridis",
            nan_color="#b3b3b3",
            scalar_bar_args=SCALAR_BAR,
        )
        best = summary.plan.best
        ends = summary.origins[best], summary.targets[best]
        plotter.add_mesh(pv.Line(*ends), color=SIGHT_COLOUR, line_width=4)
        add_surroundings(plotter, surroundings)
        plotter.add_text(f"line of sight of pose {best}, the best by score", font_size=10)

    return draw, stated_source(attribute(dataset, "field"))


@_drawing.register
def _cloud(cloud: pv.PolyData) -> tuple[Draw, FieldSource | None]:
    """Points in the colours of the first known column, or of a vector's length."""
    columns = {name: np.asarray(cloud.point_data[name]) for name in cloud.point_data}
    known = dict(columns)
    for vector in CLOUD_COLUMNS:
        parts = [columns[key] for key in (f"{vector}_{axis}" for axis in "xyz") if key in columns]
        if len(parts) == 3:
            known.setdefault(vector, np.stack(parts, axis=1))
    name = next((name for name in CLOUD_COLUMNS if name in known), None)
    if name is None:
        raise InputError(
            f"The cloud has no column {', '.join(CLOUD_COLUMNS)}; give one of iriftrace measure, "
            "correct or render.",
            code="cloud.no_vector",
        )
    values, title = known[name], CLOUD_COLUMNS[name]
    um = 1e3 * (values if values.ndim == 1 else np.linalg.norm(values, axis=1)).astype(np.float64)
    # Nothing is known of points of another status, which does not mean 0.
    good = columns.get("status", np.zeros(len(um))) == 0
    if not good.any():
        raise InputError(
            "The cloud has no point of status 0, so there is nothing to show.",
            code="cloud.no_point",
        )
    points = pv.PolyData(np.asarray(cloud.points, dtype=np.float64)[good])
    return lambda plotter: _add_points(plotter, points, um[good], title), None


@_drawing.register
def _field(field: IndexField) -> tuple[Draw, FieldSource | None]:
    grid, title = field.grid.copy(deep=False), "air (degC)"
    grid.point_data[title] = field.temperature_k - ZERO_CELSIUS_K
    half = grid.clip(normal="y", origin=grid.center)

    def draw(plotter: pv.Plotter) -> None:
        colours = colormaps[COLOUR_MAP]
        plotter.add_mesh(half, scalars=title, cmap=colours, scalar_bar_args=SCALAR_BAR)
        plotter.add_mesh(grid.outline(), color="#666666")

    return draw, field.source


@_drawing.register
def _part(part: Part) -> tuple[Draw, FieldSource | None]:
    from iriftrace.part.region_choice import placed_regions

    colours = colormaps["tab20"](np.arange(len(part.region_names)) % 20)
    names = placed_regions(part)

    def draw(plotter: pv.Plotter) -> None:
        for number, colour in enumerate(colours):
            of_region = polydata(part.vertices, part.faces[part.region_of_face == number])
            plotter.add_mesh(of_region, color=colour, ambient=0.3)
        _add_legend(plotter, dict(zip(names, colours, strict=True)))

    return draw, None


def _add_legend(plotter: pv.Plotter, colours: Mapping[str, Any]) -> None:
    """Name the colours in black at the upper left, since light ones cannot be read as text."""
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


def _add_points(plotter: pv.Plotter, points: pv.PolyData, um: FloatArray, title: str) -> None:
    """Add points in colours up to the 99th percentile, in the scale of `plot`.

    It is about 0 for values with signs, else logarithmic. The bar has an extra field for values
    beyond, in the colour of its end.
    """
    points.point_data[title] = um
    signed = bool((um < 0).any())
    most = float(np.nanpercentile(np.abs(um), 99)) or 1.0
    low, high = (-most, most) if signed else displacement_limits(um)
    colours = colormaps["RdBu_r" if signed else "viridis"]
    plotter.add_mesh(
        points,
        scalars=title,
        clim=(low, high),
        log_scale=not signed and low > 0.0,
        cmap=colours,
        above_color=colours(1.0) if (um > high).any() else None,
        below_color=colours(0.0) if (um < low).any() else None,
        lighting=False,
        render_points_as_spheres=True,
        point_size=5.0,
        scalar_bar_args=SCALAR_BAR,
    )
