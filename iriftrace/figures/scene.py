"""Figure of a scene in space: the hot part, its shells of air and the camera."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import FuncNorm
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray
from iriftrace.core.mesh.triangles import polydata
from iriftrace.core.units import ZERO_CELSIUS_K, counted
from iriftrace.figures import space
from iriftrace.medium.shells.stack import Shell, ShellStack
from iriftrace.medium.source import synthetic_mark
from iriftrace.part.part import Part

_PICTURE_PX = (1390, 1080)

_MOST_SHELLS = 20
SIGHT_COLOUR = "#0f6b8f"
SECOND_COLOUR = "#a8541b"
COLOUR_MAP = "plasma"
# Opacity of all shells together.
_TRANSMITTANCE = 0.2


def scene_figure(
    part: Part,
    shells: ShellStack,
    camera: Camera,
    second: Camera | None = None,
    second_name: str = "projector",
) -> Figure:
    """Draw part, shells and camera in space, 1600 x 1200 pixels.

    The half of the shells that faces the viewer is cut away along the vertical plane through the
    part's centre that is parallel to the camera's axis, so that the nesting shows. Colours are
    linear in the air's refractivity and labelled by temperature. Lines from the camera are the
    edges of its view; outlines lie at the near and the far end of the focus interval.

    Parameters
    ----------
    part, shells, camera
        The scene, mm, world.
    second : Camera, optional
        The device with which points are triangulated; the edges of its view are drawn.
    second_name : str
        Its name.

    Raises
    ------
    SetupError
        This machine has no OpenGL that draws without a display.
    """
    towards, side = space.view_direction(camera.forward, -camera.matrix[:3, 1])
    sight, body = sight_lines(camera, part), camera_body(camera, part)
    seen = [part.bounds, body.points, *(points for _, points in sight)]
    seen += [shell.vertices for shell in shells.shells]
    if second is not None:
        other = camera_body(second, part)
        seen += [other.points, *(points for name, points in sight_lines(second, part) if not name)]
    box = space.box_around(np.concatenate([points.astype(np.float64) for points in seen]))
    view = space.fitting_view(towards, box, _PICTURE_PX)

    def draw(plotter: pv.Plotter) -> None:
        space.add_part(plotter, part)
        add_device(plotter, camera, part, SIGHT_COLOUR)
        if second is not None:
            add_device(plotter, second, part, SECOND_COLOUR, focus=False)
        add_shells(plotter, shells, part.centre, side)

    devices = " and camera" if second is None else f", camera and {second_name}"
    figure = space.titled_figure(*_titles(shells, camera, devices))
    axes = space.add_picture(figure, view, box, draw)
    for text, points, place in _names(camera, view, sight, body.points):
        _name(axes, view.pixels(points), text, place)
    if second is not None:
        _name(axes, view.pixels(other.points), second_name.capitalize(), "above", SECOND_COLOUR)
    norm = temperature_norm(shells)
    bar = figure.colorbar(
        ScalarMappable(norm, COLOUR_MAP),
        cax=figure.add_axes((0.885, 0.22, 0.022, 0.56)),
        label="Air temperature at the shells (°C)",
    )
    bar.set_ticks(temperature_ticks(norm))
    bar.set_ticks([], minor=True)
    return figure


def celsius_of(shells: ShellStack) -> FloatArray:
    """(shells,) array, degC: temperature of the air at each surface."""
    return shells.temperature_k - ZERO_CELSIUS_K


def temperature_norm(shells: ShellStack) -> FuncNorm:
    """Colours over temperature (degC) that are linear in 1/T, hence in the refractivity."""
    celsius = celsius_of(shells)
    low, high = float(celsius.min()), float(celsius.max())
    if high - low < 1.0:
        low, high = low - 10.0, high + 10.0
    return FuncNorm(
        (
            lambda t: -1.0 / (np.asarray(t) + ZERO_CELSIUS_K),
            lambda u: -1.0 / np.asarray(u) - ZERO_CELSIUS_K,
        ),
        low,
        high,
    )


def temperature_ticks(norm: FuncNorm) -> list[float]:
    """Round temperatures that do not crowd the colour bar."""
    rounds = np.array([20, 30, 40, 50, 75, 100, 150, 200, 300, 400, 500, 700, 1000, 1500, 2000])
    low, high = (float(t) for t in norm.inverse(np.array((0.0, 1.0))))
    ticks: list[float] = []
    for tick in rounds[(rounds >= low) & (rounds <= high)].tolist():
        if not ticks or norm(tick) - norm(ticks[-1]) > 0.045:
            ticks.append(tick)
    return ticks if len(ticks) > 1 else [round(low), round(high)]


def camera_body(camera: Camera, part: Part) -> pv.PolyData:
    """A box and a lens behind the pinhole, large enough to be seen next to the part; mm, world."""
    axis = (0.0, 0.0, 1.0)
    box = pv.Cube(center=(0.0, 0.0, -0.75), x_length=1.3, y_length=0.95, z_length=0.9)
    lens = pv.Cylinder(
        center=(0.0, 0.0, -0.15), direction=axis, radius=0.36, height=0.3, resolution=48
    )
    body: pv.PolyData = box.triangulate().append_polydata(lens.triangulate())
    body.points *= 0.09 * float(np.linalg.norm(np.ptp(part.bounds, axis=0)))
    return body.transform(camera.matrix, inplace=True)


def sight_lines(camera: Camera, part: Part) -> list[tuple[str, FloatArray]]:
    """Edges of a camera's view, without names, and outlines of its focus interval; mm, world.

    If the far focus lies well behind the part, the edges end earlier and it has no outline.
    """
    local = camera.to_camera(part.vertices)
    pinhole = camera.projection == "pinhole"
    distances = np.linalg.norm(local, axis=1) if pinhole else local[:, 2]
    near, far = camera.focus_mm
    # A far end that lies well behind the part would make the part small in the picture.
    reach = min(far, 1.3 * float(distances.max()))
    corners = camera.corners
    fractions = np.linspace(0.0, 1.0, 17)[:-1, None]
    sides = [a + fractions * (b - a) for a, b in zip(corners, np.roll(corners, -1, 0), strict=True)]
    border = np.concatenate([*sides, corners[:1]])

    starts, directions = camera.rays(corners)
    lines = [
        ("", np.stack((start, start + reach * direction)))
        for start, direction in zip(starts, directions, strict=True)
    ]
    starts, directions = camera.rays(border)
    if not pinhole:
        lines.append(("", starts))
    for name, distance in (("Near focus", near), ("Far focus", far)):
        if 0.0 < distance <= reach:
            # The focus interval is measured along the ray, so the outline lies on a sphere.
            lines.append((f"{name} {distance:g} mm", starts + distance * directions))
    return lines


def add_device(
    plotter: pv.Plotter, camera: Camera, part: Part, colour: str, *, focus: bool = True
) -> None:
    """Add a camera or projector, the edges of its view and the outlines of its focus interval."""
    plotter.add_mesh(camera_body(camera, part), color=colour, ambient=0.3)
    for name, points in sight_lines(camera, part):
        if focus or not name:
            line = pv.lines_from_points(points)
            plotter.add_mesh(line, color=colour, line_width=3, lighting=False)


def drawn_shells(shells: tuple[Shell, ...]) -> list[int]:
    """Numbers of the shells to draw: all, or as many as the eye can tell apart."""
    count = min(len(shells), _MOST_SHELLS)
    return [int(number) for number in np.rint(np.linspace(0, len(shells) - 1, count))]


def add_shells(
    plotter: pv.Plotter, shells: ShellStack, centre: FloatArray, side: FloatArray
) -> None:
    """Add the parts of shells behind a cut through `centre` across `side`, and its lines.

    The outermost comes first: with the near half cut away it is the farthest, so that blending in
    the order of drawing is right and no sorting (depth peeling) is needed.
    """
    drawn = drawn_shells(shells.shells)
    colours = colormaps[COLOUR_MAP](temperature_norm(shells)(celsius_of(shells)))
    # The part must remain visible through all of them.
    opacity = float(1.0 - _TRANSMITTANCE ** (1.0 / len(drawn)))
    for number in drawn:
        shell, colour = shells.shells[number], colours[number, :3]
        surface = polydata(shell.vertices, shell.faces)
        smooth = shell.normals is not None
        if shell.normals is not None:
            surface.point_data.active_normals = shell.normals.astype(np.float64)
        surface = space.thinned(surface)
        rest = surface.clip(normal=side, origin=centre)
        if rest.n_cells:
            plotter.add_mesh(
                rest, color=colour, opacity=opacity, smooth_shading=smooth, ambient=0.4, diffuse=0.6
            )
        cut = surface.slice(normal=side, origin=centre)
        if cut.n_cells:
            plotter.add_mesh(cut, color=colour, line_width=2.5, lighting=False)


def _names(
    camera: Camera, view: space.View, sight: list[tuple[str, FloatArray]], body: FloatArray
) -> list[tuple[str, FloatArray, str]]:
    """Names in the picture: text, points in the world (mm), and the side of them to write on."""
    aim = view.pixels(np.stack((camera.origin, camera.origin + camera.forward)))
    rises = aim[1, 1] > aim[0, 1]
    # Edges of the view come from the right and spread away from the camera: these sides are free.
    sides = {"Camera": "below" if rises else "above", "Far": "above" if rises else "below"}
    named = [*((name, points) for name, points in sight if name), ("Camera", body)]
    return [(name, points, sides.get(name.split()[0], "right")) for name, points in named]


def _name(
    axes: Axes, positions: FloatArray, text: str, place: str, colour: str = SIGHT_COLOUR
) -> None:
    """Write a name above, below or right of the positions (px)."""
    column, row = positions.T
    at, offset, across, upright = {
        "above": (row.argmax(), (0, 5), "center", "bottom"),
        "below": (row.argmin(), (0, -5), "center", "top"),
        "right": (column.argmax(), (6, 0), "left", "top"),
    }[place]
    axes.annotate(
        text,
        (float(column[at]), float(row[at])),
        xytext=offset,
        textcoords="offset points",
        fontsize=9,
        ha=across,
        va=upright,
        color=colour,
        path_effects=[withStroke(linewidth=2.5, foreground="white")],
    )


def _titles(shells: ShellStack, camera: Camera, devices: str) -> tuple[str, str]:
    count, drawn = len(shells.shells), len(drawn_shells(shells.shells))
    place = ", ".join(f"{value:.4g}" for value in camera.origin).replace("-", "\N{MINUS SIGN}")
    parts = [
        synthetic_mark(shells.source),
        Path(shells.source.path).name if shells.source else None,
        f"{drawn} of {count} shells drawn" if drawn < count else None,
        counted(shells.triangles, "triangle"),
        f"camera at ({place}) mm",
    ]
    return (
        f"Hot part, {counted(count, 'shell')} of hot air (cut open){devices}",
        "  ·  ".join(part for part in parts if part),
    )
