"""Drawing of the description of a picture by VTK, for the window and for images."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
from matplotlib import colormaps

from iriftrace.core.mesh.triangles import polydata
from iriftrace.figures.picture import Device, DrawnBody, Lines, SpacePicture

SCALAR_BAR: Any = {
    **{"vertical": True, "position_x": 0.84, "position_y": 0.2, "height": 0.6},
    **{"title_font_size": 22, "label_font_size": 18, "fmt": "%.4g"},
}
"""Next to the drawn objects, not over its axes."""


def add_picture_to(plotter: pv.Plotter, picture: SpacePicture) -> None:
    """Add all that is not hidden, with the mean of an ensemble's members or the first of them.

    Shells come last and the outermost first: with the near half cut away it is the farthest, so
    that blending in the order of drawing is right and no sorting (depth peeling) is needed.
    """
    hidden = picture.hidden
    shown = [one for one in picture.surfaces if not one.member and one.name not in hidden]
    if picture.poses is not None:
        shown.append(picture.poses.cones)
    for surface in sorted(shown, key=lambda surface: surface.opacity < 1.0):
        if surface.is_shell:
            _add_shell(plotter, surface, picture)
        elif surface.scale is not None:
            _add_values(plotter, surface)
        else:
            _add_body(plotter, surface)
    for device in picture.devices:
        if device.name not in hidden:
            _add_device(plotter, device)
    for lines in picture.lines:
        _add_lines(plotter, lines)


def _add_body(plotter: pv.Plotter, surface: DrawnBody) -> None:
    """Add a surface in one colour, with its edges sharp; or seen through, from outside."""
    mesh = surface.mesh
    if surface.opacity < 1.0:
        look: dict[str, Any] = {"opacity": surface.opacity, "culling": "back", "ambient": 0.5}
        plotter.add_mesh(mesh, color=surface.colour, smooth_shading=True, **look)
        return
    mesh = mesh.clean().compute_normals(
        split_vertices=True, feature_angle=30.0, auto_orient_normals=False
    )
    look = {"smooth_shading": True, "ambient": 0.35, "specular": 0.2}
    plotter.add_mesh(mesh, color=surface.colour, **look)


def _add_shell(plotter: pv.Plotter, surface: DrawnBody, picture: SpacePicture) -> None:
    """Add the part of a shell behind the cut, and the line of the cut."""
    assert surface.scale is not None
    assert isinstance(surface.values, float)
    assert picture.cut is not None
    centre, side = picture.cut
    colour = surface.scale.rgb([surface.values])[0]
    rest, cut = (get(normal=side, origin=centre) for get in (surface.mesh.clip, surface.mesh.slice))
    if rest.n_cells:
        look: dict[str, Any] = {"opacity": surface.opacity, "ambient": 0.4, "diffuse": 0.6}
        plotter.add_mesh(rest, color=colour, smooth_shading=surface.normals is not None, **look)
    if cut.n_cells:
        plotter.add_mesh(cut, color=colour, line_width=2.5, lighting=False)


def _add_values(plotter: pv.Plotter, surface: DrawnBody) -> None:
    """Add a surface in the colours of its numbers.

    The bar has an extra field for values beyond, in the colour of its end.
    """
    scale, values = surface.scale, np.asarray(surface.values)
    assert scale is not None
    mesh = pv.PolyData(surface.vertices)
    if not surface.of_points:
        mesh = polydata(surface.vertices, surface.faces)
    of_vertices = surface.number_of == "vertex"
    (mesh.point_data if of_vertices else mesh.cell_data)[scale.label] = values
    (low, high), colours = scale.limits, colormaps[scale.colour_map]
    points: dict[str, Any] = {
        "render_points_as_spheres": True,
        "point_size": 5.0,
        "lighting": False,
    }
    plotter.add_mesh(
        mesh,
        scalars=scale.label,
        clim=(low, high),
        log_scale=scale.logarithmic,
        cmap=colours,
        nan_color=surface.colour,
        above_color=colours(1.0) if (values > high).any() else None,
        below_color=colours(0.0) if (values < low).any() else None,
        scalar_bar_args=SCALAR_BAR,
        **(points if surface.of_points else {}),
    )


def _add_device(plotter: pv.Plotter, device: Device) -> None:
    plotter.add_mesh(device.body, color=device.colour, ambient=0.3)
    _add_lines(plotter, Lines("", [points for _, points in device.sight], device.colour))


def _add_lines(plotter: pv.Plotter, lines: Lines) -> None:
    for path in lines.drawn:
        line = pv.lines_from_points(path)
        width = 1.5 if lines.straight else 3
        plotter.add_mesh(line, color=lines.colour, line_width=width, lighting=False)
