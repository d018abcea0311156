"""Figure of a study that compares times: each stage along the axis, and the search's share."""

from __future__ import annotations

from typing import Any

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from iriftrace.sweep_style import TEXT_COLOUR, new_figure

TITLES = {
    "rays": ("Time of each stage against the number of rays", "rays", "Rays launched"),
    "polygons": (
        "Time of each stage against the number of triangles",
        "triangles_per_shell",
        "Triangles per shell",
    ),
}
NOTE: dict[str, Any] = {"fontsize": 8, "color": TEXT_COLOUR, "loc": "right", "pad": 3}
# Colours that colour-blind eyes tell apart (Okabe and Ito).
STAGES = {
    "load": ("Load, build BVH", "#999999", "v"),
    "build": ("Tables, layer at the wall", "#cc79a7", "^"),
    "straight": ("Straight trace", "#56b4e9", "o"),
    "refracted": ("Refracted trace", "#d55e00", "s"),
    "search": ("Its intersection search alone", "#0072b2", "D"),
    "metrics": ("Metrics", "#009e73", "P"),
    "write": ("EXR", "#e69f00", "X"),
}


def timing_figure(dataset: xr.Dataset) -> Figure:
    """Draw a result of :func:`iriftrace.studies.timing.run_timing`."""
    title, across, label = TITLES[dataset.attrs["study"]]
    subtitle = (
        f"Fastest of {dataset.attrs['repeats']} pictures, {dataset.attrs['variant']}; times belong "
        "to the machine, ratios do not"
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
        for stage, (name, colour, marker) in STAGES.items():
            upper.plot(
                places,
                some[f"time_{stage}"].values,
                color=colour,
                marker=marker,
                markersize=4.5,
                linewidth=1.2,
                label=name,
            )
        upper.set(xscale="log", yscale="log")
        upper.set_title(text.replace(": ", ":\n", 1), fontsize=9)
        share = 100.0 * some["search_share"].values
        lower.plot(places, share, color="#0072b2", marker="D", markersize=4.5, linewidth=1.2)
        lower.set_ylim(0, max(110.0, 1.05 * float(dataset["search_share"].max()) * 100.0))
        lower.axhline(100.0, color="0.6", linewidth=0.8, linestyle=":")
        if share.max() > 100.0:
            lower.set_title("above 100 %: noise, the search is timed in a run of its own", **NOTE)
        lower.set_xlabel(label)
        ticks = places.tolist()
        lower.set_xticks(ticks, [_short(tick) for tick in ticks])
        lower.set_xticks([], minor=True)
        for axes in (upper, lower):
            _finish(axes)
    grid[0, 0].set_ylabel("Time / s")
    grid[1, 0].set_ylabel("Search, share of the\nrefracted trace / %")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    body.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=9, frameon=False)
    return figure


def _short(count: float) -> str:
    """A number of things with three digits, such as 4.7 k."""
    for factor, letter in ((1e6, "M"), (1e3, "k")):
        if count >= factor:
            return f"{count / factor:.3g} {letter}"
    return f"{count:g}"


def _finish(axes: Axes) -> None:
    axes.grid(color="0.92", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
