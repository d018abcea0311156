"""The answer of a measurement in words: value, U and verdict of a feature, and U by group."""

from __future__ import annotations

import math
from collections.abc import Mapping

from iriftrace.measuring.features.quantity import DRAWING, Quantity, Unit
from iriftrace.measuring.uncertainty.budget import Uncertainty
from iriftrace.measuring.uncertainty.decision import Decision

INFLUENCES = {
    "wall": "wall",
    "ambient": "ambient",
    "pressure": "pressure",
    "mesh": "mesh and model of the flow",
    "numerics": "numerics",
    "humidity": "humidity",
    "position and rotation": "position and rotation of the devices",
    "sensor": "sensor",
    "expansion and part": "growth of the part",
    "other": "other",
}
"""Groups of a budget by the names of the inputs with which they are stated (ISO/TS 15530-4)."""


def digits_of(expanded: float) -> int:
    """Decimal places with which a value is stated whose U has two digits."""
    if not 0.0 < expanded < math.inf:
        return 4
    return max(0, 1 - math.floor(math.log10(expanded)))


def answer(name: str, value: Quantity, at: str = "") -> list[str]:
    """Sentences, without full stop, that state a corrected value, its U and the verdict on it.

    `at` says at which temperature the drawing holds.
    """
    u, unit = value.uncertainty, value.unit
    if u is None:
        return []
    places = digits_of(u.expanded)
    low, high = u.interval
    least = "at least " if u.missing else ""
    where = at or "on the drawing" if DRAWING in value.by_cloud else "corrected"
    text = (
        f"{name}, {where}: {u.value:.{places}f} {unit}, U = {least}{u.expanded:.{places}f} {unit} "
        f"(k = {u.coverage_factor:.2g}, 95 %: {low:.{places}f} .. {high:.{places}f}"
    )
    text += f"; not covered: {', '.join(u.missing)})" if u.missing else ")"
    if value.decision is not None:
        return [text, _verdict(value, value.decision, places)]
    if (measured := value.by_cloud.get("measured")) is not None:
        text += f"; as measured {measured:.{places}f} {unit}"
    return [text]


def cells(value: Quantity, at: str = "", by_air: str = "") -> dict[str, str]:
    """Cells of a row of a table by heading: what `answer` says, and "" for what is not known.

    `by_air` says what hot air does to the value.
    """
    u, decision = value.uncertainty, value.decision
    places = 4 if u is None else digits_of(u.expanded)
    found = {"tolerance": "", "as measured": "", "without hot air": "", "corrected": ""}
    if decision is not None:
        low, high = decision.tolerance.limits
        found["tolerance"] = f"{low:.{places}f} .. {high:.{places}f} {value.unit}"
    drawn = at or "on the drawing"
    clouds = dict(zip(("measured", "cold", "corrected"), list(found)[1:], strict=True))
    for cloud, heading in {**clouds, DRAWING: drawn}.items():
        size = value.by_cloud.get(cloud)
        found[heading] = "" if size is None else f"{size:.{places}f} {value.unit}"
    found["hot air makes it"] = by_air
    least = "at least " if u is not None and u.missing else ""
    found["U (95 %)"] = "" if u is None else f"{least}{u.expanded:.{places}f} {value.unit}"
    found["verdict"] = "" if decision is None else decision.verdict
    return found


def _verdict(value: Quantity, decision: Decision, places: int) -> str:
    (low, high), unit = decision.tolerance.limits, value.unit
    text = f"Tolerance {low:.{places}f} .. {high:.{places}f} {unit}: {decision.verdict}"
    if decision.risk is not None:
        text += f", risk of a wrong verdict {_percent(decision.risk)}"
    elif not decision.reason:
        text += f", the probability of a value outside is {_percent(decision.outside)}"
    if (measured := value.uncorrected) is not None:
        at = ", on the drawing" if DRAWING in value.by_cloud else ""
        within = "within" if decision.measured else "outside"
        text += f" (as measured{at}: {measured:.{places}f} {unit}, {within})"
    return text


def _percent(fraction: float) -> str:
    """Two digits of it, without powers of ten."""
    if fraction < 1e-4:
        return "below 0.01 %"
    return f"{100 * fraction:.2g} %" if fraction < 0.995 else "100 %"


GROUP_HEADINGS = ("quantity", "u", "share", "type", "from")
"""Headings of `groups`."""


def groups(stated: Uncertainty, unit: str) -> list[tuple[str, ...]]:
    """Rows of U by group, the largest first."""
    scale, shown = (1e3, "um") if unit == "mm" else (1.0, unit)
    return [
        (
            one.group,
            f"{scale * one.u:.3g} {shown}",
            _percent(stated.share(one)),
            one.kind,
            one.source,
        )
        for one in stated.contributions
    ]


def group_table(stated: Mapping[str, tuple[Uncertainty, Unit]]) -> tuple[tuple[str, ...], ...]:
    """Headings, then a row for each group: its u and share of each value, its type and source."""
    known: dict[str, dict[str, tuple[str, ...]]] = {}
    for name, one in stated.items():
        for group, *row in groups(*one):
            known.setdefault(group, {})[name] = tuple(row)
    rows = []
    for group, of in known.items():
        shares = (f"{of[name][0]} ({of[name][1]})" if name in of else "" for name in stated)
        kind, source = next(iter(of.values()))[2:]
        rows.append((group, *shares, kind, source))
    return (
        "group",
        *(f"u of {name[0].lower()}{name[1:]}" for name in stated),
        "type",
        "from",
    ), *rows


def influences(stated: Uncertainty) -> str:
    """What the budget does not contain: the list of ISO/TS 15530-4."""
    present = set(stated.parts) | set(stated.missing)  # the air is always one of them
    absent = [name for name, group in INFLUENCES.items() if group not in present]
    known = f"Taken as exactly known: {', '.join(absent)}. " if absent else ""
    return f"{known}Not in U: turbulence within an exposure, diffraction."
