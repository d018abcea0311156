"""Figure of a scene in space: the hot part, its shells of air and the camera."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray
from iriftrace.core.units import counted
from iriftrace.figures import space
from iriftrace.figures.draw import add_picture_to
from iriftrace.figures.picture import SIGHT_COLOUR, Device, SpacePicture, as_points
from iriftrace.figures.scene_picture import scene_picture
from iriftrace.medium.shells.stack import ShellStack
from iriftrace.medium.source import synthetic_mark
from iriftrace.part.part import Part

_PICTURE_PX = (1390, 1080)


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


def _names(view: space.View, device: Device) -> list[tuple[str, FloatArray, str]]:
    """Names in the picture: text, points in the world (mm), and the side of them to write on."""
    camera = device.camera
    aim = view.pixels(np.stack((camera.origin, camera.origin + camera.forward)))
    rises = aim[1, 1] > aim[0, 1]
    # Edges of the view come from the right and spread away from the camera: these sides are free.
    sides = {"Camera": "below" if rises else "above", "Far": "above" if rises else "below"}
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
