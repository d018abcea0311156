"""Charts of a sweep: maps, histograms, counts of each pose, and the Pareto front."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import (
    EngFormatter,
    FixedLocator,
    FuncFormatter,
    LogLocator,
    MaxNLocator,
    MultipleLocator,
    NullFormatter,
)

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.figures.style import (
    BEST,
    BEST_COLOUR,
    BEST_RING,
    COLOURS,
    FRONT_RING,
    TEXT_COLOUR,
    UNKNOWN,
    WARNED,
    count_entry,
    finish_axes,
    legend_below,
    marks,
    new_figure,
    number,
    scale_of,
    wrapped,
)
from iriftrace.image.aov_image import Status
from iriftrace.planning.quantities import PoseQuantity
from iriftrace.planning.summary import SweepSummary
from iriftrace.planning.texts import of_means, percentile_text

_BAR_COLOUR = "#31688e"
_BINS = 24

# Usable rays have the colour of the bars.
_OUTCOME_COLOURS = {
    Status.GOOD: _BAR_COLOUR,
    Status.OUT_OF_FOCUS: "#b8c4cf",
    Status.BLOCKED: "#7f7f7f",
    Status.REFRACTED_MISSED: COLOURS[4],
    Status.ONLY_REFRACTED: COLOURS[1],
    Status.INDEX_MISMATCH: COLOURS[3],
    Status.GAVE_UP: "#222222",
}


def histogram_figure(summary: SweepSummary) -> Figure:
    """Histogram of each metric over the poses, with the ends of its normalisation."""
    figure, body = new_figure(8.0, 6.4, "Metrics of all poses", summary.subtitle)
    for axes, quantity in zip(body.subplots(2, 2).flat, summary.metrics, strict=True):
        values = quantity.values[quantity.known]
        ends = values.min(), values.max()
        bins = np.geomspace(*ends, _BINS + 1) if quantity.logarithmic else _BINS
        axes.hist(values, bins, color=_BAR_COLOUR, edgecolor="white", lw=0.4)
        if quantity.logarithmic:
            _logarithmic(axes)
        for limit, style in zip(quantity.limits, ("--", "-"), strict=True):
            axes.axvline(limit, color=BEST_COLOUR, linestyle=style, linewidth=1.2)
        _finish_histogram(axes, wrapped(quantity.label, 3.6))
    low, high = (
        Line2D([], [], color=BEST_COLOUR, linestyle=style, linewidth=1.2) for style in ("--", "-")
    )
    low.set_label(f"Minimum{of_means(summary)}: normalised to 0")
    high.set_label(f"{percentile_text(summary)}: normalised to 1")
    legend_below(body, [low, high, *_unknown(summary.metrics)], 3)
    return figure


def normalised_figure(summary: SweepSummary) -> Figure:
    """Histograms of the normalised metrics and the score of the ranked poses."""
    figure, body = new_figure(10.0, 6.4, "Normalised metrics and combined score", summary.subtitle)
    *panels, spare = body.subplots(2, 3, sharey=True).flat
    weights = summary.plan.criteria.weights
    ranked = (*summary.metrics, summary.score)
    for axes, quantity in zip(panels, ranked, strict=True):
        values = quantity.normalised[np.isfinite(quantity.normalised)]
        score = quantity is summary.score
        most = max(1.0, sum(weights.values())) if score else 1.0
        axes.hist(values, _BINS, range=(0.0, most), color=_BAR_COLOUR, edgecolor="white", lw=0.4)
        if score:
            axes.axvline(values.min(), color=BEST_COLOUR, linewidth=1.2)
        title = "Combined score (dimensionless)"
        # Several lines: names of errors are wider than a panel.
        name = f"{wrapped(quantity.title, 3.0)}\n(normalised, 0 to 1)"
        _finish_histogram(axes, title if score else name)
        axes.tick_params(labelleft=True, labelbottom=True)
    spare.set_axis_off()
    terms = [
        f"{weights[one.key]:g} {'(1 - coverage)' if one.key == 'coverage' else one.title.lower()}"
        for one in summary.metrics
        if weights[one.key]
    ]
    spare.text(
        0.02,
        0.95,
        "Combined score =\n   "
        + "\n + ".join(wrapped(term, 2.8, indent="      ") for term in terms)
        + "\n\nAll terms normalised:\n"
        + wrapped(f"0 at the minimum, 1 at the {percentile_text(summary)} and above.", 2.4),
        transform=spare.transAxes,
        va="top",
        fontsize=10,
        linespacing=1.5,
        color=TEXT_COLOUR,
    )
    best = Line2D([], [], color=BEST_COLOUR, linewidth=1.2, label="Smallest score: best pose")
    legend_below(body, [best, *_unknown(ranked)], 3)
    return figure


def _finish_histogram(axes: Axes, label: str) -> None:
    axes.set(xlabel=label, ylabel="Number of poses")
    axes.yaxis.set_major_locator(MaxNLocator(5, integer=True, steps=[1, 2, 5, 10]))
    if axes.get_xscale() == "linear":
        axes.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    axes.spines[["top", "right"]].set_visible(False)


def _unknown(quantities: tuple[PoseQuantity, ...]) -> list[Line2D]:
    """Legend entry for the poses that are in no histogram."""
    count = len(set().union(*(np.flatnonzero(~q.known).tolist() for q in quantities)))
    return count_entry("Without a number", count, UNKNOWN, ", not shown")


def _logarithmic(axes: Axes) -> None:
    """Make the horizontal axis logarithmic, with few and plain numbers."""
    axes.set_xscale("log")
    low, high = axes.xaxis.get_view_interval()
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0,) if high > 1e3 * low else (1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _position: number(value)))
    axes.xaxis.set_minor_formatter(NullFormatter())


def rays_figure(summary: SweepSummary) -> Figure:
    """Counts of each pose: rays that hit, by status; faces seen; shell triangles in view."""
    failed, uncounted = summary.rays[Status.GOOD] < 0, summary.polygons < 0
    counts = [(summary.faces, failed, "Faces of the part seen")]
    if not uncounted.all():
        counts.append((summary.polygons, uncounted, "Shell triangles in view"))
    figure, body = new_figure(
        8.0, 4.2 + 1.8 * len(counts), "What the rays of each pose hit", summary.subtitle
    )
    upper, *others = body.subplots(
        1 + len(counts), 1, sharex=True, squeeze=False, height_ratios=(3, *(2 for _ in counts))
    ).flat
    count = len(summary.polygons)
    edges = np.arange(count + 1) - 0.5
    base = np.zeros(count)
    entries: list[Patch | Line2D] = []
    for status, colour in _OUTCOME_COLOURS.items():
        if status not in summary.rays:
            continue
        top = base + np.maximum(summary.rays[status], 0)
        upper.stairs(top, edges, baseline=base, fill=True, color=colour)
        most = int(summary.rays[status].max())
        entries.append(Patch(facecolor=colour, label=f"{status.text.capitalize()}: up to {most:,}"))
        base = top
    upper.set_ylabel("Rays that hit the part")
    unknown = [failed]
    for axes, (numbers, without, label) in zip(others, counts, strict=True):
        axes.stairs(np.maximum(numbers, 0), edges, fill=True, color="0.45")
        axes.set_ylabel(label)
        unknown.append(without)
    best = summary.plan.best
    for axes in (upper, *others):
        axes.yaxis.set_major_formatter(EngFormatter(sep=""))
        axes.yaxis.set_major_locator(MaxNLocator(6, integer=True, steps=[1, 2, 5, 10]))
        axes.set_xlim(-0.5, count - 0.5)
        axes.set_ylim(bottom=0)
        axes.spines[["top", "right"]].set_visible(False)
    upper.plot(best, base[best] + 0.04 * base.max(), clip_on=False, zorder=4, **BEST)
    warned = np.flatnonzero(summary.warned.any(axis=1))
    if len(warned):
        upper.plot(warned, base[warned], clip_on=False, zorder=3, **WARNED)
    entries += marks(summary, np.any(unknown, axis=0))
    for axes, without in zip((upper, *others), unknown, strict=True):
        # A line without points, not cut off at the axes, would take part in the layout.
        if without.any():
            poses = np.flatnonzero(without)
            axes.plot(poses, np.zeros(len(poses)), clip_on=False, zorder=3, **UNKNOWN)
    lowest = (upper, *others)[-1]
    lowest.set_xlabel("Pose (number in the sweep)")
    lowest.xaxis.set_major_locator(MaxNLocator(10, integer=True, steps=[1, 2, 5, 10]))
    legend_below(body, entries, 3)
    return figure


def pareto_figure(summary: SweepSummary) -> Figure:
    """Coverage against displacement, coloured by lateral resolution, with the Pareto front."""
    error = "displacement" if summary.of_camera else "error"
    figure, body = new_figure(
        8.0, 6.0, f"Coverage against {error}, and the poses that none beats", summary.subtitle
    )
    axes = body.add_subplot()
    across, up, colour = summary.displacement, summary.coverage, summary.lateral
    known = across.known & up.known
    front = np.zeros(len(known), dtype=np.bool_)
    front[summary.front] = True
    for chosen, size, edge, width in ((known & ~front, 22, "none", 0.0), (front, 55, "black", 1.3)):
        coloured = chosen & colour.known
        axes.scatter(
            across.values[coloured],
            up.values[coloured],
            c=colour.values[coloured],
            s=size,
            edgecolors=edge,
            linewidths=width,
            zorder=3 if size > 30 else 2,
            **scale_of(colour).look,
        )
    grey = known & ~colour.known
    axes.plot(across.values[grey], up.values[grey], zorder=2, **UNKNOWN)
    best = summary.plan.best
    axes.plot(across.values[best], up.values[best], zorder=4, **BEST_RING)
    if across.logarithmic:
        _logarithmic(axes)
    axes.set(xlabel=across.label, ylabel=up.label)
    # Poses that all see nearly the same would lie in one line at the top.
    if up.values[known].min() < 0.5 * up.values[known].max():
        axes.set_ylim(bottom=0)
    finish_axes(axes)
    scale_of(colour).add_bar(body, ax=axes)
    entries = marks(summary, np.zeros(len(known), dtype=np.bool_), BEST_RING)
    warned = known & summary.warned.any(axis=1)
    axes.plot(across.values[warned], up.values[warned], zorder=3, **WARNED)
    for count, text in (
        (int(grey.sum()), "Without lateral resolution: {}"),
        (int((~known).sum()), "Without a number, not shown: {}"),
    ):
        if count:
            entries.append(Line2D([], [], label=text.format(count), **UNKNOWN))
    text = f"Pareto front in {error}, coverage, axial and lateral resolution"
    legend_below(body, [*count_entry(text, len(summary.front), FRONT_RING), *entries])
    return figure


_TICK_STEPS_DEG = (5.0, 10.0, 15.0, 30.0, 45.0, 60.0, 90.0)
_MOST_TICKS = 9
_MOST_PANELS = 12


def map_figure(summary: SweepSummary, quantity: PoseQuantity) -> Figure:
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


def _distance_figure(summary: SweepSummary, quantity: PoseQuantity) -> Figure:
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


def _draw_panel(
    axes: Axes, summary: SweepSummary, quantity: PoseQuantity, members: IntArray
) -> None:
    grid = summary.grid(members)
    if grid is None:
        _draw_dots(axes, summary, quantity, members)
    else:
        _draw_cells(axes, summary, quantity, grid)
    azimuth, elevation = summary.azimuth_on_maps, summary.elevation
    warned = members[summary.warned[members].any(axis=1)]
    axes.plot(azimuth[warned], elevation[warned], zorder=3, clip_on=False, **WARNED)
    best = summary.plan.best
    if best in members:
        axes.plot(azimuth[best], elevation[best], zorder=4, clip_on=False, **BEST)
    axes.set(xlabel=f"Azimuth {summary.angles_of} (°)", ylabel=f"Elevation {summary.angles_of} (°)")
    for axis, angles in ((axes.xaxis, azimuth), (axes.yaxis, elevation)):
        axis.set_major_formatter(lambda value, _position: number(round(value, 6)))
        ticks = None if grid is None else _ticks(np.unique(angles[grid]))
        if ticks is not None:
            axis.set_major_locator(FixedLocator(ticks.tolist()))
            continue
        low, high = axis.get_view_interval()
        step = next((s for s in _TICK_STEPS_DEG if (high - low) / s <= _MOST_TICKS), None)
        small = high - low < 2 * _TICK_STEPS_DEG[0]
        axis.set_major_locator(
            MaxNLocator(6, steps=[1, 2, 5, 10]) if step is None or small else MultipleLocator(step)
        )
    axes.xaxis.set_major_formatter(lambda value, _position: number(round(value, 6) % 360.0))


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


def _draw_cells(axes: Axes, summary: SweepSummary, quantity: PoseQuantity, grid: IntArray) -> None:
    azimuths = np.unique(summary.azimuth_on_maps[grid])
    elevations = np.unique(summary.elevation[grid])
    rows = np.clip(_edges(elevations), -90.0, 90.0)
    values = np.ma.masked_invalid(quantity.values[grid])
    axes.set_facecolor("0.93")
    axes.pcolormesh(
        _edges(azimuths),
        rows,
        values,
        # Vector figures would show white seams between cells.
        rasterized=True,
        **scale_of(quantity).look,
    )
    row, column = np.nonzero(values.mask & np.ones(grid.shape, dtype=np.bool_))
    # The middle of the cell as it is drawn: that of a pole is cut in half.
    middle = 0.5 * (rows[1:] + rows[:-1])
    axes.plot(azimuths[column], middle[row], zorder=3, **UNKNOWN)


def _edges(centres: FloatArray) -> FloatArray:
    """Ends of the cells around ascending centres."""
    between = 0.5 * (centres[1:] + centres[:-1])
    return np.concatenate(([2 * centres[0] - between[0]], between, [2 * centres[-1] - between[-1]]))


def _draw_dots(
    axes: Axes, summary: SweepSummary, quantity: PoseQuantity, members: IntArray
) -> None:
    known, unknown = members[quantity.known[members]], members[~quantity.known[members]]
    azimuth, elevation = summary.azimuth_on_maps, summary.elevation
    axes.scatter(
        azimuth[known],
        elevation[known],
        c=quantity.values[known],
        s=float(np.clip(2.0e4 / len(members), 6.0, 60.0)),
        edgecolors="0.3",
        linewidths=0.4,
        zorder=2,
        **scale_of(quantity).look,
    )
    axes.plot(azimuth[unknown], elevation[unknown], zorder=3, **UNKNOWN)
    axes.grid(color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.margins(0.05)
