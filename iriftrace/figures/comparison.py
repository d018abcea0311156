"""Figure of a comparison: measured and simulated shifts, and residuals with and without motion."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from iriftrace.core.arrays import FloatArray
from iriftrace.figures.style import SIGNED_COLOUR_MAP, ColourScale, legend_below
from iriftrace.measuring.comparison import Comparison

COLOUR_PERCENTILE = 98.0
"""Outliers of several pixels at silhouettes; this percentile keeps them out of the colours."""

_DPI = 160
_BACKGROUND = "0.85"
_GREY_MAP = "Not compared: not measured, or no good pixel of the part in the rendering"
_GREY_MARKERS = "No marker that is compared"
_COMPONENTS = ("across, u", "down, v")


def comparison_figure(
    comparison: Comparison, resolution: tuple[int, int] | None, title: str
) -> Figure:
    """Draw both components of the shifts and residuals.

    Measured and simulated shifts have one scale of colours, the residuals another one.

    Parameters
    ----------
    comparison
        The comparison to draw.
    resolution
        Width and height of a map, which is drawn as a picture; None draws markers.
    title
        Text of the second line.
    """
    signals = {"Measured": comparison.measured, "Simulated": comparison.simulated}
    residuals = {"Residual": comparison.residual}
    if comparison.motion is not None:
        residuals["Residual without camera motion"] = comparison.remainder
    low, high = comparison.places.min(axis=0), comparison.places.max(axis=0)
    margin = 0.02 * (high - low).max() + 1.0
    aspect = (high[1] - low[1] + 2 * margin) / (high[0] - low[0] + 2 * margin)
    columns = len(signals) + len(residuals)
    height = float(np.clip(2.4 + 2 * 2.9 * aspect, 4.5, 13.0))
    figure = Figure(
        figsize=(3.1 * columns + 0.6, height),
        dpi=_DPI,
        layout=ConstrainedLayoutEngine(h_pad=0.05, w_pad=0.05, compress=True),
    )
    grid = figure.subplots(2, columns, sharex=True, sharey=True, squeeze=False)
    first = 0
    for panels, label in ((signals, "Shift (px)"), (residuals, "Residual (px)")):
        values = np.concatenate(list(panels.values())).ravel()
        limit = float(np.percentile(np.abs(values), COLOUR_PERCENTILE)) or 1.0
        scale = ColourScale(values, (-limit, limit), label, False, SIGNED_COLOUR_MAP)
        for column, (name, shifts) in enumerate(panels.items(), first):
            grid[0, column].set_title(name, fontsize=10)
            for axes, component in zip(grid[:, column], shifts.T, strict=True):
                _draw(axes, comparison.places, component, resolution, scale)
        some = grid[:, first : first + len(panels)].ravel().tolist()
        scale.add_bar(figure, ax=some, location="bottom", shrink=0.9)
        first += len(panels)
    for row in range(2):
        grid[row, 0].set_ylabel(f"{_COMPONENTS[row]}\nRow (px)")
    for axes in grid[1]:
        axes.set_xlabel("Column (px)")
    for axes in grid.ravel():
        axes.set(
            xlim=(low[0] - margin, high[0] + margin),
            ylim=(high[1] + margin, low[1] - margin),
            aspect="equal",
        )
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(MaxNLocator(4, integer=True))
    text = _GREY_MAP if resolution else _GREY_MARKERS
    legend_below(figure, [Patch(facecolor=_BACKGROUND, label=text)])
    figure.suptitle(_headline(comparison) + "\n" + title, fontsize=11)
    return figure


def _draw(
    axes: Axes,
    places: FloatArray,
    values: FloatArray,
    resolution: tuple[int, int] | None,
    scale: ColourScale,
) -> None:
    axes.set_facecolor(_BACKGROUND)
    if resolution is None:
        size = float(np.clip(4000.0 / len(places), 4.0, 40.0))
        across, down = places.T
        axes.scatter(across, down, c=values, s=size, edgecolors="0.3", linewidths=0.3, **scale.look)
        return
    width, height = resolution
    picture = np.full((height, width), np.nan)
    column, row = np.floor(places).astype(int).T
    picture[row, column] = values
    axes.imshow(picture, extent=(0, width, height, 0), interpolation="nearest", **scale.look)


def _headline(comparison: Comparison) -> str:
    rms = float(np.sqrt((comparison.residual**2).sum(axis=1).mean()))
    text = f"Measured less simulated shift: rms {rms:.3g} px"
    if comparison.motion is None:
        return text
    motion = comparison.motion
    if not motion.used.all():
        outliers = np.count_nonzero(~motion.used)
        text += f"; {motion.rms_before_px:.3g} px but for {outliers:,} outliers"
    return f"{text}, {motion.rms_after_px:.3g} px without the camera's motion"
