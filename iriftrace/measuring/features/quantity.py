"""Sizes, distances and angles in several clouds, and what is known of them besides."""

from __future__ import annotations

import math
from typing import Literal

from attrs import Factory, evolve, frozen

from iriftrace.core.plain import JsonObject, structured
from iriftrace.measuring.uncertainty.budget import Uncertainty
from iriftrace.measuring.uncertainty.decision import Decision

Unit = Literal["mm", "deg"]

DRAWING = "drawing"
"""Name of the cloud of points carried back onto the drawing of an expanded part."""


@frozen
class WorstMember:
    """Number of the member of an ensemble whose value is farthest from the true one, and it."""

    number: int
    value: float


@frozen
class Quantity:
    """A diameter, distance or angle in several clouds.

    Attributes
    ----------
    unit : str
        ``"mm"`` or ``"deg"``.
    by_cloud : dict of float or None
        Values by the name of the cloud; None for features without a size. ``"drawing"`` is that on
        the drawing of an expanded part, at its temperature.
    u : dict of float or None
        Their standard uncertainties by the scatter of the points, as in `iriftrace.Feature`.
    by_member : tuple of float or None
        Values by each member of an ensemble; empty for one field.
    scatter : float or None
        Standard deviation over the members, in a simulated measurement.
    worst : WorstMember or None
    uncertainty : Uncertainty or None
        Of a corrected value.
    decision : Decision or None
        Whether it conforms to its tolerance.
    by_group : dict of tuple of float or None
        By the name of a group of inputs: the value of a sample of the corrected points as they are,
        and those with them moved by one standard uncertainty in each of its directions.
    """

    unit: Unit
    by_cloud: dict[str, float | None]
    u: dict[str, float | None]
    by_member: tuple[float | None, ...] = ()
    scatter: float | None = None
    worst: WorstMember | None = None
    uncertainty: Uncertainty | None = None
    decision: Decision | None = None
    by_group: dict[str, tuple[float | None, ...]] = Factory(dict)

    @classmethod
    def of(cls, row: JsonObject) -> Quantity:
        """The value that plain JSON values of a feature or relation state.

        Raises LookupError, TypeError or ValueError for others.
        """
        unit, key = ("deg", "angle_deg") if "angle_deg" in row else ("mm", "size_mm")
        values = {
            "unit": unit,
            "by_cloud": row[key],
            "u": row[f"u_{key}"],
            "by_member": row.get("by_member", {key: ()})[key],
            "scatter": row.get(f"size_scatter_{unit}"),
        }
        if "worst_member" in row:
            values["worst"] = {"number": row["worst_member"], "value": row[f"worst_{key}"]}
        found = structured(values, cls)
        if f"U_{unit}" in row:
            found = evolve(found, uncertainty=Uncertainty.of(row, unit))
        if "decision" in row:
            found = evolve(found, decision=Decision.of(row["decision"]))
        return found

    @property
    def key(self) -> str:
        """Key of the values in JSON."""
        return "angle_deg" if self.unit == "deg" else "size_mm"

    @property
    def answer(self) -> float | None:
        """Value on the drawing, or without hot air if the part has not grown."""
        names = (DRAWING, "corrected", "cold")
        return next((self.by_cloud[name] for name in names if name in self.by_cloud), None)

    @property
    def uncorrected(self) -> float | None:
        """Value as measured; of an expanded part scaled to its drawing as the corrected one is."""
        names = ("measured", "corrected", DRAWING)
        measured, corrected, drawn = (self.by_cloud.get(name) for name in names)
        if measured is None or corrected is None or drawn is None:
            return measured
        return measured * drawn / corrected

    def u_of_group(self, group: str) -> float | None:
        """Standard uncertainty by one of the groups of `by_group`; None if it is not known."""
        first, *moved = self.by_group.get(group, (None,))
        if first is None or None in moved:
            return None
        return math.hypot(*(value - first for value in moved if value is not None))

    def difference(self, cloud: str, other: str) -> float | None:
        """Value in a cloud less that in another; None for features without a size."""
        value, true = self.by_cloud[cloud], self.by_cloud[other]
        return None if value is None or true is None else value - true

    def statements(self) -> JsonObject:
        """Plain JSON values of all but values in clouds, by members and by groups."""
        unit, row = self.unit, {}
        if self.uncertainty is not None:
            row = self.uncertainty.as_dict(unit)
        elif self.by_member:
            row = {f"size_scatter_{unit}": self.scatter}
        if self.worst is not None:
            row |= {"worst_member": self.worst.number, f"worst_{self.key}": self.worst.value}
        if self.decision is not None:
            row["decision"] = self.decision.as_dict()
        return row
