"""What a camera looks like in a figure: its body, the edges of its view, its focus interval."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from iriftrace.camera import Camera
from iriftrace.part import Part

FloatArray = NDArray[np.float64]


def camera_body(camera: Camera, size: float) -> pv.PolyData:
    """A box and a lens behind the pinhole; mm, world.

    Parameters
    ----------
    camera
        Whose pose it is.
    size
        About the width of the body, mm.
    """
    box = pv.Cube(
        center=(0.0, 0.0, -0.75 * size),
        x_length=1.3 * size,
        y_length=0.95 * size,
        z_length=0.9 * size,
    )
    lens = pv.Cylinder(
        center=(0.0, 0.0, -0.15 * size),
        direction=(0.0, 0.0, 1.0),
        radius=0.36 * size,
        height=0.3 * size,
        resolution=48,
    )
    body: pv.PolyData = box.triangulate().append_polydata(lens.triangulate())
    moved: pv.PolyData = body.transform(camera.matrix, inplace=False)
    return moved


def sight_lines(camera: Camera, part: Part) -> list[tuple[str, FloatArray]]:
    """Edges of a camera's view and outlines of its focus interval.

    Parameters
    ----------
    camera
        The camera. Where its far focus lies well behind the part, the edges end earlier and there
        is no outline of it.
    part
        What it looks at.

    Returns
    -------
    list of (name, points)
        Polylines, (n, 3) arrays, mm, world; the names of the edges are empty.
    """
    local = camera.to_camera(part.vertices)
    pinhole = camera.projection == "pinhole"
    distances = np.linalg.norm(local, axis=1) if pinhole else local[:, 2]
    near, far = camera.focus_mm
    # A far end that lies well behind the part would make the part small in the picture.
    reach = min(far, 1.3 * float(distances.max()))
    width, height = camera.resolution
    corners = np.array([(0, 0), (width, 0), (width, height), (0, height)], dtype=np.float64)
    shares = np.linspace(0.0, 1.0, 17)[:-1, None]
    sides = [a + shares * (b - a) for a, b in zip(corners, np.roll(corners, -1, 0), strict=True)]
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
