"""Figure of one pose: how far hot air moves the point that each pixel sees."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any, Literal

import numpy as np
from attrs import frozen
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from iriftrace.displacement import good_mask
from iriftrace.errors import InputError
from iriftrace.exr import AovImage
from iriftrace.field_origin import synthetic_mark
from iriftrace.figure_file import check_png_name, write_png
from iriftrace.figure_scale import Limits, colour_norm, round_ticks
from iriftrace.figure_silhouettes import draw_silhouettes
from iriftrace.figure_status import draw_without_displacement
from iriftrace.ray_statistics import FEWEST_RAYS
from iriftrace.status import Status

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

COLOUR_PERCENTILES = (1.0, 99.0)
"""A few silhouette rays jump by millimetres; these percentiles keep them out of the colours."""

UM_PER_MM = 1000.0


@frozen
class Shown:
    """A channel as a picture: its name, and words for the title and the colour bar."""

    channel: str
    title: str
    label: str


DISPLACEMENT = Shown("displacement.norm", "Displacement by hot air", "Displacement")
BIAS = Shown("displacement.norm", "Mean displacement of the ensemble (bias)", "Mean displacement")
SCATTER = Shown(
    "displacement.std.norm", "Scatter over the ensemble", "Standard deviation of the displacement"
)


_DPI = 200
_WIDTH_IN = 8.0
_TALLEST_IN = 9.0
_FLATTEST_IN = 3.6
_FLAT = 0.5  # Height over width below which the colour bar has no room beside the picture.


def displacement_figure(
    image: AovImage,
    path: str | Path,
    include: Collection[int] = (Status.GOOD,),
    *,
    view: str = "",
) -> None:
    """Draw the displacement of every pixel on the part and write it as PNG, 1600 pixels wide.

    Colours are logarithmic between the 1st and the 99th percentile of the rays that count; pixels
    on the part without a displacement have a colour for each status; dark lines are silhouettes.

    Parameters
    ----------
    image
        AOV image of one pose.
    path
        Name of the PNG file; an existing one is replaced.
    include
        Codes of the rays that count; 0 and 5 are possible.
    view
        Which view of several it is, for a line below the title.

    Raises
    ------
    InputError
        No ray counts, so there is nothing to draw; or the file cannot be written.
    """
    check_png_name(path)
    write_png(_displacement_figure(image, include, view=view), path)


def scatter_figure(
    image: AovImage, path: str | Path, include: Collection[int] = (Status.GOOD,)
) -> None:
    """Draw the standard deviation of the displacement over the members of an ensemble, as PNG.

    Parameters
    ----------
    image, path, include
        As for `displacement_figure`; the image is that of an ensemble.

    Raises
    ------
    InputError
        The image is that of a single field; or as for `displacement_figure`.
    """
    if SCATTER.channel not in image.channels:
        raise InputError(
            "the image is that of a single field, which has no scatter; render the scene of an "
            "ensemble."
        )
    check_png_name(path)
    write_png(_displacement_figure(image, include, SCATTER), path)


def _displacement_figure(
    image: AovImage,
    include: Collection[int] = (Status.GOOD,),
    what: Shown | None = None,
    view: str = "",
) -> Figure:
    what = what or (BIAS if SCATTER.channel in image.channels else DISPLACEMENT)
    good = good_mask(image, include)
    if not good.any():
        raise InputError(
            "the image has no good ray, so there is no displacement to draw; look at the counts by "
            "status in the metrics, then turn the camera to the part or widen the focus interval."
        )
    displacement = np.ma.masked_where(
        ~good, image.channels[what.channel].astype(np.float64) * UM_PER_MM
    )
    limits = _colour_limits(displacement.compressed())
    seen = image.status != Status.MISSED
    columns, rows = _crop(seen)

    aspect = (rows[1] - rows[0]) / (columns[1] - columns[0])
    height = float(np.clip(1.7 + 6.1 * aspect, _FLATTEST_IN, _TALLEST_IN))
    figure = Figure(figsize=(_WIDTH_IN, height), dpi=_DPI, layout=_layout())
    axes = figure.add_subplot()
    extent = (0, image.resolution[0], image.resolution[1], 0)
    entries = draw_without_displacement(axes, image.status, seen & ~good, extent)
    picture = axes.imshow(
        displacement,
        norm=colour_norm(limits),
        cmap="viridis",
        extent=extent,
        interpolation="nearest",
    )
    draw_silhouettes(axes, image, seen)
    axes.set(xlim=columns, ylim=rows[::-1], xlabel="Column (px)", ylabel="Row (px)")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(6, integer=True, steps=[1, 2, 5, 10]))
    side: Literal["right", "bottom"] = "right" if aspect > _FLAT else "bottom"
    _add_colour_bar(figure, picture, axes, displacement.compressed(), limits, side, what)
    second_line = "\n".join(filter(None, (view, _provenance(image.header))))
    _add_titles(figure, axes, displacement.compressed(), second_line, what)
    if entries:
        figure.legend(
            handles=entries,
            loc="outside lower center",
            ncols=2 if len(entries) > 1 else 1,
            fontsize=9,
            frameon=False,
            title="Pixels without a displacement (share of all that see the part)",
            title_fontsize=9,
        )
    return figure


def _layout() -> ConstrainedLayoutEngine:
    # Compressed: axes of equal scales leave no gap between themselves and their colour bar.
    return ConstrainedLayoutEngine(h_pad=0.08, w_pad=0.08, compress=True)


def _colour_limits(values: FloatArray) -> Limits:
    """Percentiles of the values, moved apart where they would not make a logarithmic scale."""
    low, high = (float(v) for v in np.percentile(values, COLOUR_PERCENTILES))
    if high <= 0.0:
        # Shells without an index step: nothing moves, and the scale is linear.
        return 0.0, 1.0
    low = max(low, 1e-4 * high)
    return (low, high) if high > 1.05 * low else (low / 1.05, high * 1.05)


def _crop(seen: BoolArray) -> tuple[tuple[float, float], tuple[float, float]]:
    """Columns and rows that hold all that was seen, with a margin, as far as the picture goes."""
    spans = []
    filled = [np.flatnonzero(seen.any(axis=axis)) for axis in (0, 1)]
    margin = 0.03 * max(np.ptp(used) + 1 for used in filled) + 2
    for used, size in zip(filled, seen.shape[::-1], strict=True):
        spans.append((float(max(used[0] - margin, 0)), float(min(used[-1] + 1 + margin, size))))
    return spans[0], spans[1]


def _add_colour_bar(
    figure: Figure,
    picture: AxesImage,
    axes: Axes,
    values: FloatArray,
    limits: Limits,
    side: Literal["right", "bottom"],
    what: Shown,
) -> None:
    below, above = bool(values.min() < limits[0]), bool(values.max() > limits[1])
    extend = {(True, True): "both", (True, False): "min", (False, True): "max"}
    bar = figure.colorbar(
        picture,
        ax=axes,
        extend=extend.get((below, above), "neither"),
        label=f"{what.label} (µm)",
        location=side,
        shrink=0.95,
        aspect=28,
        pad=0.02,
    )
    ticks = round_ticks(limits).tolist()
    bar.set_ticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    bar.set_ticks([], minor=True)


def _add_titles(
    figure: Figure, axes: Axes, values: FloatArray, second_line: str, what: Shown
) -> None:
    figure.suptitle(f"{what.title}: {_statistics(values)}", fontsize=12)
    axes.set_title(second_line, fontsize=9, color="0.35", pad=8)


def _statistics(values: FloatArray) -> str:
    if len(values) < FEWEST_RAYS:
        return f"fewer than {FEWEST_RAYS} good rays, so no numbers"
    median, p95 = np.percentile(values, (50.0, 95.0))
    return f"median {_length(median)} µm, 95th percentile {_length(p95)} µm"


def _length(value: float) -> str:
    return f"{value:.1f}" if value >= 1.0 or value == 0.0 else f"{value:.2g}"


def _provenance(header: dict[str, Any]) -> str:
    field, wavelength = header.get("field"), header.get("wavelength_nm")
    ensemble = header.get("ensemble")
    parts = [
        synthetic_mark((field or {}).get("origin")),
        f"{ensemble['count']} fields"
        if ensemble
        else Path(field["path"]).name
        if field and field.get("path")
        else None,
        f"{wavelength:g} nm" if wavelength is not None else None,
        _normals(header.get("normals")),
        "bent at the shells" if str(header.get("bending")).startswith("at the shells") else None,
        f"engine: {header['engine']}" if header.get("engine") else None,
    ]
    return "  ·  ".join(part for part in parts if part)


def _normals(stated: str | None) -> str | None:
    """Normals of shells, or the gradient of the continuous engine, which has none."""
    if not stated:
        return None
    _, none, gradient = stated.partition("none, ")
    return gradient if none else f"{stated} normals"
