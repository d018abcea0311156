"""Figure of one pose: how far hot air moves the point that each pixel sees."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Literal

import numpy as np
from attrs import frozen
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from iriftrace.core.arrays import AnyArray, BoolArray, FloatArray
from iriftrace.core.engines import Bending, engine_named
from iriftrace.core.errors import InputError
from iriftrace.core.plain import JsonObject
from iriftrace.figures.style import (
    COLOURS,
    DPI,
    SIGNED_COLOUR_MAP,
    TEXT_COLOUR,
    ColourScale,
    legend_below,
)
from iriftrace.image.aov_image import AovImage, Status
from iriftrace.image.displacement import (
    NORM,
    Component,
    directions_to,
    good_mask,
    signed_components,
)
from iriftrace.image.ray_statistics import FEWEST_RAYS, OF_MET, TOO_FEW, percent
from iriftrace.medium.source import stated_source, synthetic_mark
from iriftrace.sweep.faces import displacement_limits

# Flat colours that differ from each other, from the white background, from the colour map and from
# the black lines of silhouettes. Most rays whose refracted twin misses lie next to these, and have
# the vermilion that colour-blind eyes can tell from viridis and from greys.
STATUS_COLOURS = {
    Status.OUT_OF_FOCUS: "0.84",
    Status.BLOCKED: "0.70",
    Status.REFRACTED_MISSED: COLOURS[1],
    Status.ONLY_REFRACTED: "0.56",
    Status.INDEX_MISMATCH: "0.42",
    Status.GAVE_UP: "0.27",
}


@frozen
class Shown:
    """A channel as a picture; or one of `signed_components`, in colours that diverge from 0."""

    channel: str
    title: str
    label: str
    signed: bool = False


DISPLACEMENT = Shown("displacement.norm", "Displacement by hot air", "Displacement")
BIAS = Shown("displacement.norm", "Mean displacement of the ensemble (bias)", "Mean displacement")
SCATTER = Shown(
    "displacement.std.norm", "Scatter over the ensemble", "Standard deviation of the displacement"
)

COMPONENTS = {
    "along": Shown(
        "along", "Displacement along the line of sight", "Away from the camera", signed=True
    ),
    "right": Shown("right", "Displacement across the line of sight", "To the right", signed=True),
    "down": Shown("down", "Displacement across the line of sight", "Downwards", signed=True),
}
"""Signed pictures of the displacement; right and down are the directions in the picture."""

_WIDTH_IN = 8.0
_TALLEST_IN = 9.0
_FLATTEST_IN = 3.6
_FLAT = 0.5  # Height over width below which the colour bar has no room next to the picture.


def displacement_figure(
    image: AovImage,
    include: Collection[int] = (Status.GOOD,),
    *,
    view: str = "",
    component: Component = NORM,
) -> Figure:
    """Draw the displacement of every pixel on the part, 1600 pixels wide; for an ensemble the mean.

    Colours are logarithmic between the 1st and the 99th percentile of the rays that count, or
    linear and symmetric about 0 to the 99th of a signed component's size; pixels on the part
    without a displacement have a colour for each status; dark lines are silhouettes.

    Parameters
    ----------
    image
        AOV image of one pose.
    include
        Codes of the rays that count; 0 and 5 are possible.
    view
        Name of the pose among several, for a line below the title.
    component
        ``"norm"`` is the length of the displacement; ``"along"`` its signed part along the line of
        sight, positive away from the camera, ``"right"`` and ``"down"`` those across it.

    Raises
    ------
    InputError
        No ray counts, so there is nothing to draw; or there is no such component.
    """
    known = {"norm": BIAS if image.is_ensemble else DISPLACEMENT, **COMPONENTS}
    if component not in known:
        raise InputError(
            f"A displacement has no component {component!r}; draw {', '.join(known)}.",
            code="component.unknown_name",
            argument="component",
        )
    return _draw(image, include, known[component], view)


def pose_figures(
    image: AovImage,
    name: str,
    include: Collection[int] = (Status.GOOD,),
    component: Component = NORM,
) -> dict[str, Figure]:
    """All figures of a pose, named after it.

    The displacement and, for an ensemble, its standard deviation over the members. A signed
    component is drawn alone, with its name after the pose's.
    """
    if component != "norm":
        return {f"{name}_{component}": displacement_figure(image, include, component=component)}
    figures = {name: displacement_figure(image, include)}
    if image.is_ensemble:
        figures[f"{name}_scatter"] = _draw(image, include, SCATTER)
    return figures


def _draw(image: AovImage, include: Collection[int], what: Shown, view: str = "") -> Figure:
    good = good_mask(image, include)
    if not good.any():
        raise InputError(
            "the image has no good ray, so there is no displacement to draw; look at the counts by "
            "status in the metrics, then turn the camera to the part or widen the focus interval.",
            code="picture.no_good_ray",
        )
    displacement = np.zeros(good.shape)
    displacement[good] = 1e3 * _values(image, good, what)
    values = displacement[good]
    scale = _scale(values, what)
    seen = image.status != Status.MISSED
    columns, rows = _crop(seen)

    aspect = (rows[1] - rows[0]) / (columns[1] - columns[0])
    height = float(np.clip(1.7 + 6.1 * aspect, _FLATTEST_IN, _TALLEST_IN))
    # Compressed: axes of equal scales leave no gap between themselves and their colour bar.
    layout = ConstrainedLayoutEngine(h_pad=0.1, w_pad=0.08, compress=True)
    figure = Figure(figsize=(_WIDTH_IN, height), dpi=DPI, layout=layout)
    axes = figure.add_subplot()
    extent = (0, image.resolution[0], image.resolution[1], 0)
    entries = _draw_without_displacement(axes, image.status, seen & ~good, extent)
    picture = axes.imshow(
        np.ma.masked_where(~good, displacement),
        extent=extent,
        interpolation="nearest",
        **scale.look,
    )
    _draw_silhouettes(axes, image, seen)
    axes.set(xlim=columns, ylim=rows[::-1], xlabel="Column (px)", ylabel="Row (px)")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(6, integer=True, steps=[1, 2, 5, 10]))
    side: Literal["right", "bottom"] = "right" if aspect > _FLAT else "bottom"
    scale.add_bar(figure, picture, ax=axes, location=side, shrink=0.95, aspect=28)
    size = "size, " if what.signed else ""
    figure.suptitle(f"{what.title}: {size}{_statistics(np.abs(values))}", fontsize=12)
    second_line = "\n".join(filter(None, (view, _provenance(image.header))))
    axes.set_title(second_line, fontsize=9, color=TEXT_COLOUR, pad=8)
    if entries:
        title = f"Pixels without a displacement (fraction {OF_MET})"
        legend_below(figure, entries, min(2, len(entries)), title=title, title_fontsize=9)
    return figure


def _values(image: AovImage, good: BoolArray, what: Shown) -> FloatArray:
    """(n,) numbers of the good pixels, mm."""
    if not what.signed:
        return image.channels[what.channel][good].astype(np.float64)
    camera = image.camera
    sight = directions_to(camera, image.vector("straight", good))
    moved = image.vector("displacement", good)
    return signed_components(moved, sight, camera.matrix[:3, 0])[what.channel]


def _scale(values: FloatArray, what: Shown) -> ColourScale:
    """The colours: logarithmic, or diverging about 0."""
    low, high = displacement_limits(np.abs(values))
    label = f"{what.label} (µm)"
    if what.signed:
        return ColourScale(values, (-high, high), label, False, SIGNED_COLOUR_MAP)
    # Shells without an index step move nothing: then the scale starts at 0.
    return ColourScale(values, (low, high), label, logarithmic=low > 0.0)


def _crop(seen: BoolArray) -> tuple[tuple[float, float], tuple[float, float]]:
    """Columns and rows of all pixels that see the part, with a margin, within the picture."""
    spans = []
    filled = [np.flatnonzero(seen.any(axis=axis)) for axis in (0, 1)]
    margin = 0.03 * max(np.ptp(used) + 1 for used in filled) + 2
    for used, size in zip(filled, seen.shape[::-1], strict=True):
        spans.append((float(max(used[0] - margin, 0)), float(min(used[-1] + 1 + margin, size))))
    return spans[0], spans[1]


def _draw_without_displacement(
    axes: Axes, status: NDArray[np.int64], others: BoolArray, extent: tuple[int, int, int, int]
) -> list[Patch]:
    """Paint the pixels of the mask `others`, each status in its colour; returns legend entries."""
    codes = np.full(status.shape, np.nan)
    total = int((status != Status.MISSED).sum())
    entries = []
    for place, (code, colour) in enumerate(STATUS_COLOURS.items()):
        pixels = others & (status == code)
        count = int(pixels.sum())
        if count:
            codes[pixels] = place
            text = f"{code.text.capitalize()}: {count:,} px ({percent(count, total)})"
            entries.append(Patch(facecolor=colour, edgecolor="0.3", linewidth=0.4, label=text))
    axes.imshow(
        codes,
        norm=Normalize(-0.5, len(STATUS_COLOURS) - 0.5),
        cmap=ListedColormap(list(STATUS_COLOURS.values())),
        extent=extent,
        interpolation="nearest",
    )
    return entries


def _draw_silhouettes(axes: Axes, image: AovImage, seen: BoolArray) -> None:
    """Draw the pixel edges where the part ends or hides a farther piece of itself."""
    distance, slope = _distance_and_slope(image)
    face = image.channels["part.face"]
    for axis in (0, 1):
        ends = np.diff(seen, axis=axis)
        one, other = _neighbours(face, axis)
        apart = (one > 0) & (other > 0) & (one != other)
        step = np.abs(np.diff(distance, axis=axis))
        # A slanted surface steps by its slope; a silhouette by several times that.
        hides = apart & (step > 5.0 * np.maximum(*_neighbours(slope, axis)))
        axes.add_collection(
            LineCollection(
                list(_pixel_edges(ends | hides, axis)),
                colors="0.15",
                linewidths=0.8,
                capstyle="projecting",
            ),
            autolim=False,
        )


def _neighbours(pixels: AnyArray, axis: int) -> tuple[AnyArray, AnyArray]:
    return (pixels[:-1], pixels[1:]) if axis == 0 else (pixels[:, :-1], pixels[:, 1:])


def _distance_and_slope(image: AovImage) -> tuple[FloatArray, FloatArray]:
    """Distance to the straight hit and its largest change to a pixel on the same plane, mm."""
    camera = image.camera
    width, height = image.resolution
    offset = image.vector("straight").reshape(-1, 3) - camera.origin
    if camera.projection == "pinhole":
        distance = np.linalg.norm(offset, axis=1).reshape(height, width)
        pixel = distance / min(camera.focal_px)
    else:
        distance = (offset @ camera.forward).reshape(height, width)
        pixel = np.full_like(distance, max(camera.pixel_pitch_mm))
    # Near grazing incidence the tangent exceeds what the part's size allows; 85 degrees is enough.
    incidence = np.minimum(image.channels["incidence.angle"].astype(np.float64), np.radians(85.0))
    return distance, pixel * (0.1 + np.tan(incidence))


def _pixel_edges(marked: BoolArray, axis: int) -> FloatArray:
    """(n, 2, 2) array, px: ends (column, row) of the edges behind the marked pixels."""
    row, column = np.nonzero(marked)
    start = np.stack((column, row + 1) if axis == 0 else (column + 1, row), axis=1)
    along = (1, 0) if axis == 0 else (0, 1)
    return np.stack((start, start + along), axis=1).astype(np.float64)


def _statistics(values: FloatArray) -> str:
    if len(values) < FEWEST_RAYS:
        return TOO_FEW
    median, p95 = (
        f"{value:.1f}" if value >= 1.0 or value == 0.0 else f"{value:.2g}"
        for value in np.percentile(values, (50.0, 95.0))
    )
    return f"median {median} µm, 95th percentile {p95} µm"


def _provenance(header: JsonObject) -> str:
    stated = ("field", "wavelength_nm", "ensemble", "normals", "engine", "bending")
    field, wavelength, ensemble, normals, engine, bending = map(header.get, stated)
    parts = [
        synthetic_mark(stated_source(field)),
        f"{ensemble['count']} fields"
        if ensemble
        else Path(field["path"]).name
        if field and field.get("path")
        else None,
        f"{wavelength:g} nm" if wavelength is not None else None,
        # The gradient of cells has no normals.
        normals
        if not normals or (engine and engine_named(engine).through_cells)
        else f"{normals} normals",
        "bent at the shells" if bending and Bending(bending).at_shells_alone else None,
        f"engine: {engine}" if engine else None,
    ]
    return "  ·  ".join(part for part in parts if part)
