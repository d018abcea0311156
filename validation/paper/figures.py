"""Figures of studies: differences of hits, or times, along the varied quantity."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, MaxNLocator

from iriftrace.figures.style import (
    COLOURS,
    TEXT_COLOUR,
    Look,
    finish_axes,
    legend_below,
    new_figure,
    number,
    round_ticks,
)
from validation.paper.study import reference_words

_MARKERS = ("o", "s", "^", "v", "D", "P")

_COMPARISONS = {
    "layers": "Number of shells: difference of the refracted hits from the reference",
    "smoothing": "Smoothed shells: difference of the refracted hits from the finest field",
    "mesh": "Resolution of the flow solution: difference of the refracted hits",
}
_ROWS = (
    (("rmse",), "rmse / \N{MICRO SIGN}m"),
    (("rmse_trimmed",), "rmse without the worst\n1 % of the rays / \N{MICRO SIGN}m"),
    (("p95", "median"), "95th percentile (open),\nmedian (full) / \N{MICRO SIGN}m"),
)

_TIMINGS = {
    "rays": ("Time of each stage against the number of rays", "rays", "Rays launched"),
    "polygons": (
        "Time of each stage against the number of triangles",
        "triangles_per_shell",
        "Triangles per shell",
    ),
}
_STAGES = {
    "load": ("Load, build BVH", "#999999", "v"),
    "build": ("Tables, layer at the wall", COLOURS[3], "^"),
    "straight": ("Straight trace", COLOURS[5], "o"),
    "refracted": ("Refracted trace", COLOURS[1], "s"),
    "search": ("Its intersection search alone", COLOURS[0], "D"),
    "metrics": ("Metrics", COLOURS[2], "P"),
    "write": ("EXR", COLOURS[4], "X"),
}


def study_figure(dataset: xr.Dataset) -> Figure:
    """Draw a result of :func:`validation.paper.study.read_study`."""
    compares = dataset.attrs["study"] in _COMPARISONS
    return comparison_figure(dataset) if compares else timing_figure(dataset)


def comparison_figure(dataset: xr.Dataset) -> Figure:
    """Draw a result of `validation.paper.study.run_study` that compares hits."""
    (axis,) = set(dataset["rmse"].dims) - {"mode", "reference"}
    references = [str(name) for name in dataset["reference"].values]
    title = _COMPARISONS[dataset.attrs["study"]]
    subtitle = "Rays that are good in both runs; a ray that is good in only one is unmatched"
    height = 9.2 + 0.18 * len(dataset["mode"])
    figure, body = new_figure(4.4 * len(references) + 1.0, height, title, subtitle)
    grid = body.subplots(4, len(references), sharex=True, sharey="row", squeeze=False)
    for column, reference in enumerate(references):
        _draw_column(list(grid[:, column]), dataset.sel(reference=reference), dataset[str(axis)])
        grid[0, column].set_title(f"Against {reference_words(reference)}", fontsize=10)
    for axes, (_, label) in zip(grid[:3, 0], _ROWS, strict=True):
        axes.set_ylabel(label)
        low, high = axes.get_ylim()
        ticks = round_ticks((low, high)).tolist()
        # The columns have the same scales, so this labels them all.
        axes.set_yticks(ticks, labels=[number(tick) for tick in ticks])
        axes.set_yticks([], minor=True)
        axes.set_ylim(low, high)
    grid[3, 0].set_ylabel("unmatched rays")
    entries = [
        Line2D([], [], label=str(text), **_line(mode))
        for mode, text in enumerate(dataset["mode_description"].values)
    ]
    legend_below(body, entries)
    return figure


def _draw_column(rows: Sequence[Axes], against: xr.Dataset, along: xr.DataArray) -> None:
    """Draw the differences from one reference, and below them the unmatched rays."""
    numbers = along.values.dtype.kind in "iuf"
    places = along.values.astype(float) if numbers else np.arange(len(along))
    for axes, (names, _) in zip(rows, _ROWS, strict=False):
        for mode in range(len(against["mode"])):
            for name in names:
                values = 1e3 * against[name].values[mode]
                # A run compared with itself has no difference, and no logarithm.
                shown = np.where(values > 1e-9, values, np.nan)
                axes.plot(places, shown, **_line(mode, hollow=len(names) > 1 and name == "p95"))
        axes.set_yscale("log")
    last = rows[-1]
    lost = (against["only_here"] + against["only_reference"]).where(against["matched"] >= 0)
    for mode, counts in enumerate(lost.values):
        last.plot(places, counts, clip_on=False, **_line(mode))
    last.set_yscale("symlog", linthresh=1.0)
    last.set_ylim(0, max(1.0, last.get_ylim()[1]))
    last.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    last.set_yticks([], minor=True)
    last.set_xlabel(along.attrs["long_name"])
    if not numbers:
        last.set_xticks(places, along.values.astype(str), rotation=25, ha="right")
    elif places.min() > 0 and places.max() > 30:
        last.set_xscale("log")
        ticks = [n for n in (1, 2, 3, 5, 10, 20, 40, 80, 160, 320) if n <= places.max()]
        last.set_xticks(ticks, [str(tick) for tick in ticks])
        last.set_xticks([], minor=True)
    else:
        last.xaxis.set_major_locator(MaxNLocator(10, integer=True, steps=[1, 2, 5, 10]))
    for axes in rows:
        finish_axes(axes)


def _line(mode: int, hollow: bool = False) -> Look:
    colour = COLOURS[mode % len(COLOURS)]
    return {
        "color": colour,
        "marker": _MARKERS[mode % len(_MARKERS)],
        "markersize": 4.5,
        "markerfacecolor": "white" if hollow else colour,
        "linewidth": 1.2,
        "linestyle": "--" if hollow else "-",
    }


def timing_figure(dataset: xr.Dataset) -> Figure:
    """Draw a result of `validation.paper.study.run_study` that measures times."""
    title, across, label = _TIMINGS[dataset.attrs["study"]]
    subtitle = (
        f"Fastest of {dataset.attrs['repeats']} pictures, {dataset.attrs['variant']}; times depend "
        "on the machine, ratios do not"
    )
    modes = [str(text) for text in dataset["mode_description"].values]
    figure, body = new_figure(5.2 * len(modes), 7.4, title, subtitle)
    grid = body.subplots(
        2, len(modes), sharex=True, sharey="row", squeeze=False, height_ratios=(3, 1)
    )
    for column, text in enumerate(modes):
        some = dataset.isel(mode=column)
        places = some[across].values
        upper, lower = grid[:, column]
        for stage, (name, colour, marker) in _STAGES.items():
            times = some[f"time_{stage}"].values
            upper.plot(places, times, marker, ls="-", c=colour, ms=4.5, lw=1.2, label=name)
        upper.set(xscale="log", yscale="log")
        upper.set_title(text.replace(": ", ":\n", 1), fontsize=9)
        percent = 100.0 * some["search_share"].values
        lower.plot(places, percent, color=COLOURS[0], marker="D", markersize=4.5, linewidth=1.2)
        lower.set_ylim(0, max(110.0, 1.05 * float(dataset["search_share"].max()) * 100.0))
        lower.axhline(100.0, color="0.6", linewidth=0.8, linestyle=":")
        if percent.max() > 100.0:
            note = "above 100 %: noise, the search is timed in a separate run"
            lower.set_title(note, fontsize=8, color=TEXT_COLOUR, loc="right", pad=3)
        lower.set_xlabel(label)
        ticks = places.tolist()
        lower.set_xticks(ticks, [_short(tick) for tick in ticks])
        lower.set_xticks([], minor=True)
        for axes in (upper, lower):
            finish_axes(axes)
    grid[0, 0].set_ylabel("Time / s")
    grid[1, 0].set_ylabel("Search, fraction of the\nrefracted trace / %")
    legend_below(body, grid[0, 0].get_legend_handles_labels()[0], 4)
    return figure


def _short(count: float) -> str:
    """A number of things with three digits, such as 4.7 k."""
    for factor, letter in ((1e6, "M"), (1e3, "k")):
        if count >= factor:
            return f"{count / factor:.3g} {letter}"
    return f"{count:g}"
