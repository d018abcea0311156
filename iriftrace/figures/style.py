"""Look of all figures: layout, titles, marks, colour scales, and their files."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from attrs import frozen
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import FigureCanvasPdf
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.colors import FuncNorm, LogNorm, Normalize
from matplotlib.figure import Figure, SubFigure
from matplotlib.gridspec import GridSpec
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from iriftrace.core.arrays import BoolArray, FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.files import whole_file
from iriftrace.core.units import ZERO_CELSIUS_K, counted
from iriftrace.planning.quantities import PoseQuantity
from iriftrace.planning.summary import SweepSummary
from iriftrace.sweep.measures import Limits

COLOUR_MAP = "viridis"
SIGNED_COLOUR_MAP = "RdBu_r"
"""Colours about 0: as even in steps as those of magnitudes, and as light at both ends."""

BEST_COLOUR = "#d7191c"
TEXT_COLOUR = "0.35"
DPI = 200

FAINT = 0.05
"""Fraction of the largest effect of the air below which one is not drawn."""

# Colours that colour-blind eyes can tell apart (Okabe and Ito, 2008).
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")


Look = dict[str, Any]
"""A line or mark, as keywords of Matplotlib's ``plot``."""


def _mark(marker: str, size: float, edge: str, width: float, face: str = "none") -> Look:
    """A single mark, size and width in points."""
    return {"marker": marker, "ms": size, "mec": edge, "mew": width, "mfc": face, "ls": "none"}


BEST = _mark("*", 15, "white", 0.9, BEST_COLOUR)
BEST_RING = _mark("o", 12, BEST_COLOUR, 2.0)
FRONT_RING = _mark("o", 7, "black", 1.3)
UNKNOWN = _mark("o", 6, "0.5", 1.1)
WARNED = _mark("X", 5.5, "white", 0.6, "black")

_CANVAS = {".png": FigureCanvasAgg, ".pdf": FigureCanvasPdf}


def write_figure(figure: Figure, path: str | Path) -> None:
    """Write a figure as PNG or PDF, completely or not at all; the same figure gives the same bytes.

    Raises
    ------
    InputError
        The name ends in neither ``.png`` nor ``.pdf``, or the file cannot be written.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in _CANVAS:
        raise InputError(
            f"{path} ends in neither .png nor .pdf, the formats of the figures; rename it.",
            code="file.ending",
        )
    with whole_file(path) as temporary:
        temporary.write_bytes(figure_bytes(figure, suffix))


def figure_bytes(figure: Figure, suffix: str = ".png") -> bytes:
    """The content of a ``.png`` or ``.pdf`` file, drawn without the global state of pyplot."""
    content = BytesIO()
    undated = {"CreationDate": None} if suffix == ".pdf" else None
    _CANVAS[suffix](figure).print_figure(
        content, format=suffix[1:], dpi=figure.dpi, metadata=undated
    )
    return content.getvalue()


def new_figure(
    width_in: float, height_in: float, title: str, subtitle: str
) -> tuple[Figure, SubFigure]:
    """A titled figure whose parts make room for each other, and the room below the titles."""
    layout = ConstrainedLayoutEngine(h_pad=0.06, w_pad=0.08, hspace=0.04, wspace=0.04)
    figure = Figure(figsize=(width_in, height_in), dpi=DPI, layout=layout)
    figure.suptitle(wrapped(title, width_in, 12), fontsize=12)
    body = figure.add_subfigure(GridSpec(1, 1, figure=figure)[0])
    body.suptitle(subtitle, fontsize=9, color=TEXT_COLOUR)
    return figure, body


_WIDTH_OF_LETTER = 0.55
"""Mean width of a letter as a fraction of the size of its font."""


def wrapped(text: str, width_in: float, size: float = 10.0, indent: str = "") -> str:
    """A text in lines that are at most so wide in a font of so many points."""
    return fill(text, int(72 * width_in / (_WIDTH_OF_LETTER * size)), subsequent_indent=indent)


def legend_below(
    figure: Figure | SubFigure, entries: Sequence[Artist], columns: int = 1, **more: Any
) -> Legend:
    """A legend without a frame below everything that is drawn, in as many columns as have room."""
    letters = [len(str(entry.get_label())) for entry in entries]
    room = figure.bbox.width / figure.dpi * 72 / 9  # in font sizes
    # A column has a mark and gaps, together as wide as five letters are high.
    while columns > 1 and room < sum(
        5 + _WIDTH_OF_LETTER * max(part, default=0) for part in np.array_split(letters, columns)
    ):
        columns -= 1
    place = {"loc": "outside lower center", "ncols": columns, "fontsize": 9, "frameon": False}
    return figure.legend(handles=list(entries), **{**place, **more})


def finish_axes(axes: Axes) -> None:
    """Add a faint grid behind the lines and remove the frame's right and upper side."""
    axes.grid(color="0.92", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


@frozen(eq=False)
class ColourScale:
    """Colours of numbers, and the colour bar that explains them.

    Values that are not finite are ignored; if others lie beyond the limits, the bar has a
    pointed end. The label gives name and unit. Those `of_air` are of temperatures, degC, and linear
    in 1/T, hence in the refractivity.
    """

    values: FloatArray
    limits: Limits
    label: str
    logarithmic: bool
    colour_map: str = COLOUR_MAP
    of_air: bool = False

    @property
    def norm(self) -> Normalize:
        """The mapping of numbers to 0 .. 1."""
        if self.of_air:
            return FuncNorm((_of_temperature, _temperature_of), *self.limits)
        # Clipped, because a ray that crosses no shell has a displacement of 0, which has no
        # logarithm: it would leave a hole in the part.
        return (LogNorm if self.logarithmic else Normalize)(*self.limits, clip=True)

    @property
    def look(self) -> Look:
        """Keywords that give an artist of Matplotlib these colours."""
        return {"norm": self.norm, "cmap": self.colour_map}

    @property
    def ticks(self) -> FloatArray:
        """Round numbers that label the bar without crowding it."""
        if self.of_air:
            return _temperature_ticks(self.norm)
        return (round_ticks if self.logarithmic else even_ticks)(self.limits)

    def rgb(self, values: ArrayLike) -> FloatArray:
        """(n, 3) array, 0 to 1, of (n,) numbers."""
        return np.asarray(colormaps[self.colour_map](self.norm(values)))[:, :3]

    def add_bar(
        self, figure: Figure | SubFigure, drawn: ScalarMappable | None = None, **place: Any
    ) -> Colorbar:
        """Add the colour bar, of an artist with these colours if one is given.

        `place` is as for Matplotlib's ``colorbar``: ``ax`` or ``cax``, ``location`` ...
        """
        known = self.values[np.isfinite(self.values)]
        room = 1e-9 * max(map(abs, self.limits))
        beyond = (known < self.limits[0] - room).any(), (known > self.limits[1] + room).any()
        ends = {(True, True): "both", (True, False): "min", (False, True): "max"}
        if "ax" in place:
            place = {"aspect": 30, "pad": 0.02, **place}
        bar = figure.colorbar(
            drawn or ScalarMappable(**self.look),
            extend=ends.get((bool(beyond[0]), bool(beyond[1])), "neither"),
            label=self.label,
            **place,
        )
        bar.set_ticks(self.ticks.tolist(), labels=[number(tick) for tick in self.ticks])
        bar.set_ticks([], minor=True)
        return bar


def _of_temperature(celsius: ArrayLike) -> FloatArray:
    return -1.0 / (np.asarray(celsius, dtype=np.float64) + ZERO_CELSIUS_K)


def _temperature_of(place: ArrayLike) -> FloatArray:
    return -1.0 / np.asarray(place, dtype=np.float64) - ZERO_CELSIUS_K


def _temperature_ticks(norm: Normalize) -> FloatArray:
    """Round temperatures that do not crowd the colour bar."""
    rounds = np.array([20, 30, 40, 50, 75, 100, 150, 200, 300, 400, 500, 700, 1000, 1500, 2000])
    low, high = (float(t) for t in norm.inverse(np.array((0.0, 1.0))))
    ticks: list[float] = []
    for tick in rounds[(rounds >= low) & (rounds <= high)].tolist():
        if not ticks or norm(tick) - norm(ticks[-1]) > 0.045:
            ticks.append(tick)
    return np.array(ticks if len(ticks) > 1 else [round(low), round(high)], dtype=np.float64)


def round_ticks(limits: Limits) -> FloatArray:
    """Round numbers between two limits that label a logarithmic axis without crowding it."""
    low, high = limits
    if low > 0.0:
        decades = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
        for steps in ((1,), (1, 3), (1, 2, 5), (1, 1.5, 2, 3, 5, 7)):
            ticks = np.outer(decades, steps).ravel()
            ticks = ticks[(ticks >= low) & (ticks <= high)]
            if len(ticks) >= 5:
                return np.asarray(ticks, dtype=np.float64)
    return even_ticks(limits)


def even_ticks(limits: Limits, most: int = 6) -> FloatArray:
    """Round numbers at equal steps between two limits."""
    low, high = limits
    locator = MaxNLocator(most, steps=[1, 2, 2.5, 5, 10])
    ticks: FloatArray = np.asarray(locator.tick_values(low, high))
    return ticks[(ticks >= low) & (ticks <= high)]


def number(value: float) -> str:
    """A short number with a real minus sign."""
    # Adding 0 turns -0 into 0.
    return f"{value + 0.0:g}".replace("-", "\N{MINUS SIGN}")


_MOST_BEYOND = 0.1
"""Largest fraction of the poses that may have the colour of the scale's end."""


def scale_of(quantity: PoseQuantity) -> ColourScale:
    """The colours of a metric over the poses of a sweep: the same in every figure."""
    low, high = quantity.limits if np.isfinite(quantity.limits[0]) else (0.0, 1.0)
    logarithmic = quantity.logarithmic
    known = quantity.values[quantity.known]
    # Limits are those of means; with the scatter added, most poses may lie beyond them.
    if np.count_nonzero(known > high) > _MOST_BEYOND * len(known):
        low, high, logarithmic = float(known.min()), float(known.max()), True
    if high - low <= 1e-6 * max(abs(low), abs(high)):
        # Poses that do not differ: limits far enough apart for a scale.
        room = 0.05 * abs(high) or 0.5
        low, high = low - room, high + room
    return ColourScale(quantity.values, (low, high), quantity.label, logarithmic and low > 0.0)


def marks(summary: SweepSummary, unknown: BoolArray, mark: Look = BEST) -> list[Line2D]:
    """Legend entries: the best pose, and those without a number or warned of if there are any."""
    best = Line2D([], [], label=f"Best pose by score: {summary.plan.best}", **mark)
    warned = summary.warned.any(axis=1).sum()
    return [
        best,
        *count_entry("Without a number", unknown.sum(), UNKNOWN),
        *count_entry("Warned of, see the ranking", warned, WARNED),
    ]


def count_entry(text: str, count: int, mark: Look, remark: str = "") -> list[Line2D]:
    """Legend entry that counts the poses with a mark, if there are any."""
    label = f"{text}: {counted(count, 'pose')}{remark}"
    return [Line2D([], [], label=label, **mark)] if count else []
