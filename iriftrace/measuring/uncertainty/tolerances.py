"""Tolerances of features as users write them."""

from __future__ import annotations

import re
from collections.abc import Iterable

from iriftrace.core.errors import InputError
from iriftrace.core.units import parse_quantity
from iriftrace.measuring.uncertainty.decision import Tolerance

WITH_DIAMETER = ("cylinder", "sphere", "circle")
"""Kinds of surfaces with one diameter: a cone has another at each height."""

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)"
_TEXT = re.compile(
    rf"(?P<name>.+?)=\s*(?P<nominal>{_NUMBER})\s+(?P<lower>{_NUMBER})\s+(?P<upper>{_NUMBER})"
    r"\s*(?P<unit>\S+)?"
)


def check_diameter(name: str) -> None:
    """Raise InputError for a feature without one diameter, by its name, such as "cone:tip"."""
    kind = name.partition(":")[0]
    if kind == "cone":
        raise InputError(
            f"{name!r} has no one diameter that a tolerance could be of: a cone has another at "
            "each height, and that of the measured points depends on the view; leave it out.",
            code="tolerance.of_cone",
            argument="tolerance",
        )
    if kind not in WITH_DIAMETER:
        raise InputError(
            f"A tolerance is of a diameter, and {name!r} has none; name a feature by kind and "
            "region, such as cylinder:bore.",
            code="tolerance.of_no_diameter",
            argument="tolerance",
        )


def tolerances_of(texts: Iterable[str]) -> dict[str, Tolerance]:
    """Tolerances, mm, of diameters: ``"cylinder:bore=20.22 -0.02 +0.02 mm"`` by the feature's name.

    Raises InputError for another text, a tolerance without unit or width, of a feature without one
    diameter, or one given twice.
    """
    found: dict[str, Tolerance] = {}
    for text in texts:
        match = _TEXT.fullmatch(text.strip())
        if match is None or match["unit"] is None:
            raise InputError(
                f"The tolerance {text!r} is not FEATURE=NOMINAL LOWER UPPER UNIT; write it like "
                '"cylinder:bore=20.22 -0.02 +0.02 mm".',
                code="tolerance.not_read",
                argument="tolerance",
            )
        name = match["name"].strip()
        check_diameter(name)
        if name in found:
            raise InputError(
                f"{name!r} has two tolerances; give one.",
                code="tolerance.twice",
                argument="tolerance",
            )
        values = [
            parse_quantity(f"{match[key]} {match['unit']}", "mm")
            for key in ("nominal", "lower", "upper")
        ]
        found[name] = Tolerance(*values)
    return found
