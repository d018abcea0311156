"""Maps of a sweep: one metric over azimuth and elevation."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, MaxNLocator, MultipleLocator

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.figures.style import (
    BEST,
    COLOUR_MAP,
    COLOURS,
    UNKNOWN,
    WARNED,
    finish_axes,
    legend_below,
    marks,
    new_figure,
    number,
    scale_of,
)
from iriftrace.planning.quantities import Quantity
from iriftrace.planning.summary import SweepSummary

_TICK_STEPS_DEG = (5.0, 10.0, 15.0, 30.0, 45.0, 60.0, 90.0)
_MOST_TICKS = 9
_MOST_PANELS = 12


def map_figure(summary: SweepSummary, quantity: Quantity) -> Figure:
    """A metric over azimuth and elevation: cells for a grid of poses, dots for others.

    Poses with another field, focal length or distance have a panel of their own. Poses that differ
    only in their distance are drawn over it, the displacement with the quartiles of its rays.
    """
    if summary.is_one_direction:
        return _distance_figure(summary, quantity)
    series = summary.series
    if len(series) > _MOST_PANELS:
        series = {f"{len(series)} series on top of each other": np.arange(len(quantity.values))}
    columns = math.ceil(math.sqrt(len(series)))
    rows = math.ceil(len(series) / columns)
    figure, body = new_figure(
        7.0 + 3.6 * (columns - 1),
        5.6 + 3.4 * (rows - 1),
        f"{quantity.title} over the camera's direction",
        summary.subtitle,
    )
    panels = body.subplots(rows, columns, squeeze=False).ravel()
    for axes, (text, members) in zip(panels, series.items(), strict=False):
        _draw_panel(axes, summary, quantity, members)
        axes.set_title(text, fontsize=9)
    for axes in panels[len(series) :]:
        axes.set_axis_off()
    scale_of(quantity).add_bar(body, ax=panels.tolist())
    legend_below(body, marks(summary, ~quantity.known), 2)
    return figure


def _distance_figure(summary: SweepSummary, quantity: Quantity) -> Figure:
    title = f"{quantity.title} over the camera's distance"
    figure, body = new_figure(7.0, 5.0, title, summary.subtitle)
    axes = body.add_subplot()
    order = np.argsort(summary.distance, kind="stable")
    distance = summary.distance[order]
    entries = []
    if quantity is summary.displacement and summary.quartiles is not None:
        low, high = summary.quartiles[order].T
        label = "Quartiles of the displacement of all rays"
        entries.append(
            axes.fill_between(distance, low, high, color=COLOURS[0], alpha=0.25, lw=0, label=label)
        )
    axes.plot(distance, quantity.values[order], "o-", color=COLOURS[0], ms=5, zorder=2)
    for chosen, mark in (
        (np.flatnonzero(summary.warned.any(axis=1)), WARNED),
        (np.array([summary.plan.best]), BEST),
    ):
        axes.plot(summary.distance[chosen], quantity.values[chosen], zorder=4, **mark)
    axes.set(xlabel="Distance from camera to target (mm)", ylabel=quantity.label)
    finish_axes(axes)
    legend_below(body, [*marks(summary, ~quantity.known), *entries], 2)
    return figure


def _draw_panel(axes: Axes, summary: SweepSummary, quantity: Quantity, members: IntArray) -> None:
    grid = summary.grid(members)
    if grid is None:
        _draw_dots(axes, summary, quantity, members)
    else:
        _draw_cells(axes, summary, quantity, grid)
    warned = members[summary.warned[members].any(axis=1)]
    axes.plot(summary.azimuth[warned], summary.elevation[warned], zorder=3, **WARNED)
    best = summary.plan.best
    if best in members:
        axes.plot(summary.azimuth[best], summary.elevation[best], zorder=4, clip_on=False, **BEST)
    axes.set(xlabel=f"Azimuth {summary.angles_of} (°)", ylabel=f"Elevation {summary.angles_of} (°)")
    for axis, angles in ((axes.xaxis, summary.azimuth), (axes.yaxis, summary.elevation)):
        axis.set_major_formatter(lambda value, _position: number(round(value, 6)))
        ticks = None if grid is None else _ticks(np.unique(angles[grid]))
        if ticks is not None:
            axis.set_major_locator(FixedLocator(ticks.tolist()))
            continue
        low, high = axis.get_view_interval()
        step = next((s for s in _TICK_STEPS_DEG if (high - low) / s <= _MOST_TICKS), None)
        small = high - low < 2 * _TICK_STEPS_DEG[0]
        axis.set_major_locator(MaxNLocator(6) if step is None or small else MultipleLocator(step))


def _ticks(angles: FloatArray) -> FloatArray | None:
    """As many of the ascending angles of poses as have room, at a round step if there is one.

    None if the angles have many digits.
    """
    if not np.allclose(angles, np.round(angles, 1), rtol=0, atol=1e-6):
        return None
    fewest = math.ceil(len(angles) / _MOST_TICKS)
    step = float(angles[1] - angles[0])
    rounds = [n for n in range(fewest, 2 * fewest + 1) if round(n * step, 6) in _TICK_STEPS_DEG]
    return angles[:: rounds[0] if rounds else fewest]


def _draw_cells(axes: Axes, summary: SweepSummary, quantity: Quantity, grid: IntArray) -> None:
    azimuths = np.unique(summary.azimuth[grid])
    elevations = np.unique(summary.elevation[grid])
    rows = np.clip(_edges(elevations), -90.0, 90.0)
    values = np.ma.masked_invalid(quantity.values[grid])
    axes.set_facecolor("0.93")
    axes.pcolormesh(
        _edges(azimuths),
        rows,
        values,
        norm=scale_of(quantity).norm,
        cmap=COLOUR_MAP,
        # Vector figures would show white seams between cells.
        rasterized=True,
    )
    row, column = np.nonzero(values.mask & np.ones(grid.shape, dtype=np.bool_))
    # The middle of the cell as it is drawn: that of a pole is cut in half.
    middle = 0.5 * (rows[1:] + rows[:-1])
    axes.plot(azimuths[column], middle[row], zorder=3, **UNKNOWN)


def _edges(centres: FloatArray) -> FloatArray:
    """Ends of the cells around ascending centres."""
    between = 0.5 * (centres[1:] + centres[:-1])
    return np.concatenate(([2 * centres[0] - between[0]], between, [2 * centres[-1] - between[-1]]))


def _draw_dots(axes: Axes, summary: SweepSummary, quantity: Quantity, members: IntArray) -> None:
    known, unknown = members[quantity.known[members]], members[~quantity.known[members]]
    axes.scatter(
        summary.azimuth[known],
        summary.elevation[known],
        c=quantity.values[known],
        norm=scale_of(quantity).norm,
        cmap=COLOUR_MAP,
        s=float(np.clip(2.0e4 / len(members), 6.0, 60.0)),
        edgecolors="0.3",
        linewidths=0.4,
        zorder=2,
    )
    axes.plot(summary.azimuth[unknown], summary.elevation[unknown], zorder=3, **UNKNOWN)
    axes.grid(color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.margins(0.05)
