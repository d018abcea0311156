"""Figure of a scene in space: the hot part, its shells of air and the camera."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pyvista as pv
from attrs import evolve
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.core.units import counted
from iriftrace.figures import space
from iriftrace.figures.draw import add_picture_to
from iriftrace.figures.picture import (
    SIGHT_COLOUR,
    Device,
    DrawnBody,
    Lines,
    SpacePicture,
    as_points,
    round_factor,
)
from iriftrace.figures.scene_picture import picture_of_scene, scene_picture
from iriftrace.figures.style import legend_below
from iriftrace.medium.shells.stack import ShellStack
from iriftrace.medium.source import synthetic_mark
from iriftrace.part.part import Part
from iriftrace.tracing.scene import Scene

_PICTURE_PX = (1390, 1080)
_STRAIGHT_COLOUR = "#858c94"
_RAY_WIDTH = 4.5
_LEGEND_PX = 80
_RAYS = 9
"""Most rays of `rays_figure`."""


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
    named = second_name.replace("_", " ")
    picture = scene_picture(part, shells, camera, second, second_name=named)
    front, *others = picture.devices
    seen = [surface.vertices for surface in picture.surfaces]
    seen += [front.body.points, *(points for _, points in front.sight)]
    for device in others:
        seen += [device.body.points, *(points for _, points in device.sight)]
    box = space.box_around(np.concatenate([points.astype(np.float64) for points in seen]))
    view = space.fitting_view(picture.towards, box, _PICTURE_PX)
    figure = space.titled_figure(*_titles(shells, camera, picture))
    axes = space.add_picture(figure, view, box, lambda plotter: add_picture_to(plotter, picture))
    for text, points, place in _names(view, front):
        _name(axes, view.pixels(points), text, place)
    for device in others:
        name = device.name.capitalize()
        _name(axes, view.pixels(as_points(device.body)), name, "above", device.colour)
    (scale,) = picture.scales
    scale.add_bar(figure, cax=figure.add_axes((0.885, 0.22, 0.022, 0.56)))
    return figure


def rays_figure(scene: Scene) -> Figure:
    """Draw the hot part in its shells, cut open, and some rays of the camera, straight and bent.

    Balls lie at their ends. Offsets across the straight rays are exaggerated by the stated factor.
    Raises InputError if no ray of a sample meets the part, and SetupError as `scene_figure`.
    """
    picture = picture_of_scene(scene)
    if not picture.lines:
        raise InputError(
            f"There are no rays to draw ({picture.subtitle}); move the camera.",
            code="picture.no_good_ray",
        )
    rays = picture.lines[0]
    some = np.linspace(0, len(rays.paths) - 1, min(_RAYS, len(rays.paths))).astype(int)
    bent, straight = (np.array([each[i] for i in some]) for each in (rays.paths, rays.straight))
    offset = np.linalg.norm(bent - straight, axis=2).max()
    size = float(np.linalg.norm(np.ptp(scene.part.bounds, axis=0)))
    factor = round_factor(float(offset), 2.0 * size)
    drawn = {
        "straight rays, and where they meet the part": (straight, _STRAIGHT_COLOUR),
        "rays bent by the hot air (exaggerated), and where they end": (
            straight + factor * (bent - straight),
            SIGHT_COLOUR,
        ),
    }
    body = picture.devices[0].body
    bodies = [DrawnBody("camera", as_points(body), as_faces(body), SIGHT_COLOUR)]
    ball = pv.Sphere(radius=0.017 * size)
    for name, (paths, colour) in drawn.items():
        balls = pv.PolyData(paths[:, -1]).glyph(geom=ball, scale=False, orient=False)
        bodies.append(DrawnBody(name, as_points(balls), as_faces(balls), colour))
    shown = evolve(
        picture,
        surfaces=(*picture.surfaces, *bodies),
        lines=tuple(
            Lines(name, list(paths), colour, width=_RAY_WIDTH)
            for name, (paths, colour) in drawn.items()
        ),
        devices=(),
    )
    box = space.box_around(np.concatenate([one.vertices for one in shown.surfaces]))
    view = space.fitting_view(picture.towards, box, (_PICTURE_PX[0], _PICTURE_PX[1] - _LEGEND_PX))
    shells = f"Hot part in {counted(len(picture.shells), 'shell')} of air (cut open)"
    shift = f"rays bent by up to {1e3 * offset:.3g} µm, drawn {factor:,g} times as large"
    subtitle = f"{shells}  ·  {shift}"
    figure = space.titled_figure("Hot air displaces what a camera sees of a hot part", subtitle)
    draw = partial(add_picture_to, picture=shown)
    axes = space.add_picture(figure, view, box, draw, (0, _LEGEND_PX))
    _name(axes, view.pixels(bodies[0].vertices), "Camera", "above")
    for scale in picture.scales:
        scale.add_bar(figure, cax=figure.add_axes((0.885, 0.22, 0.022, 0.56)))
    marks = [
        Line2D([], [], color=c, marker="o", lw=2, label=name) for name, (_, c) in drawn.items()
    ]
    legend_below(figure, marks, loc="lower center")
    return figure


def as_faces(mesh: pv.PolyData) -> IntArray:
    """(m, 3) array of a mesh's triangles."""
    return np.asarray(mesh.regular_faces, dtype=np.int64)


def _names(view: space.View, device: Device) -> list[tuple[str, FloatArray, str]]:
    """Names in the picture: text, points in the world (mm), and the side of them to write on."""
    camera = device.camera
    aim = view.pixels(np.stack((camera.origin, camera.origin + camera.forward)))
    rises = aim[1, 1] > aim[0, 1]
    # Edges of the view come from the right and spread away from the camera: these sides are free.
    above, below = ("above", "below") if rises else ("below", "above")
    sides = {"Camera": below, "Near": above, "Far": above}
    named = [(name, points) for name, points in device.sight if name]
    named.append((device.name.capitalize(), as_points(device.body)))
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


def _titles(shells: ShellStack, camera: Camera, picture: SpacePicture) -> tuple[str, str]:
    count, drawn = len(shells.shells), len(picture.shells)
    place = ", ".join(f"{value:.4g}" for value in camera.origin).replace("-", "\N{MINUS SIGN}")
    parts = [
        synthetic_mark(shells.source),
        Path(shells.source.path).name if shells.source else None,
        f"{drawn} of {count} shells drawn" if drawn < count else None,
        counted(shells.triangles, "triangle"),
        f"camera at ({place}) mm",
    ]
    *first, last = (device.name for device in picture.devices)
    devices = f", {' and '.join([*first, last])}" if first else f" and {last}"
    return (
        f"Hot part, {counted(count, 'shell')} of hot air (cut open){devices}",
        "  ·  ".join(part for part in parts if part),
    )
