"""Figures of a simulated measurement and of a correction, as deviation maps show them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from attrs import evolve
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray
from iriftrace.core.plain import JsonObject
from iriftrace.figures.style import (
    COLOURS,
    SIGNED_COLOUR_MAP,
    ColourScale,
    finish_axes,
    new_figure,
    wrapped,
)
from iriftrace.measuring.two_devices.correction import Correction
from iriftrace.measuring.two_devices.scan import Scan, ScanStatus
from iriftrace.medium.source import stated_source, synthetic_mark
from iriftrace.part.part import Part
from iriftrace.sweep.measures import Limits

MOST_POINTS = 300_000
"""Of a larger cloud one of every so many points is drawn."""

_ERROR = "error along the normal (µm)"
_WIDE = 1.6, 3.0
"""Width over height from which on a single map lies above the histogram, and several in a stack."""

_HISTOGRAM = "histogram"
_WIDTH_IN = 7.0


def scan_figure(scan: Scan, part: Part) -> Figure:
    """Draw the error along the part's normal, in the camera's picture and as a histogram.

    Colours are symmetric about 0 up to the 99th percentile of the errors' sizes; pixels on the part
    that were not measured are dark grey.
    """
    error = 1e3 * scan.error_normal
    title = f"What hot air adds to a {scan.system} measurement"
    view = PartOutline(part, scan.camera, scan.pixel)
    figure, body, (axes,), right = _panels(title, scan.provenance, _spread(error), "measured", view)
    limit = float(np.percentile(np.abs(error), 99))
    scale = _scale(error, limit, _ERROR)
    if scan.one_line:
        # Rows and columns of the status are those of the sheet, not of the camera.
        _draw_points(axes, scan.pixel, scale)
    else:
        picture = np.full(scan.status.shape, np.nan)
        picture[scan.status == ScanStatus.MEASURED] = error
        lost = np.isin(scan.status, (ScanStatus.MEASURED, ScanStatus.NOT_SEEN), invert=True)
        limits = axes.axis()
        axes.imshow(np.where(lost, 1.0, np.nan), cmap="Greys", vmin=0.0, vmax=2.0)
        axes.imshow(picture, interpolation="none", **scale.look)
        axes.axis(limits)
    scale.add_bar(body, ax=axes, location="bottom")
    _, _, left_over = scan.best_fit()
    errors = {"as measured": error, "after best fit": 1e3 * left_over}
    _draw_histogram(right, errors, (-1.5 * limit, 1.5 * limit), _ERROR)
    right.axvline(0.0, color="0.5", linewidth=0.8)
    return figure


def correction_figure(found: Correction, part: Part, camera: Camera) -> Figure:
    """Draw the deviation from the part as measured, what hot air added to it, and what remains.

    The three are maps in the camera's picture, in the same colours, and a histogram; the first is
    the sum of the others. Points without a correction are dark grey. Of a larger cloud one of every
    so many points is drawn, at most `MOST_POINTS`.
    """
    rows = slice(None, None, 1 + len(found.status) // MOST_POINTS)
    measured, error, face = found.measured[rows], found.error[rows], found.face[rows]
    good, normal = found.corrected[rows], found.face_normals[face]
    along, deviation = (
        1e3 * np.einsum("ij,ij->i", vectors, normal)[good] for vectors in (error, measured)
    )
    deviation -= 1e3 * part.face_offsets[face][good]
    maps = {"as measured": deviation, "by hot air": along, "corrected": deviation - along}
    place = camera.project(measured)
    view = PartOutline(part, camera, place[good])
    title = "Deviation from the part: as measured = by hot air + corrected"
    subtitle = f"by hot air: {_spread(along)}"
    figure, body, axes, right = _panels(
        title, found.provenance, subtitle, "corrected", view, tuple(maps)
    )
    everything = np.concatenate(list(maps.values()))
    limit = max(float(np.percentile(np.abs(everything), 99)), 1e-6)
    label = "deviation along the normal (µm)"
    scales = [_scale(values, limit, label) for values in maps.values()]
    for each, scale in zip(axes, scales, strict=True):
        each.plot(*place[~good].T, "o", markersize=0.6, color="0.5", scalex=False, scaley=False)
        _draw_points(each, place[good], scale)
    evolve(scales[0], values=everything).add_bar(body, ax=axes, location="bottom")
    low, high = np.percentile(everything, (1, 99))
    _draw_histogram(right, maps, (low, high), label)
    return figure


class PartOutline:
    """A part as a camera sees it, and the limits of the picture of it and of points (n, 2), px."""

    def __init__(self, part: Part, camera: Camera, place: FloatArray) -> None:
        corners = camera.project(part.vertices)[part.faces]
        corners = corners[np.isfinite(corners).all(axis=(1, 2))]
        # The union of triangles that are all the same way round has no seams.
        turned = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
        corners[turned] = corners[turned, ::-1]
        self.corners = corners
        seen = np.clip(corners.reshape(-1, 2), 0.0, np.array(camera.resolution) - 1.0)
        every = np.vstack((seen, place))
        room = 0.02 * np.ptp(every, axis=0).max()
        self.low, self.high = every.min(axis=0) - room, every.max(axis=0) + room

    @property
    def aspect(self) -> float:
        """Width over height."""
        width, height = self.high - self.low
        return float(width / height)

    def draw(self, axes: Axes) -> None:
        """Fill the part, and limit the axes."""
        path = Path(
            self.corners[:, (0, 1, 2, 0)].reshape(-1, 2),
            np.tile((Path.MOVETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY), len(self.corners)),
        )
        axes.add_artist(PathPatch(path, facecolor="0.78", linewidth=0.0, zorder=-1.0))
        (left, top), (right, bottom) = self.low, self.high
        # White is a value, 0, so the background is not.
        axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal", facecolor="0.92")


def _panels(
    title: str,
    provenance: JsonObject,
    subtitle: str,
    outcome: str,
    view: PartOutline,
    names: tuple[str, ...] = ("",),
) -> tuple[Figure, SubFigure, list[Axes], Axes]:
    """A figure with room for named maps and a histogram; marked if the field is synthetic.

    Several wide maps are stacked, others lie in a row. The histogram lies to the
    right of a stack and of a single map that is not wide, else below.
    """
    subtitle += f"; light grey: part, dark: not {outcome}"
    mark = synthetic_mark(stated_source(provenance["field"]))
    several = len(names) > 1
    beside = (view.aspect > _WIDE[several]) == several
    if beside:
        rows: list[Any] = [[name, _HISTOGRAM] for name in names]
        heights, widths = [4.0 / view.aspect + 0.3] * len(rows), [3.0, 2.0]
    else:
        rows = [list(names), [_HISTOGRAM] * len(names)]
        heights, widths = [6.2 / len(names) / view.aspect + 0.3, 2.0], [1.0] * len(names)
    height = max(1.8 + sum(heights), 3.6)
    title += f" ({mark})" if mark else ""
    figure, body = new_figure(_WIDTH_IN, height, title, wrapped(subtitle, _WIDTH_IN, 9.0))
    found = body.subplot_mosaic(rows, height_ratios=heights, width_ratios=widths)
    axes = [found[name] for name in names]
    for name, each in zip(names, axes, strict=True):
        view.draw(each)
        each.set_title(name, fontsize=10)
        each.tick_params(labelbottom=not beside or each is axes[-1])
        each.tick_params(labelleft=beside or each is axes[0])
    axes[-1 if beside else len(axes) // 2].set_xlabel("camera's picture (px)")
    return figure, body, axes, found[_HISTOGRAM]


def _draw_points(axes: Axes, place: FloatArray, scale: ColourScale) -> None:
    """Draw means of the scale's values at places (n, 2), px, in hexagons."""
    left, right, bottom, top = axes.axis()
    count = 120, max(1, round(120 / math.sqrt(3.0) * (bottom - top) / (right - left)))
    extent, (u, v) = (left, right, top, bottom), place.T
    axes.hexbin(u, v, scale.values, gridsize=count, extent=extent, **scale.look)
    axes.axis((left, right, bottom, top))


def _scale(um: FloatArray, limit: float, label: str) -> ColourScale:
    """Colours about 0 of lengths, µm."""
    return ColourScale(um, (-limit, limit), label, False, SIGNED_COLOUR_MAP)


def _draw_histogram(axes: Axes, um: Mapping[str, FloatArray], ends: Limits, label: str) -> None:
    """Count values, um, by name; those beyond the ends count in the last bins."""
    bins = np.linspace(*ends, 61).tolist()
    for (name, values), colour in zip(um.items(), COLOURS, strict=False):
        axes.hist(values.clip(*ends), bins, histtype="step", label=name, color=colour)
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
