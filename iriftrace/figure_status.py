"""Pixels that see the part but have no displacement, in a colour for each reason."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.patches import Patch
from numpy.typing import NDArray

from iriftrace.status import Status

BoolArray = NDArray[np.bool_]

# Flat colours that differ from each other, from the white background, from the colour map and from
# the black lines of silhouettes, beside which most rays lie whose refracted twin misses: for these
# the vermilion of Okabe and Ito, which colour-blind eyes tell from viridis and from greys.
COLOURS: dict[Status, tuple[str, str]] = {
    Status.OUT_OF_FOCUS: ("0.84", "Out of focus"),
    Status.BLOCKED: ("0.70", "Another object in the way"),
    Status.REFRACTED_MISSED: ("#d55e00", "Refracted ray missed the part"),
    Status.ONLY_REFRACTED: ("0.56", "Only the refracted ray hit"),
    Status.INDEX_MISMATCH: ("0.42", "Index steps do not add up"),
    Status.GAVE_UP: ("0.27", "Gave up (crossing limit)"),
}


def draw_without_displacement(
    axes: Axes, status: NDArray[np.int64], others: BoolArray, extent: tuple[int, int, int, int]
) -> list[Patch]:
    """Paint the pixels without a displacement.

    Parameters
    ----------
    axes
    status
        (h, w) array of status codes.
    others
        (h, w) mask of the pixels to paint.
    extent
        Of the picture: left, right, bottom, top.

    Returns
    -------
    list of Patch
        Entries of the legend.
    """
    order = list(COLOURS)
    codes = np.full(status.shape, np.nan)
    total = int((status != Status.MISSED).sum())
    entries = []
    for number, code in enumerate(order):
        pixels = others & (status == code)
        count = int(pixels.sum())
        if count:
            codes[pixels] = number
            colour, label = COLOURS[code]
            text = f"{label}: {count:,} px ({_percent(count / total)})"
            entries.append(Patch(facecolor=colour, edgecolor="0.3", linewidth=0.4, label=text))
    axes.imshow(
        codes,
        norm=Normalize(-0.5, len(order) - 0.5),
        cmap=ListedColormap([colour for colour, _ in COLOURS.values()]),
        extent=extent,
        interpolation="nearest",
    )
    return entries


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %" if share >= 0.0005 else "< 0.1 %"
