"""An interactive window for scenes, results, fields and parts."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from matplotlib import colormaps
from matplotlib.colors import to_rgb

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import AnyArray, FloatArray
from iriftrace.core.errors import InputError, SetupError
from iriftrace.core.units import ZERO_CELSIUS_K, counted
from iriftrace.field.source import FieldSource, stated_source, synthetic_mark
from iriftrace.figures import space
from iriftrace.figures.scene import (
    COLOUR_MAP,
    SECOND_COLOUR,
    SIGHT_COLOUR,
    add_shells,
    camera_body,
    celsius_of,
    sight_lines,
)
from iriftrace.figures.style import even_ticks
from iriftrace.geometry.triangles import polydata
from iriftrace.part.part import Part
from iriftrace.sweep.faces import displacement_limits

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

_MESHES = (".ply", ".stl", ".obj", ".glb", ".gltf", ".off")
_OTHER_CLOUDS = (".asc", ".xyz", ".pts", ".pcd", ".ptx", ".e57")
_WITHOUT_DISPLAY = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")


def view(
    path: str | Path, picture: str | Path | None = None, *, length_unit: str | None = None
) -> None:
    """Show a file in space, in a window that stays open until it is closed.

    Scenes (.xml) with part, shells cut open and devices; poses (.exr) with their hits, coloured by
    displacement; sweeps (.nc) with their cameras, coloured by score; clouds (.vtp, .ply) of
    `measure`, `correct` and ``render --surface``, coloured by the error; fields (.vtu and others
    that `iriftrace.read_field` reads), cut open; parts (.ply .stl .obj .glb) with their regions.

    Parameters
    ----------
    path
    picture
        Draw without a window into this .png.
    length_unit
        Unit of a part's coordinates; by default the unit that its file states, else mm.

    Raises
    ------
    InputError
        The file cannot be read, or is of another kind.
    SetupError
        There is no display for a window, or no OpenGL for drawing without one.
    """
    if not Path(path).exists():
        raise InputError(f"There is no file {path}; give an existing one.")
    if picture is not None:
        draw = _drawing(Path(path), length_unit)
        with space.off_screen(space.SIZE_PX) as plotter:
            _set_up(plotter, draw)
            plotter.screenshot(str(picture))
        return
    window = _window(f"iriftrace: {path}")
    _set_up(window, _drawing(Path(path), length_unit))
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
            "There is no display on which a window could open; draw into a file instead "
            "(--picture view.png), or work at a desktop."
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


def _drawing(path: Path, length_unit: str | None) -> Draw:
    """The function that draws a file, once all of it has been read."""
    suffix = path.suffix.lower()
    if length_unit is not None and suffix not in _MESHES:
        raise InputError(
            f"A length unit is for the mesh of a part, and {path} is not one "
            f"({', '.join(_MESHES)}); leave it out (--length-unit)."
        )
    known = {".xml": _scene, ".exr": _pose, ".nc": _sweep, ".vtp": _cloud}
    if suffix in known:
        return known[suffix](path)
    if suffix in _MESHES:
        return _part(path, length_unit)
    if suffix in _OTHER_CLOUDS:
        raise InputError(f"{path} is a cloud; one is shown from a .vtp or .ply: write it as that.")
    return _field(path)


def _scene(path: Path) -> Draw:
    from iriftrace.scene.load import load_scene

    scene = load_scene(path)
    state = scene.air.states[0]
    shells = state.shells if state.files and state.files.shells else None
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
        _add_mark(plotter, shells.source)

    return draw


def _pose(path: Path) -> Draw:
    from iriftrace.image.aov_image import read_exr
    from iriftrace.image.displacement import good_mask

    image = read_exr(path)
    part, good = image.part, good_mask(image)
    if not good.any():
        raise InputError(f"{path} has no good ray, so there is nothing to show.")
    hits = pv.PolyData(image.vector("straight", good).astype(np.float64))
    moved = 1e3 * image.channels["displacement.norm"][good].astype(np.float64)

    def draw(plotter: pv.Plotter) -> None:
        _add_legend(
            plotter, {"part without a displacement": space.PART_COLOUR, "camera": SIGHT_COLOUR}
        )
        space.add_part(plotter, part)
        _add_points(plotter, hits, moved, CLOUD_COLUMNS["displacement"])
        _add_mark(plotter, stated_source(image.header.get("field")))
        add_device(plotter, image.camera, part, SIGHT_COLOUR)

    return draw


def _sweep(path: Path) -> Draw:
    from iriftrace.planning.summary import summarise
    from iriftrace.studies.study import is_study
    from iriftrace.sweep.reload import surroundings_of
    from iriftrace.sweep.store import attribute, read_sweep

    if is_study(path):
        raise InputError(f"{path} is a study, which has nothing in space; draw it: iriftrace plot.")
    dataset = read_sweep(path)
    summary = summarise(dataset)
    around = surroundings_of(dataset)
    length = 0.05 * float(summary.distance.max())

    def draw(plotter: pv.Plotter) -> None:
        if around.part is not None:
            space.add_part(plotter, around.part)
        if around.hot_air is not None:
            air = space.thinned(polydata(*around.hot_air))
            plotter.add_mesh(air, color="#7fb0d6", opacity=0.2, smooth_shading=True)
        cones = pv.PolyData(summary.origins)
        cones["aim"] = summary.matrices[:, :3, 2]
        cones[summary.score.title] = summary.score.values
        shape = pv.Cone(center=(0.5 * length, 0.0, 0.0), height=length, radius=0.4 * length)
        shape.rotate_y(180.0, point=shape.center, inplace=True)
        poses = cones.glyph(orient="aim", scale=False, geom=shape)
        plotter.add_mesh(
            poses,
            scalars=summary.score.title,
            cmap="viridis",
            nan_color="#b3b3b3",
            scalar_bar_args=SCALAR_BAR,
        )
        best = summary.plan.best
        ends = summary.origins[best], summary.targets[best]
        plotter.add_mesh(pv.Line(*ends), color=SIGHT_COLOUR, line_width=4)
        plotter.add_text(f"line of sight of pose {best}, the best by score", font_size=10)
        _add_mark(plotter, stated_source(attribute(dataset, "field")))

    return draw


def _cloud(path: Path) -> Draw:
    from iriftrace.field.readers.vtk_process import read_file

    cloud = pv.wrap(read_file(path))
    columns = {name: np.asarray(cloud.point_data[name]) for name in cloud.point_data}
    return _coloured(path, np.asarray(cloud.points, dtype=np.float64), columns)


def _coloured(path: Path, places: FloatArray, columns: Mapping[str, AnyArray]) -> Draw:
    """Points in the colours of the first known column, or of a vector's length."""
    known = dict(columns)
    for vector in CLOUD_COLUMNS:
        parts = [columns[key] for key in (f"{vector}_{axis}" for axis in "xyz") if key in columns]
        if len(parts) == 3:
            known.setdefault(vector, np.stack(parts, axis=1))
    name = next((name for name in CLOUD_COLUMNS if name in known), None)
    if name is None:
        raise InputError(
            f"{path} has no column {', '.join(CLOUD_COLUMNS)}; give a cloud of iriftrace measure, "
            "correct or render --surface."
        )
    values, title = known[name], CLOUD_COLUMNS[name]
    um = 1e3 * (values if values.ndim == 1 else np.linalg.norm(values, axis=1)).astype(np.float64)
    if "status" in columns:
        # Nothing is known of other points, which does not mean 0.
        good = np.asarray(columns["status"]) == 0
        places, um = places[good], um[good]
    if len(um) == 0:
        raise InputError(f"{path} has no point of status 0, so there is nothing to show.")
    points, source = pv.PolyData(places), _source_beside(path)

    def draw(plotter: pv.Plotter) -> None:
        _add_points(plotter, points, um, title)
        _add_mark(plotter, source)

    return draw


def _source_beside(path: Path) -> FieldSource | None:
    """Source of the field from the numbers next to a cloud; None if they do not exist."""
    try:
        values = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
        return stated_source(values["field"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _field(path: Path) -> Draw:
    from iriftrace.field.read import read_field

    field = read_field(path)
    grid, title = field.grid, "air (degC)"
    grid.point_data[title] = field.temperature_k - ZERO_CELSIUS_K
    half = grid.clip(normal="y", origin=grid.center)

    def draw(plotter: pv.Plotter) -> None:
        plotter.add_mesh(
            half, scalars=title, cmap=colormaps[COLOUR_MAP], scalar_bar_args=SCALAR_BAR
        )
        plotter.add_mesh(grid.outline(), color="#666666")
        _add_mark(plotter, field.source)

    return draw


def _part(path: Path, length_unit: str | None) -> Draw:
    from iriftrace.geometry.ply import read_ply
    from iriftrace.part.part import read_part
    from iriftrace.part.region_choice import placed_regions

    if path.suffix.lower() == ".ply" and path.is_file():
        try:
            mesh = read_ply(path)
        except Exception as error:  # its reader lets any through that a damaged file causes
            raise InputError(f"{path} is damaged ({error}); write it again.") from error
        if not len(mesh.faces):
            return _coloured(path, mesh.vertices, mesh.vertex_columns)
    part = read_part(path, length_unit=length_unit)
    colours = colormaps["tab20"](np.arange(len(part.region_names)) % 20)
    names = placed_regions(part)

    def draw(plotter: pv.Plotter) -> None:
        for number, colour in enumerate(colours):
            of_region = polydata(part.vertices, part.faces[part.region_of_face == number])
            plotter.add_mesh(of_region, color=colour, ambient=0.3)
        _add_legend(plotter, dict(zip(names, colours, strict=True)))

    return draw


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


def add_device(plotter: pv.Plotter, camera: Camera, part: Part, colour: str) -> None:
    """Add a camera or projector, the edges of its view and the outlines of its focus interval."""
    plotter.add_mesh(camera_body(camera, part), color=colour, ambient=0.3)
    for _, points in sight_lines(camera, part):
        plotter.add_mesh(pv.lines_from_points(points), color=colour, line_width=2, lighting=False)


def _add_mark(plotter: pv.Plotter, source: FieldSource | None) -> None:
    """Mark a result that does not come from a simulation."""
    mark = synthetic_mark(source)
    if mark:
        plotter.add_text(mark, position="lower_edge", font_size=10)


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
