"""The answer of a measurement: value, U and verdict of each feature, and U by group."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from iriftrace.cli.console import print_table, say

if TYPE_CHECKING:
    from iriftrace.measuring.features.quantity import Quantity
    from iriftrace.measuring.uncertainty.budget import Uncertainty
    from iriftrace.measuring.uncertainty.decision import Decision

Stated = Annotated[
    str,
    Parameter(
        name="--uncertainty",
        help='Standard uncertainties of the inputs, "wall 10 K, ambient 2 K, pressure 2 hPa, '
        "sensor 8 um\"; further ones: air, mesh and numerics (fractions of the air's effect, "
        '"5 %"), '
        "humidity, expansion (a fraction), part (K), other (a length).",
    ),
]
Tolerances = Annotated[
    list[str] | None,
    Parameter(
        name="--tolerance",
        help='Tolerance of a diameter, "cylinder:bore=20.22 -0.02 +0.02 mm", by which it is '
        "accepted or rejected; repeatable.",
    ),
]


def digits_of(expanded: float) -> int:
    """Decimal places with which a value is stated whose U has two digits."""
    if not 0.0 < expanded < math.inf:
        return 4
    return max(0, 1 - math.floor(math.log10(expanded)))


def answer(name: str, value: Quantity) -> list[str]:
    """Lines that state a corrected value, its U and the verdict on it."""
    u, unit = value.uncertainty, value.unit
    if u is None:
        return []
    places = digits_of(u.expanded)
    low, high = u.interval
    least = "at least " if u.missing else ""
    where = ", on the drawing" if "drawing" in value.by_cloud else ", corrected"
    text = (
        f"{name}{where}: {u.value:.{places}f} {unit}, U = {least}{u.expanded:.{places}f} {unit} "
        f"(k = {u.coverage_factor:.2g}, 95 %: {low:.{places}f} .. {high:.{places}f})"
    )
    measured = value.by_cloud.get("measured")
    if measured is not None and value.decision is None:
        text += f"; measured {measured:.{places}f} {unit}"
    lines = [f"{text}."]
    if value.decision is not None:
        lines.append(f"  {_verdict(value.decision, measured, places, unit)}")
    if u.missing:
        lines.append(f"  U is a lower bound; not covered: {', '.join(u.missing)}.")
    return lines


def _verdict(decision: Decision, measured: float | None, places: int, unit: str) -> str:
    low, high = decision.tolerance.limits
    text = f"Tolerance {low:.{places}f} .. {high:.{places}f} {unit}: {decision.verdict}"
    if decision.risk is not None:
        text += f", risk of a wrong verdict {100 * decision.risk:.2g} %"
    elif not decision.reason:
        text += f", the probability of a value outside is {100 * decision.outside:.2g} %"
    if measured is not None:
        within = "within" if decision.measured else "outside"
        text += f" (as measured: {measured:.{places}f} {unit}, {within})"
    return f"{text}."


def print_groups(title: str, stated: Uncertainty, unit: str) -> None:
    """Table of U by group."""
    scale, shown = (1e3, "um") if unit == "mm" else (1.0, unit)
    print_table(
        title,
        ("quantity", f"u ({shown})", "share", "type", "from"),
        [
            (
                one.group,
                f"{scale * one.u:.3g}",
                f"{stated.share(one):.0%}",
                one.kind,
                one.source,
            )
            for one in stated.contributions
        ],
        texts=["quantity", "from"],
    )


INFLUENCES: Mapping[str, str] = {
    "air": "air around the part",
    "wall": "wall",
    "ambient": "ambient",
    "pressure": "pressure",
    "mesh": "mesh and model of the flow",
    "numerics": "numerics",
    "humidity": "humidity",
    "sensor": "sensor",
    "expansion, part": "growth of the part",
    "other": "other",
}
"""Groups of a budget by the names of the inputs with which they are stated (ISO/TS 15530-4)."""


def say_influences(stated: Uncertainty) -> None:
    """State what the budget does not contain: the list of ISO/TS 15530-4."""
    present = set(stated.parts) | set(stated.missing)
    absent = [name for name, group in INFLUENCES.items() if group not in present]
    if absent:
        say(
            f"Taken as exactly known, as nothing is stated of them: {', '.join(absent)}. Not in U: "
            "turbulence within an exposure, diffraction."
        )


def say_answers(named: Iterable[tuple[str, Quantity]], most: int) -> None:
    """Print the answers of the first values, and how many more there are."""
    rows: Sequence[tuple[str, Quantity]] = [
        (name, value) for name, value in named if value.uncertainty is not None
    ]
    for name, value in rows[:most]:
        for line in answer(name, value):
            say(line)
    if len(rows) > most:
        say(f"{len(rows) - most} more in the JSON file.")
