"""The command ``iriftrace report``: what a sweep found out, as one HTML page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from iriftrace.cli.checks import check_input, check_output
from iriftrace.cli.console import notes, out, working
from iriftrace.cli.options import Whole
from iriftrace.cli.plan_options import THE_PAPERS, RankingOptions
from iriftrace.cli.traced_light import check_light


def report(
    sweep: Path,
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"])] = Path("report.html"),
    ranking: RankingOptions = THE_PAPERS,
    top: Whole = 10,
    wavelength: str | None = None,
) -> None:
    """Write what a sweep found out as one HTML page that needs neither Python nor a network.

    Example: ``iriftrace report sweep.nc -o report.html``

    Parameters
    ----------
    sweep
        A file that ``iriftrace sweep`` wrote.
    output
        The HTML file.
    top
        Rows of the ranking.
    wavelength
        Wavelength that the sweep must be of, "450 nm"; one of other light is refused.
    """
    from iriftrace.report import write_report
    from iriftrace.sweep_store import read_sweep

    check_output(output, ".html", "report.html", make=False)
    check_input(sweep)
    dataset = read_sweep(sweep)
    check_light(wavelength, dataset.attrs, sweep)
    summary = ranking.summary_of(dataset)
    with working("Writing the report"):
        missing = write_report(output, sweep, dataset, summary, top=top)
    for text in missing:
        notes.print(f"note: {text}", markup=False, soft_wrap=True)
    out.print(f"Report in {output}", markup=False, soft_wrap=True)
