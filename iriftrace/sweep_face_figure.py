"""Figures of the part in space, coloured by what a sweep says of each face."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from iriftrace.errors import InputError
from iriftrace.figure_file import check_png_name, write_png
from iriftrace.figure_in_space import SIZE_PX, add_picture, rendered, titled_figure
from iriftrace.figure_scale import colour_norm, even_ticks, round_ticks
from iriftrace.figure_surfaces import surface_of
from iriftrace.figure_view import Box, View, box_around, fitting_view
from iriftrace.part import Part
from iriftrace.sweep_faces import FaceMap, FloatArray
from iriftrace.sweep_scene_figure import towards_cameras
from iriftrace.sweep_style import COLOUR_MAP, TEXT_COLOUR, number
from iriftrace.sweep_summary import SweepSummary

_UNSEEN_COLOUR = "#c9c9c9"
_EDGE_COLOUR = "#303030"
_SHARP_DEG = 30.0

# Below the titles and above the legend, left of the colour bar.
_BODY_PX = (1370, 1010)
_FOOT_PX = 70


def sweep_face_figure(summary: SweepSummary, part: Part, values: FaceMap, path: str | Path) -> None:
    """Draw the part from two sides, coloured face by face, as PNG, 1600 x 1200 pixels.

    Faces that no pose sees are grey. One picture is taken from the side on which the cameras
    stand, the other one from the opposite side; every face shows in one of them, unless another
    piece of the part hides it.

    Parameters
    ----------
    summary
        What is known of the sweep.
    part
        The part that was swept.
    values
        What to show, one of :func:`iriftrace.sweep_faces.face_maps_of`.
    path
        Name of the PNG file; an existing one is replaced.

    Raises
    ------
    InputError
        The part has another number of faces, or the file cannot be written.
    SetupError
        This machine has no OpenGL that draws without a display.
    """
    check_png_name(path)
    if len(part.faces) != len(values.values):
        raise InputError(
            f"The part has {len(part.faces)} faces and the sweep {len(values.values)}, so colours "
            "would lie on the wrong ones; give the part that was swept."
        )
    write_png(_figure(summary, part, values), path)


def _figure(summary: SweepSummary, part: Part, values: FaceMap) -> Figure:
    towards = towards_cameras(summary.origins - part.centre)
    figure = titled_figure(values.title, summary.subtitle)
    box = box_around(part.bounds)
    side_by_side = _is_upright(towards, box)
    width, height = _BODY_PX
    size = (width // 2, height) if side_by_side else (width, height // 2)
    for place, (direction, name) in enumerate(
        ((towards, "From the cameras' side, above"), (-towards, "From the opposite side, below"))
    ):
        view = fitting_view(direction, box, size)
        picture = rendered(view, box, lambda plotter: _draw(plotter, part, values))
        corner = (place * size[0], 0) if side_by_side else (0, (1 - place) * size[1])
        axes = add_picture(figure, picture, view, box, (corner[0], corner[1] + _FOOT_PX))
        axes.text(30, size[1] - 20, name, fontsize=9, color=TEXT_COLOUR, ha="left", va="top")
    _add_colour_bar(figure, values)
    _add_legend(figure, values)
    return figure


def _is_upright(towards: FloatArray, box: Box) -> bool:
    spread = np.ptp(View(towards, box.centre, 1.0, SIZE_PX).pixels(box.corners), axis=0)
    return bool(spread[1] > spread[0])


def _draw(plotter: pv.Plotter, part: Part, values: FaceMap) -> None:
    surface = surface_of(part.vertices, part.faces)
    known = np.isfinite(values.values)
    colours = np.empty((len(part.faces), 3), dtype=np.uint8)
    colours[:] = [int(_UNSEEN_COLOUR[i : i + 2], 16) for i in (1, 3, 5)]
    norm = colour_norm(values.limits)
    painted = colormaps[COLOUR_MAP](norm(values.values[known]))[:, :3]
    colours[known] = np.rint(255.0 * painted)
    surface.cell_data["colour"] = colours
    # Mostly ambient: shading must not change what the colour bar says.
    plotter.add_mesh(surface, scalars="colour", rgb=True, ambient=0.8, diffuse=0.25, specular=0.0)
    edges = surface.clean().extract_feature_edges(
        feature_angle=_SHARP_DEG, non_manifold_edges=False, manifold_edges=False
    )
    if edges.n_cells:
        plotter.add_mesh(edges, color=_EDGE_COLOUR, line_width=2, lighting=False)


def _add_colour_bar(figure: Figure, values: FaceMap) -> None:
    norm = colour_norm(values.limits)
    low, high = values.limits
    known = values.values[np.isfinite(values.values)]
    below, above = bool(known.min() < low * (1 - 1e-9)), bool(known.max() > high * (1 + 1e-9))
    extend = {(True, True): "both", (True, False): "min", (False, True): "max"}
    bar = figure.colorbar(
        ScalarMappable(norm, COLOUR_MAP),
        cax=figure.add_axes((0.872, 0.2, 0.02, 0.62)),
        extend=extend.get((below, above), "neither"),
        label=values.label,
    )
    ticks = (round_ticks if low > 0.0 else even_ticks)(values.limits).tolist()
    bar.set_ticks(ticks, labels=[number(tick) for tick in ticks])
    bar.set_ticks([], minor=True)


def _add_legend(figure: Figure, values: FaceMap) -> None:
    unseen = int(np.count_nonzero(~np.isfinite(values.values)))
    text = f"Seen by no pose: {unseen:,} of {len(values.values):,} faces"
    figure.legend(
        handles=[Patch(facecolor=_UNSEEN_COLOUR, edgecolor="0.4", label=text)],
        loc="lower center",
        bbox_to_anchor=(0.5, 0.005),
        fontsize=9,
        frameon=False,
    )
