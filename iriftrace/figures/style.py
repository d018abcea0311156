"""Write a Matplotlib figure as PNG or PDF, without the global state of pyplot."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import FigureCanvasPdf
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.colors import FuncNorm, LogNorm, Normalize
from matplotlib.figure import Figure, SubFigure
from matplotlib.gridspec import GridSpec
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from iriftrace.core.arrays import BoolArray, FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.files import whole_file
from iriftrace.core.units import ZERO_CELSIUS_K
from iriftrace.planning.quantities import Quantity
from iriftrace.planning.summary import SweepSummary
from iriftrace.shells.stack import ShellStack
from iriftrace.sweep.measures import Limits


def check_png_name(path: str | Path) -> None:
    """Refuse a name that promises another format.

    Raises
    ------
    InputError
        The name does not end in ``.png``.
    """
    if Path(path).suffix.lower() != ".png":
        raise InputError(f"{path} does not end in .png, but figures are PNG files; rename it.")


def write_png(figure: Figure, path: str | Path) -> None:
    """Write a figure whole or not at all.

    Raises
    ------
    InputError
        The name does not end in ``.png``, or its folder does not exist.
    """
    check_png_name(path)
    with whole_file(path) as temporary:
        FigureCanvasAgg(figure).print_figure(temporary, format="png", dpi=figure.dpi)


def write_pdf(figure: Figure, path: str | Path) -> None:
    """Write a figure as PDF, whole or not at all; the same figure gives the same bytes.

    Raises
    ------
    InputError
        The folder does not exist, or the file cannot be written.
    """
    with whole_file(path) as temporary:
        FigureCanvasPdf(figure).print_figure(
            temporary, format="pdf", dpi=figure.dpi, metadata={"CreationDate": None}
        )


# MERGE figure_scale: Colour scales of figures and the round numbers on them.


def colour_norm(limits: Limits) -> Normalize:
    """Logarithmic between two positive limits; linear from 0."""
    # Clipped, because a ray that crosses no shell has a displacement of 0, which has no logarithm:
    # it would leave a hole in the part.
    return LogNorm(*limits, clip=True) if limits[0] > 0.0 else Normalize(*limits)


def round_ticks(limits: Limits) -> FloatArray:
    """Round numbers between two limits that label a colour bar without crowding it."""
    low, high = limits
    if low > 0.0:
        decades = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
        for steps in ((1,), (1, 3), (1, 2, 5), (1, 1.5, 2, 3, 5, 7)):
            ticks = np.outer(decades, steps).ravel()
            ticks = ticks[(ticks >= low) & (ticks <= high)]
            if len(ticks) >= 5:
                return np.asarray(ticks, dtype=np.float64)
    return even_ticks(limits)


def even_ticks(limits: Limits) -> FloatArray:
    """Round numbers at equal steps between two limits."""
    low, high = limits
    ticks = np.asarray(MaxNLocator(6, steps=[1, 2, 5, 10]).tick_values(low, high))
    return ticks[(ticks >= low) & (ticks <= high)]


# MERGE figure_colours: Colours of shells: linear in the air's refractivity, labelled by its tempe


def celsius_of(shells: ShellStack) -> FloatArray:
    """(shells,) array, degC: temperature of the air at each surface."""
    return shells.temperature_k - ZERO_CELSIUS_K


def temperature_norm(shells: ShellStack) -> FuncNorm:
    """Colours over temperature (degC) that are linear in 1/T, hence in the refractivity."""
    celsius = celsius_of(shells)
    low, high = float(celsius.min()), float(celsius.max())
    if high - low < 1.0:
        low, high = low - 10.0, high + 10.0
    return FuncNorm(
        (
            lambda t: -1.0 / (np.asarray(t) + ZERO_CELSIUS_K),
            lambda u: -1.0 / np.asarray(u) - ZERO_CELSIUS_K,
        ),
        low,
        high,
    )


def temperature_ticks(norm: FuncNorm) -> list[float]:
    """Round temperatures that do not crowd the colour bar."""
    rounds = np.array([20, 30, 40, 50, 75, 100, 150, 200, 300, 400, 500, 700, 1000, 1500, 2000])
    low, high = (float(t) for t in norm.inverse(np.array((0.0, 1.0))))
    inside = rounds[(rounds >= low) & (rounds <= high)]
    ticks: list[float] = []
    for tick in inside.tolist():
        if not ticks or norm(tick) - norm(ticks[-1]) > 0.045:
            ticks.append(tick)
    return ticks if len(ticks) > 1 else [round(low), round(high)]


# MERGE sweep_style: What the figures of a sweep have in common: layout, titles, colours and marks

COLOUR_MAP = "viridis"
BEST_COLOUR = "#d7191c"
UNKNOWN_COLOUR = "0.5"
TEXT_COLOUR = "0.35"

BEST: dict[str, Any] = {
    "marker": "*",
    "markersize": 15,
    "markerfacecolor": BEST_COLOUR,
    "markeredgecolor": "white",
    "markeredgewidth": 0.9,
    "linestyle": "none",
}
BEST_RING: dict[str, Any] = {
    "marker": "o",
    "markersize": 12,
    "markerfacecolor": "none",
    "markeredgecolor": BEST_COLOUR,
    "markeredgewidth": 2.0,
    "linestyle": "none",
}
UNKNOWN: dict[str, Any] = {
    "marker": "o",
    "markersize": 6,
    "markerfacecolor": "none",
    "markeredgecolor": UNKNOWN_COLOUR,
    "markeredgewidth": 1.1,
    "linestyle": "none",
}

_DPI = 200
_BAR_SHAPE: dict[str, Any] = {"aspect": 30, "pad": 0.02}


def new_figure(
    width_in: float, height_in: float, title: str, subtitle: str
) -> tuple[Figure, SubFigure]:
    """A titled figure whose parts make room for each other, and the room below the titles."""
    layout = ConstrainedLayoutEngine(h_pad=0.06, w_pad=0.08, hspace=0.04, wspace=0.04)
    figure = Figure(figsize=(width_in, height_in), dpi=_DPI, layout=layout)
    figure.suptitle(title, fontsize=12)
    body = figure.add_subfigure(GridSpec(1, 1, figure=figure)[0])
    body.suptitle(subtitle, fontsize=9, color=TEXT_COLOUR)
    return figure, body


def colour_limits(quantity: Quantity) -> Limits:
    """The limits of the normalisation, apart enough for a scale."""
    low, high = quantity.limits
    if not np.isfinite(low):
        return 0.0, 1.0
    if high - low > 1e-6 * max(abs(low), abs(high)):
        return low, high
    room = 0.05 * abs(high) or 0.5
    return low - room, high + room


def quantity_norm(quantity: Quantity) -> Normalize:
    """Colours of a metric: the same in every figure."""
    limits = colour_limits(quantity)
    return colour_norm(limits) if quantity.logarithmic else Normalize(*limits, clip=True)


def add_colour_bar(
    figure: Figure | SubFigure,
    quantity: Quantity,
    *,
    axes: Axes | list[Axes] | None = None,
    cax: Axes | None = None,
) -> Colorbar:
    """Add the colour bar of a metric beside `axes` or into `cax`."""
    limits = colour_limits(quantity)
    above = bool((quantity.values[quantity.known] > limits[1] * (1 + 1e-9)).any())
    bar = figure.colorbar(
        ScalarMappable(quantity_norm(quantity), COLOUR_MAP),
        ax=axes,
        cax=cax,
        extend="max" if above else "neither",
        label=quantity.label,
        **_BAR_SHAPE if cax is None else {},
    )
    ticks = (round_ticks if quantity.logarithmic else even_ticks)(limits).tolist()
    bar.set_ticks(ticks, labels=[number(tick) for tick in ticks])
    bar.set_ticks([], minor=True)
    return bar


def number(value: float) -> str:
    """A short number with a real minus sign."""
    return f"{value + 0.0:g}".replace("-", "\N{MINUS SIGN}")


def marks(
    summary: SweepSummary, without: BoolArray, mark: Mapping[str, Any] = BEST
) -> list[Line2D]:
    """Legend entries: the best pose, and the poses without a number if there are any."""
    best = summary.plan.best
    entries = [Line2D([], [], label=f"Best pose by score: {best}", **mark)]
    count = int(without.sum())
    if count:
        entries.append(Line2D([], [], label=unknown_label(count), **UNKNOWN))
    return entries


def unknown_label(count: int) -> str:
    """What an open grey mark means."""
    return f"Without a number: {count} {'pose' if count == 1 else 'poses'}"
