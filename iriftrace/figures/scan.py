"""Figures of a simulated measurement and of a correction, as deviation maps show them."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from attrs import evolve
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray
from iriftrace.core.plain import JsonObject
from iriftrace.figures.style import ColourScale, finish_axes, new_figure
from iriftrace.measuring.two_devices.correction import Correction
from iriftrace.measuring.two_devices.scan import Scan, ScanStatus
from iriftrace.medium.source import stated_source, synthetic_mark
from iriftrace.part.part import Part
from iriftrace.sweep.measures import Limits

MOST_POINTS = 300_000
"""Largest number of points that the figure of a correction draws."""


def scan_figure(scan: Scan, part: Part) -> Figure:
    """Draw the error along the part's normal, in the camera's picture and as a histogram.

    Colours are symmetric about 0 up to the 99th percentile of the errors' sizes; pixels on the part
    that were not measured are dark grey.
    """
    error = 1e3 * scan.error_normal
    title = f"What hot air adds to a {scan.system} measurement"
    figure, body, (left, right) = _panels(title, scan.provenance, _spread(error), "measured")
    limit = float(np.percentile(np.abs(error), 99))
    scale = _scale(error, limit)
    draw_part(left, part, scan.camera, scan.pixel)
    if scan.one_line:
        # Rows and columns of the status are those of the sheet, not of the camera.
        _draw_points(left, body, scan.pixel, scale)
    else:
        picture = np.full(scan.status.shape, np.nan)
        picture[scan.status == ScanStatus.MEASURED] = error
        lost = np.isin(scan.status, (ScanStatus.MEASURED, ScanStatus.NOT_SEEN), invert=True)
        limits = left.axis()
        left.imshow(np.where(lost, 1.0, np.nan), cmap="Greys", vmin=0.0, vmax=2.0)
        shown = left.imshow(picture, interpolation="none", **scale.look)
        left.axis(limits)
        scale.add_bar(body, shown, ax=left, location="bottom")
    _, _, left_over = scan.best_fit()
    errors = {"as measured": error, "after best fit": 1e3 * left_over}
    _draw_histogram(right, errors, (-1.5 * limit, 1.5 * limit), "error along the normal (µm)")
    right.axvline(0.0, color="0.5", linewidth=0.8)
    return figure


def correction_figure(found: Correction, part: Part, camera: Camera) -> Figure:
    """Draw the removed errors along the part's normal, and the deviation from the part.

    The errors that the corrections remove are drawn in the camera's picture, the deviations of the
    points as measured and corrected as histograms. Points without a correction are dark grey. Of a
    larger cloud one of every so many points is drawn, at most `MOST_POINTS`.
    """
    rows = slice(None, None, 1 + len(found.status) // MOST_POINTS)
    measured, error, face = found.measured[rows], found.error[rows], found.face[rows]
    good, normal = found.corrected[rows], found.face_normals[face]
    along = 1e3 * np.einsum("ij,ij->i", error, normal)[good]
    title = "What hot air added to the measured points"
    figure, body, (left, right) = _panels(title, found.provenance, _spread(along), "corrected")
    scale = _scale(along, max(float(np.percentile(np.abs(along), 99)), 1e-6))
    place = camera.project(measured)
    draw_part(left, part, camera, place[good])
    left.plot(*place[~good].T, "o", markersize=0.6, color="0.5", scalex=False, scaley=False)
    _draw_points(left, body, place[good], scale)
    deviations = {
        name: 1e3 * (np.einsum("ij,ij->i", points, normal) - part.face_offsets[face])[good]
        for name, points in (("as measured", measured), ("corrected", measured - error))
    }
    low, high = np.percentile(np.concatenate(list(deviations.values())), (1, 99))
    _draw_histogram(right, deviations, (low, high), "deviation from the part (µm)")
    return figure


def _panels(
    title: str, provenance: JsonObject, subtitle: str, outcome: str
) -> tuple[Figure, SubFigure, tuple[Axes, Axes]]:
    """A figure with room for a picture and a histogram; marked if the field is synthetic."""
    subtitle += f"; light grey: part, dark: not {outcome}"
    mark = synthetic_mark(stated_source(provenance["field"]))
    figure, body = new_figure(8.0, 4.4, title + (f" ({mark})" if mark else ""), subtitle)
    left, right = body.subplots(1, 2, width_ratios=(3, 2))
    left.set_xlabel("camera's picture (px)")
    return figure, body, (left, right)


def draw_part(axes: Axes, part: Part, camera: Camera, place: FloatArray) -> None:
    """Fill what a camera sees of a part, which with the places (n, 2), px, limits the axes."""
    corners = camera.project(part.vertices)[part.faces]
    corners = corners[np.isfinite(corners).all(axis=(1, 2))]
    # The union of triangles that are all the same way round has no seams.
    turned = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
    corners[turned] = corners[turned, ::-1]
    path = Path(
        corners[:, (0, 1, 2, 0)].reshape(-1, 2),
        np.tile((Path.MOVETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY), len(corners)),
    )
    axes.add_artist(PathPatch(path, facecolor="0.85", linewidth=0.0, zorder=-1.0))
    seen = np.clip(corners.reshape(-1, 2), 0.0, np.array(camera.resolution) - 1.0)
    (left, top), (right, bottom) = (
        extreme(np.vstack((seen, place)), axis=0) for extreme in (np.min, np.max)
    )
    room = 0.02 * max(right - left, bottom - top)
    axes.set(xlim=(left - room, right + room), ylim=(bottom + room, top - room), aspect="equal")


def _draw_points(axes: Axes, body: SubFigure, place: FloatArray, scale: ColourScale) -> None:
    """Draw means of the scale's values at places (n, 2), px, in hexagons, with a colour bar."""
    left, right, bottom, top = axes.axis()
    count = 120, max(1, round(120 / math.sqrt(3.0) * (bottom - top) / (right - left)))
    extent, (u, v) = (left, right, top, bottom), place.T
    shown = axes.hexbin(u, v, scale.values, gridsize=count, extent=extent, **scale.look)
    axes.axis((left, right, bottom, top))
    bins = evolve(scale, values=np.asarray(shown.get_array()))
    bins.add_bar(body, shown, ax=axes, location="bottom")


def _scale(um: FloatArray, limit: float) -> ColourScale:
    """Colours about 0 of errors, um."""
    return ColourScale(um, (-limit, limit), "error along the normal (µm)", False, "RdBu_r")


def _draw_histogram(axes: Axes, um: Mapping[str, FloatArray], ends: Limits, label: str) -> None:
    """Count values, um, by name; those beyond the ends count in the last bins."""
    bins = np.linspace(*ends, 61).tolist()
    for name, values in um.items():
        axes.hist(values.clip(*ends), bins, histtype="step", label=name)
    beyond = any((values < ends[0]).any() or (values > ends[1]).any() for values in um.values())
    more = "\nouter bins: all points beyond, too" if beyond else ""
    axes.set(xlabel=label + more, ylabel="points")
    axes.legend(fontsize="small")
    finish_axes(axes)


def _spread(along: FloatArray) -> str:
    """Median and percentiles of errors along the normal, µm, in words."""
    low, middle, high = np.percentile(along, (5, 50, 95))
    return (
        f"median {middle:.3g} µm, 5th to 95th percentile {low:.3g} to {high:.3g} µm along the "
        "part's normal"
    )
