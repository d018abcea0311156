"""What the figures of a sweep have in common: layout, titles, colours and marks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Normalize
from matplotlib.figure import Figure, SubFigure
from matplotlib.gridspec import GridSpec
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D

from iriftrace.figure_scale import Limits, colour_norm, even_ticks, round_ticks
from iriftrace.pose_quantity import BoolArray, Quantity
from iriftrace.sweep_summary import SweepSummary

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
