"""Write a Matplotlib figure as PNG or PDF, without the global state of pyplot."""

from __future__ import annotations

from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import FigureCanvasPdf
from matplotlib.figure import Figure

from iriftrace.errors import InputError
from iriftrace.whole_file import whole_file


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
