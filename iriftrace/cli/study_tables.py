"""Tables that ``iriftrace study`` prints."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.table import Table

from iriftrace.cli.console import out

if TYPE_CHECKING:
    import xarray as xr


STAGES = ("straight", "metrics", "write", "load", "build")


def print_comparison(dataset: xr.Dataset) -> None:
    """Print a table for each reference: differences of the hits in micrometres."""
    from iriftrace.studies.study import reference_words

    (axis,) = set(dataset["rmse"].dims) - {"mode", "reference"}
    for reference in dataset["reference"].values:
        rows = []
        for place, mode in product(dataset[axis].values, dataset["mode"].values):
            case = dataset.sel({"mode": mode, axis: place, "reference": reference})
            if int(case["matched"]) < 0:
                rows.append((place, mode, "no shell left"))
                continue
            names = ("median", "p95", "rmse_trimmed", "rmse")
            median, *others = (f"{1e3 * float(case[name]):.3f}" for name in names)
            fraction = f"{float(case['median']) / float(case['displacement_median']):.1%}"
            unmatched = int(case["only_here"]) + int(case["only_reference"])
            rows.append((place, mode, median, fraction, *others, unmatched, int(case["rays_lost"])))
        print_table(
            f"Difference from {reference_words(str(reference))} / um",
            (str(axis), "mode"),
            ("median", "ratio", "p95", "trimmed", "rmse", "un-\nmatched", "lost"),
            rows,
        )
    out.print(
        "ratio: median over the median displacement; trimmed: rmse without the 1 % of rays that "
        "differ most; unmatched: rays that are good in only one of the two runs; lost: rays of the "
        "case whose straight twin hits the part in focus, but which are not good."
    )


def print_timing(dataset: xr.Dataset) -> None:
    """Print times as ratios: of stages to the refracted trace, and of this to the first case's."""
    (axis,) = set(dataset["time_search"].dims) - {"mode"}
    across = "rays" if dataset.attrs["study"] == "rays" else "triangles_per_shell"
    for mode in dataset["mode"].values:
        cases = [dataset.sel(mode=mode).isel({axis: n}) for n in range(dataset.sizes[axis])]
        rows = []
        for case in cases:
            refracted = float(case["time_refracted"])
            growth = f"{refracted / float(cases[0]['time_refracted']):.2f}"
            stages = (float(case[f"time_{stage}"]) / refracted for stage in STAGES)
            rows.append(
                (
                    f"{int(case[across]):,}",
                    growth if case["process"] == cases[0]["process"] else "other run",
                    *(f"{ratio:.2f}" for ratio in (float(case["search_share"]), *stages)),
                )
            )
        headings = (across.replace("_", " "), "growth", "search", *STAGES)
        print_table(f"{mode}: times over that of the refracted trace", (), headings, rows)
    out.print(
        "growth: refracted trace over that of the first case, if one run measured both; search: "
        "the intersection search of the refracted trace, the rest of it is refraction."
    )
    if float(dataset["search_share"].max()) > 1.0:
        out.print(
            "A search above 1 is noise: the search is timed in a separate run, so that other "
            "programs on the machine can make it the longer one."
        )


def print_table(
    title: str, texts: Sequence[str], numbers: Sequence[str], rows: Sequence[Sequence[object]]
) -> None:
    """Print a table in the terminal's width, or wider if words and numbers would be cut."""
    # Rules between the columns would cost width.
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=0, show_edge=False)
    for heading in texts:
        table.add_column(heading, overflow="fold")
    for heading in numbers:
        table.add_column(heading, justify="right")
    for row in rows:
        table.add_row(*map(str, row))
    # A measurement ends at the console's width, unless the options have a larger one.
    least = out.measure(table, options=out.options.update(width=1000)).minimum
    if least > out.width:
        table.width = least
    out.print(table, crop=False, soft_wrap=True)
    out.print()
