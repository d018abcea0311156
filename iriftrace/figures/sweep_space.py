"""Figures of a sweep in space: a metric as the colour of the poses, or of the part's faces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import pyvista as pv
from matplotlib.artist import Artist
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from scipy.spatial import KDTree

from iriftrace.core.arrays import BoolArray, FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.mesh.triangles import polydata
from iriftrace.figures import space
from iriftrace.figures.draw import add_picture_to
from iriftrace.figures.picture import (
    BLOCKER_COLOUR,
    PART_COLOUR,
    UNKNOWN_COLOUR,
    DrawnBody,
    SpacePicture,
    part_surface,
)
from iriftrace.figures.style import (
    BEST_RING,
    TEXT_COLOUR,
    WARNED,
    ColourScale,
    legend_below,
    marks,
    scale_of,
)
from iriftrace.part.part import Part
from iriftrace.planning.quantities import PoseQuantity
from iriftrace.planning.summary import SweepSummary
from iriftrace.sweep.faces import FaceMap
from iriftrace.sweep.reload import Surroundings

# Room for pictures: below the titles and above the legend, left of the colour bar.
_ROOM_PX = (1370, 1010)
_FOOT_PX = 70

_SHELL_COLOUR = "#7aa6c9"
_SHELL_OPACITY = 0.25
_RING_COLOUR = "#7f7f7f"
_EDGE_COLOUR = "#303030"
_SHARP_DEG = 30.0

# Radius of a pose's mark, as a fraction of the distance to its neighbour in the picture.
_MARK_SHARE = 0.5
_MARK_PX = (6.0, 16.0)
_FAR_SIZE = 0.65


def sweep_scene_figure(
    summary: SweepSummary, quantity: PoseQuantity, surroundings: Surroundings
) -> Figure:
    """Draw the poses of a sweep in space, coloured by a metric, 1600 x 1200 pixels.

    Spheres mark the positions of the cameras, larger the nearer they are to the viewer; a pose
    without a number is an open grey ring. For poses with other fields or focal lengths at one
    place the best by score is shown.

    Parameters
    ----------
    summary
        Summary of the sweep.
    quantity
        The metric, one of the summary's.
    surroundings
        Other objects to draw.

    Raises
    ------
    SetupError
        This machine has no OpenGL that draws without a display.
    """
    part, shell = surroundings.part, surroundings.hot_air
    solid = [part.bounds] if part else []
    solid += [vertices for vertices, _ in surroundings.blockers]
    air = [shell[0].astype(np.float64)] if shell else []
    box = space.box_around(np.concatenate((summary.origins, summary.targets, *solid, *air)))
    centre = part.centre if part else box.centre
    view = space.fitting_view(towards_cameras(summary.origins - centre), box, _ROOM_PX)
    radii = _mark_radii(summary.origins, view)
    shown = best_at_each_place(summary)
    known, unknown = shown & quantity.known, shown & ~quantity.known
    scale = scale_of(quantity)

    def draw(plotter: pv.Plotter) -> None:
        ball = pv.Sphere(radius=1.0, theta_resolution=24, phi_resolution=24)
        spheres = _marks(ball, summary.origins[known], radii[known])
        colours = scale.rgb(quantity.values[known])
        _add_coloured(plotter, spheres, np.repeat(colours, ball.n_points, axis=0), "point")
        ring = pv.Disc(inner=0.72, outer=1.0, normal=view.towards, c_res=32)
        rings = _marks(ring, summary.origins[unknown], radii[unknown])
        if rings.n_cells:
            plotter.add_mesh(rings, color=_RING_COLOUR, lighting=False)
        add_picture_to(plotter, surroundings_picture(surroundings))

    hidden = "" if shown.all() else "  ·  the best at each place"
    entries = [*marks(summary, ~quantity.known, BEST_RING), *_surroundings_entries(surroundings)]
    title = f"{quantity.title} of each camera pose"
    figure = _framed(title, f"{summary.subtitle}{hidden}", scale, entries)
    axes = space.add_picture(figure, view, box, draw, (0, _FOOT_PX))
    warned = summary.origins[shown & summary.warned.any(axis=1)]
    axes.plot(*view.pixels(warned).T, **WARNED)
    axes.plot(*view.pixels(summary.origins[summary.plan.best])[0], **BEST_RING)
    return figure


def surroundings_picture(surroundings: Surroundings) -> SpacePicture:
    """Part, what blocks the view, and the outermost shell, which is seen through."""
    surfaces = []
    if surroundings.part:
        surfaces.append(part_surface(surroundings.part))
    surfaces += [
        DrawnBody("blocks the view", vertices, faces, BLOCKER_COLOUR)
        for vertices, faces in surroundings.blockers
    ]
    if surroundings.hot_air:
        look: dict[str, Any] = {"colour": _SHELL_COLOUR, "opacity": _SHELL_OPACITY}
        surfaces.append(DrawnBody("outermost shell", *surroundings.hot_air, **look))
    return SpacePicture("", surfaces=tuple(surfaces))


def _surroundings_entries(surroundings: Surroundings) -> list[Artist]:
    """Legend entries for everything that is drawn besides the poses."""
    entries: list[Artist] = []
    if surroundings.part:
        entries.append(Patch(facecolor=PART_COLOUR, label="Part"))
    if surroundings.blockers:
        entries.append(Patch(facecolor=BLOCKER_COLOUR, label="Blocks the view"))
    if surroundings.hot_air:
        entries.append(Patch(facecolor=_SHELL_COLOUR, alpha=0.5, label="Outermost shell"))
    return entries


def sweep_face_figure(summary: SweepSummary, part: Part, values: FaceMap) -> Figure:
    """Draw the part from two sides, coloured face by face, 1600 x 1200 pixels.

    Faces that no pose sees are grey. One picture is taken from the side on which the cameras
    stand, the other one from the opposite side; every face shows in one of them, unless another
    piece of the part hides it.

    Parameters
    ----------
    summary
        Summary of the sweep.
    part
        The part that was swept.
    values
        The map to show, one of :func:`iriftrace.sweep.faces.face_maps_of`.

    Raises
    ------
    InputError
        The part has another number of faces.
    SetupError
        This machine has no OpenGL that draws without a display.
    """
    if len(part.faces) != len(values.values):
        raise InputError(
            f"The part has {len(part.faces)} faces and the sweep {len(values.values)}, so colours "
            "would lie on the wrong ones; give the part that was swept.",
            code="sweep.face_count",
        )
    scale = ColourScale(values.values, values.limits, values.label, values.limits[0] > 0.0)
    seen = np.isfinite(values.values)
    surface = polydata(part.vertices, part.faces)
    colours = np.tile(to_rgb(UNKNOWN_COLOUR), (len(part.faces), 1))
    colours[seen] = scale.rgb(values.values[seen])

    def draw(plotter: pv.Plotter) -> None:
        _add_coloured(plotter, surface, colours, "cell")
        edges = surface.clean().extract_feature_edges(
            feature_angle=_SHARP_DEG, non_manifold_edges=False, manifold_edges=False
        )
        if edges.n_cells:
            plotter.add_mesh(edges, color=_EDGE_COLOUR, line_width=2, lighting=False)

    text = f"Seen by no pose: {np.count_nonzero(~seen):,} of {len(seen):,} faces"
    entries = [Patch(facecolor=UNKNOWN_COLOUR, edgecolor="0.4", label=text)]
    figure = _framed(values.title, summary.subtitle, scale, entries)
    towards = towards_cameras(summary.origins - part.centre)
    box = space.box_around(part.bounds)
    across, up = np.ptp(
        space.View(towards, box.centre, 1.0, space.SIZE_PX).pixels(box.corners), axis=0
    )
    width, height = _ROOM_PX
    side_by_side = up > across
    size = (width // 2, height) if side_by_side else (width, height // 2)
    low = (0, _FOOT_PX)
    corners = (low, (size[0], _FOOT_PX)) if side_by_side else ((0, size[1] + _FOOT_PX), low)
    names = ("From the cameras' side, above", "From the opposite side, below")
    for direction, name, corner in zip((towards, -towards), names, corners, strict=True):
        axes = space.add_picture(
            figure, space.fitting_view(direction, box, size), box, draw, corner
        )
        axes.text(30, size[1] - 20, name, fontsize=9, color=TEXT_COLOUR, ha="left", va="top")
    return figure


def towards_cameras(offsets: FloatArray) -> FloatArray:
    """Unit vector to the viewer: the side on which the cameras stand, never along x or y."""
    directions = offsets / np.linalg.norm(offsets, axis=1, keepdims=True)
    mean = directions.mean(axis=0)
    # Cameras all around do not determine the side.
    azimuth = np.arctan2(mean[1], mean[0]) if np.hypot(*mean[:2]) > 0.1 else np.radians(-60.0)
    turns = azimuth + np.radians((0.0, 15.0, -15.0, 30.0, -30.0))
    return space.oblique(np.stack((np.cos(turns), np.sin(turns), 0.0 * turns), axis=1))


def best_at_each_place(summary: SweepSummary) -> BoolArray:
    """(n,) mask: of poses with other fields or focal lengths at one place, the best by score."""
    score = np.where(np.isfinite(summary.score.values), summary.score.values, np.inf)
    order = np.argsort(score, kind="stable")
    _, first = np.unique(np.round(summary.origins[order], 6), axis=0, return_index=True)
    shown = np.zeros(len(order), dtype=np.bool_)
    shown[order[first]] = True
    return shown


def _mark_radii(places: FloatArray, view: space.View) -> FloatArray:
    """(n,) array, mm: radii of marks at (n, 3) places, larger the nearer they are to the viewer."""
    positions, px = view.pixels(np.unique(places, axis=0)), _MARK_PX[1]
    if len(positions) > 1:
        # Most marks do not touch.
        distance, _ = KDTree(positions).query(positions, k=2)
        px = float(np.clip(_MARK_SHARE * np.median(distance[:, 1]), *_MARK_PX))
    depth = places @ view.towards
    near = (depth - depth.min()) / max(float(np.ptp(depth)), 1e-9)
    radii: FloatArray = px / view.px_per_mm * (_FAR_SIZE + (1.0 - _FAR_SIZE) * near)
    return radii


def _marks(shape: pv.PolyData, places: FloatArray, radii: FloatArray) -> pv.PolyData:
    """Copies of a shape of radius 1, one for each place, in their order."""
    if not len(places):
        return pv.PolyData()
    points = pv.PolyData(places)
    points["radius"] = radii
    copies: pv.PolyData = points.glyph(geom=shape, orient=False, scale="radius", factor=1.0)
    return copies


def _add_coloured(
    plotter: pv.Plotter, surface: pv.PolyData, colours: FloatArray, each: Literal["point", "cell"]
) -> None:
    """Add a surface with a colour, 0 to 1, for each of its points or cells."""
    if surface.n_cells:
        data = surface.point_data if each == "point" else surface.cell_data
        data["colour"] = np.rint(255.0 * colours).astype(np.uint8)
        # Mostly ambient: shading must not change the colours that the bar explains.
        plotter.add_mesh(
            surface,
            scalars="colour",
            preference=each,
            rgb=True,
            ambient=0.78,
            diffuse=0.27,
            specular=0.0,
        )


def _framed(title: str, subtitle: str, scale: ColourScale, entries: Sequence[Artist]) -> Figure:
    """Titles, colour bar and legend around the room for pictures."""
    figure = space.titled_figure(title, subtitle)
    scale.add_bar(figure, cax=figure.add_axes((0.872, 0.2, 0.02, 0.62)))
    place = {"loc": "lower center", "bbox_to_anchor": (0.5, 0.005), "columnspacing": 1.2}
    legend_below(figure, entries, len(entries), **place)
    return figure
