"""Figures of a sweep in space: one metric as the colour of the poses around the part."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray
from scipy.spatial import KDTree

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.figures.space import (
    PART_COLOUR,
    SIZE_PX,
    Box,
    View,
    add_part,
    add_picture,
    box_around,
    fitting_view,
    rendered,
    thinned,
    titled_figure,
)
from iriftrace.figures.style import (
    BEST_RING,
    COLOUR_MAP,
    TEXT_COLOUR,
    add_colour_bar,
    check_png_name,
    colour_norm,
    even_ticks,
    marks,
    number,
    quantity_norm,
    round_ticks,
    write_png,
)
from iriftrace.geometry.triangles import polydata
from iriftrace.part.part import Part
from iriftrace.planning.quantities import Quantity
from iriftrace.planning.summary import SweepSummary
from iriftrace.sweep.faces import FaceMap
from iriftrace.sweep.reload import Surroundings

_PICTURE_PX = (1370, 1020)
_PICTURE_FOOT_PX = 70

_SHELL_COLOUR = "#7aa6c9"
_SHELL_OPACITY = 0.25
_UNKNOWN_COLOUR = "#7f7f7f"

# Radius of a pose's mark, as a share of the distance to its neighbour in the picture.
_MARK_SHARE = 0.5
_MARK_PX = (6.0, 16.0)
_FAR_SIZE = 0.65


def sweep_scene_figure(
    summary: SweepSummary, quantity: Quantity, surroundings: Surroundings, path: str | Path
) -> None:
    """Draw the poses of a sweep in space, coloured by a metric, as PNG, 1600 x 1200 pixels.

    Spheres stand where the cameras stand, larger the nearer they are to the viewer; a pose without
    a number is an open grey ring.

    Parameters
    ----------
    summary
        What is known of the sweep.
    quantity
        The metric, one of the summary's.
    surroundings
        What is drawn besides.
    path
        Name of the PNG file; an existing one is replaced.

    Raises
    ------
    InputError
        The file cannot be written.
    SetupError
        This machine has no OpenGL that draws without a display.
    """
    check_png_name(path)
    write_png(_figure(summary, quantity, surroundings), path)


def _figure(summary: SweepSummary, quantity: Quantity, surroundings: Surroundings) -> Figure:
    part, shell = surroundings.part, surroundings.shell
    solid = [part.bounds] if part else []
    air = [shell[0].astype(np.float64)] if shell else []
    box = box_around(np.concatenate((summary.origins, summary.targets, *solid, *air)))
    centre = part.centre if part else box.centre
    view = fitting_view(towards_cameras(summary.origins - centre), box, _PICTURE_PX)
    radius = _mark_px(view.pixels(np.unique(summary.origins, axis=0))) / view.px_per_mm
    depth = summary.origins @ view.towards
    near = (depth - depth.min()) / max(float(np.ptp(depth)), 1e-9)
    radii = radius * (_FAR_SIZE + (1.0 - _FAR_SIZE) * near)
    shown = _best_at_each_place(summary)
    known, unknown = shown & quantity.known, shown & ~quantity.known

    def draw(plotter: pv.Plotter) -> None:
        if part:
            add_part(plotter, part)
        _add_spheres(
            plotter, summary.origins[known], quantity, quantity.values[known], radii[known]
        )
        _add_rings(plotter, summary.origins[unknown], view, radii[unknown])
        if shell:
            # Last, because it is blended with what lies behind it; only its front.
            plotter.add_mesh(
                thinned(polydata(*shell)),
                color=_SHELL_COLOUR,
                opacity=_SHELL_OPACITY,
                culling="back",
                smooth_shading=True,
                ambient=0.5,
            )

    picture = rendered(view, box, draw)
    return _composed(picture, view, box, summary, quantity, surroundings)


def towards_cameras(offsets: FloatArray) -> FloatArray:
    """Unit vector to the viewer: the side on which the cameras stand, never along x or y."""
    directions = offsets / np.linalg.norm(offsets, axis=1, keepdims=True)
    mean = directions.mean(axis=0)
    # Cameras all around leave the side open.
    azimuth = np.arctan2(mean[1], mean[0]) if np.hypot(*mean[:2]) > 0.1 else np.radians(-60.0)
    turns = azimuth + np.radians((0.0, 15.0, -15.0, 30.0, -30.0))
    level = min(turns, key=lambda turn: round(abs(abs(np.cos(turn)) - abs(np.sin(turn))), 6))
    elevation = np.radians(20.0)
    return np.array(
        (
            np.cos(elevation) * np.cos(level),
            np.cos(elevation) * np.sin(level),
            np.sin(elevation),
        )
    )


def _mark_px(positions: FloatArray) -> float:
    """Radius at which most marks do not touch, px."""
    if len(positions) < 2:
        return _MARK_PX[1]
    distance, _ = KDTree(positions).query(positions, k=2)
    return float(np.clip(_MARK_SHARE * np.median(distance[:, 1]), *_MARK_PX))


def _best_at_each_place(summary: SweepSummary) -> NDArray[np.bool_]:
    """(n,) mask: of poses with other fields or focal lengths at one place, the best by score."""
    score = np.where(np.isfinite(summary.score.values), summary.score.values, np.inf)
    order = np.argsort(score, kind="stable")
    _, first = np.unique(np.round(summary.origins[order], 6), axis=0, return_index=True)
    shown = np.zeros(len(order), dtype=np.bool_)
    shown[order[first]] = True
    return shown


def _add_spheres(
    plotter: pv.Plotter,
    origins: FloatArray,
    quantity: Quantity,
    values: FloatArray,
    radii: FloatArray,
) -> None:
    if len(origins) == 0:
        return
    colours = colormaps[COLOUR_MAP](quantity_norm(quantity)(values))[:, :3]
    points = pv.PolyData(origins)
    points["colour"] = np.rint(255 * colours).astype(np.uint8)
    points["radius"] = radii
    sphere = pv.Sphere(radius=1.0, theta_resolution=24, phi_resolution=24)
    spheres = points.glyph(geom=sphere, orient=False, scale="radius", factor=1.0)
    # Mostly ambient: shading must not change what the colour bar says.
    plotter.add_mesh(spheres, scalars="colour", rgb=True, ambient=0.75, diffuse=0.3, specular=0.0)


def _add_rings(plotter: pv.Plotter, origins: FloatArray, view: View, radii: FloatArray) -> None:
    if len(origins) == 0:
        return
    points = pv.PolyData(origins)
    points["radius"] = radii
    ring = pv.Disc(inner=0.72, outer=1.0, normal=view.towards, c_res=32)
    rings = points.glyph(geom=ring, orient=False, scale="radius", factor=1.0)
    plotter.add_mesh(rings, color=_UNKNOWN_COLOUR, lighting=False)


def _composed(
    picture: NDArray[np.uint8],
    view: View,
    box: Box,
    summary: SweepSummary,
    quantity: Quantity,
    surroundings: Surroundings,
) -> Figure:
    """Put the rendered picture under labels, titles, colour bar and legend."""
    hidden = "" if _best_at_each_place(summary).all() else "  ·  the best at each place"
    figure = titled_figure(f"{quantity.title} of each camera pose", f"{summary.subtitle}{hidden}")
    axes = add_picture(figure, picture, view, box, (0, _PICTURE_FOOT_PX))
    best = view.pixels(summary.origins[summary.plan.best])[0]
    axes.plot(*best, **BEST_RING)
    add_colour_bar(figure, quantity, cax=figure.add_axes((0.872, 0.2, 0.02, 0.62)))
    entries: list[Line2D | Patch] = [*marks(summary, ~quantity.known, BEST_RING)]
    if surroundings.part:
        entries.append(Patch(facecolor=PART_COLOUR, label="Part"))
    if surroundings.shell:
        entries.append(Patch(facecolor=_SHELL_COLOUR, alpha=0.5, label="Outermost shell of air"))
    figure.legend(
        handles=entries,
        loc="lower center",
        bbox_to_anchor=(0.5, 0.005),
        ncols=len(entries),
        fontsize=9,
        frameon=False,
    )
    return figure


# MERGE sweep_face_figure: Figures of the part in space, coloured by what a sweep says of each fac

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
        What to show, one of :func:`iriftrace.sweep.faces.face_maps_of`.
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
    write_png(_sweep_face_figure_figure(summary, part, values), path)


def _sweep_face_figure_figure(summary: SweepSummary, part: Part, values: FaceMap) -> Figure:
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
    surface = polydata(part.vertices, part.faces)
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
