"""One statement and what is found of it."""

from __future__ import annotations

from attrs import frozen


@frozen
class Finding:
    """A statement of the paper about a component.

    Attributes
    ----------
    statement : str
    holds : str
        "yes", "no", or what it depends on; computed from the figures.
    figures : str
        The numbers behind it.
    """

    statement: str
    holds: str
    figures: str


def verdict(everywhere: bool, beside_plume: bool) -> str:
    """Verdict on a statement for all poses, or only for those not above the plume."""
    if everywhere and beside_plume:
        return "yes"
    if beside_plume:
        return "yes, but not looking down through the plume"
    return "only with the poses that look down through the plume" if everywhere else "no"
