"""Runs a study behind a progress bar, prints its tables and draws its figure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from iriftrace.cli.console import out, working
from iriftrace.cli.pose_progress import pose_progress

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.studies.comparison import Comparison
    from iriftrace.studies.timing import Timing

_WIDEST = 1000

STAGES = ("straight", "metrics", "write", "load", "build")


def compare(comparison: Comparison, output: Path) -> None:
    """Run a study of hits and show what it found."""
    from iriftrace.studies.comparison import run_comparison

    _run(run_comparison, comparison, output, print_comparison)


def measure(timing: Timing, output: Path) -> None:
    """Run a study of times and show what it found."""
    from iriftrace.studies.timing import run_timing

    _run(run_timing, timing, output, print_timing)


def _run(
    run: Callable[..., Any],
    what: Any,
    output: Path,
    show: Callable[[Any, Any], None],
) -> None:
    from iriftrace.figure_file import write_png
    from iriftrace.studies.figure import study_figure

    with pose_progress(output, "Cases") as report:
        dataset = run(what, output, report)
    show(out, dataset)
    picture = output.with_suffix(".png")
    with working("Drawing"):
        write_png(study_figure(dataset), picture)
    out.print(f"Study in {output}, figure in {picture}", markup=False, soft_wrap=True)


def print_comparison(console: Console, dataset: xr.Dataset) -> None:
    """A table for each reference: differences of the hits in micrometres."""
    from iriftrace.studies.comparison import reference_words

    (axis,) = set(dataset["rmse"].dims) - {"mode", "reference"}
    for reference in dataset["reference"].values:
        table = _table(
            f"Difference from {reference_words(str(reference))} / um",
            (str(axis), "mode"),
            ("median", "share", "p95", "trimmed", "rmse", "un-\nmatched", "lost"),
        )
        for place in dataset[axis].values:
            for mode in dataset["mode"].values:
                case = dataset.sel({"mode": mode, axis: place})
                some = case.sel(reference=reference)
                if int(some["matched"]) < 0:
                    table.add_row(str(place), str(mode), "no shell left")
                    continue
                table.add_row(
                    str(place),
                    str(mode),
                    f"{1e3 * float(some['median']):.3f}",
                    f"{float(some['median']) / float(case['displacement_median']):.1%}",
                    *(f"{1e3 * float(some[name]):.3f}" for name in ("p95", "rmse_trimmed", "rmse")),
                    str(int(some["only_here"]) + int(some["only_reference"])),
                    str(int(case["rays_lost"])),
                )
        _show(console, table)
    console.print(
        "share: median over the median displacement; trimmed: rmse without the 1 % of rays that "
        "differ most; unmatched: rays that are good in one of the two runs only; lost: rays of the "
        "case whose straight twin hits the part in focus, but which are not good."
    )


def print_timing(console: Console, dataset: xr.Dataset) -> None:
    """Times as ratios: of stages to the refracted trace, and of this to the first case's."""
    (axis,) = set(dataset["time_search"].dims) - {"mode"}
    across = "rays" if dataset.attrs["study"] == "rays" else "triangles_per_shell"
    for mode in dataset["mode"].values:
        some = dataset.sel(mode=mode)
        title = f"{mode}: times over that of the refracted trace"
        table = _table(title, (), (across.replace("_", " "), "growth", "search", *STAGES))
        first = some.isel({axis: 0})
        for place in range(some.sizes[axis]):
            case = some.isel({axis: place})
            refracted = float(case["time_refracted"])
            same_run = int(case["process"]) == int(first["process"])
            growth = refracted / float(first["time_refracted"])
            table.add_row(
                f"{int(case[across]):,}",
                f"{growth:.2f}" if same_run else "other run",
                f"{float(case['search_share']):.2f}",
                *(f"{float(case[f'time_{stage}']) / refracted:.2f}" for stage in STAGES),
            )
        _show(console, table)
    console.print(
        "growth: refracted trace over that of the first case, if one run measured both; search: "
        "the intersection search of the refracted trace, the rest of it is refraction."
    )
    if float(dataset["search_share"].max()) > 1.0:
        console.print(
            "A search above 1 is noise: the search is timed in a run of its own, so that other "
            "programs on the machine can make it the longer one."
        )


def _table(title: str, texts: Sequence[str], numbers: Sequence[str]) -> Table:
    """Columns of texts and of numbers, without rules between them, which cost width."""
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=0, show_edge=False)
    for heading in texts:
        table.add_column(heading, overflow="fold")
    for heading in numbers:
        table.add_column(heading, justify="right")
    return table


def _show(console: Console, table: Table) -> None:
    """Print a table in the terminal's width, or wider where words and numbers would be cut."""
    # A measurement ends at the console's width, unless the options know of more.
    least = console.measure(table, options=console.options.update(width=_WIDEST)).minimum
    if least > console.width:
        table.width = least
    console.print(table, crop=False, soft_wrap=True)
    console.print()
