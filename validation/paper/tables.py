"""Tables of the studies."""

from __future__ import annotations

from itertools import product

import xarray as xr

from iriftrace.cli.console import out, print_table
from validation.paper.study import reference_words

STAGES = ("straight", "metrics", "write", "load", "build")


def print_comparison(dataset: xr.Dataset) -> None:
    """Print a table for each reference: differences of the hits in micrometres."""
    (axis,) = map(str, set(dataset["rmse"].dims) - {"mode", "reference"})
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
            (axis, "mode", "median", "ratio", "p95", "trimmed", "rmse", "un-\nmatched", "lost"),
            rows,
            texts=(axis, "mode"),
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
        print_table(f"{mode}: times over that of the refracted trace", headings, rows)
    out.print(
        "growth: refracted trace over that of the first case, if one run measured both; search: "
        "the intersection search of the refracted trace, the rest of it is refraction."
    )
    if float(dataset["search_share"].max()) > 1.0:
        out.print(
            "A search above 1 is noise: the search is timed in a separate run, so that other "
            "programs on the machine can make it the longer one."
        )
