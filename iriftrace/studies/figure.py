"""The figure of any study."""

from __future__ import annotations

import xarray as xr
from matplotlib.figure import Figure

from iriftrace.studies.figure_comparison import TITLES, comparison_figure
from iriftrace.studies.figure_timing import timing_figure


def study_figure(dataset: xr.Dataset) -> Figure:
    """Draw what :func:`iriftrace.studies.cases.read_study` reads."""
    compares = dataset.attrs["study"] in TITLES
    return comparison_figure(dataset) if compares else timing_figure(dataset)
