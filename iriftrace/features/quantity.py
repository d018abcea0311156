"""Sizes, distances and angles in several clouds, and what is known of them besides."""

from __future__ import annotations

import math
from typing import Literal

from attrs import frozen

from iriftrace.core.plain import JsonObject, plain, structured

Unit = Literal["mm", "deg"]


@frozen
class WorstMember:
    """Number of the member of an ensemble whose value is farthest from the true one, and it."""

    number: int
    value: float


@frozen
class Uncertainty:
    """Expanded uncertainties of a corrected value, in its unit; None where one is not known."""

    air: float | None  # U = k u of the correction of the value
    # k of that, by Student's t for as many fields as it was estimated from (GUM, annex G), 2 for
    # many or one.
    coverage_factor: float | None
    fit: float | None  # of the fit to the corrected points, by their scatter (k = 2)

    @property
    def total(self) -> float | None:
        """Root of the sum of the squares of both."""
        return None if self.air is None or self.fit is None else math.hypot(self.air, self.fit)


@frozen
class SizeAtReference:
    """A size or distance of an expanded part at the temperature of its drawing."""

    temperature_k: float  # of the drawing
    holds_at_k: float  # of a part that is equally hot everywhere and grows as much
    size_mm: float  # at the temperature of the drawing
    expansion_uncertainty_mm: float | None  # U (k = 2) by expansion and temperature; None: unknown


@frozen
class AngleAtReference:
    """An angle of an expanded part at the temperature of its drawing."""

    temperature_k: float
    angle_deg: float


@frozen
class Quantity:
    """A diameter, distance or angle in several clouds.

    Attributes
    ----------
    unit : str
        ``"mm"`` or ``"deg"``.
    by_cloud : dict of float or None
        Values by the name of the cloud; None for features without a size.
    u : dict of float or None
        Their standard uncertainties by the scatter of the points, as in `iriftrace.Feature`.
    by_member : tuple of float or None
        Values by each member of an ensemble; empty for one field.
    scatter : float or None
        Standard deviation over the members, in a simulated measurement.
    worst : WorstMember or None
    uncertainty : Uncertainty or None
        Of a corrected value.
    at_reference : SizeAtReference, AngleAtReference or None
        Of a part that is expanded.
    """

    unit: Unit
    by_cloud: dict[str, float | None]
    u: dict[str, float | None]
    by_member: tuple[float | None, ...] = ()
    scatter: float | None = None
    worst: WorstMember | None = None
    uncertainty: Uncertainty | None = None
    at_reference: SizeAtReference | AngleAtReference | None = None

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
            "at_reference": row.get("at_reference"),
        }
        if "worst_member" in row:
            values["worst"] = {"number": row["worst_member"], "value": row[f"worst_{key}"]}
        if f"fit_uncertainty_{unit}" in row:
            values["uncertainty"] = {
                "air": row[f"size_uncertainty_{unit}"],
                "coverage_factor": row["coverage_factor"],
                "fit": row[f"fit_uncertainty_{unit}"],
            }
        return structured(values, cls)

    @property
    def key(self) -> str:
        """Key of the values in JSON."""
        return "angle_deg" if self.unit == "deg" else "size_mm"

    def difference(self, cloud: str, other: str) -> float | None:
        """Value in a cloud less that in another; None for features without a size."""
        value, true = self.by_cloud[cloud], self.by_cloud[other]
        return None if value is None or true is None else value - true

    def statements(self) -> JsonObject:
        """Plain JSON values of all but `by_cloud`, `u` and `by_member`."""
        unit, row = self.unit, {}
        if self.uncertainty is not None:
            row = {
                f"size_uncertainty_{unit}": self.uncertainty.air,
                "coverage_factor": self.uncertainty.coverage_factor,
                f"fit_uncertainty_{unit}": self.uncertainty.fit,
                f"total_uncertainty_{unit}": self.uncertainty.total,
            }
        elif self.by_member:
            row = {f"size_scatter_{unit}": self.scatter}
        if self.worst is not None:
            row |= {"worst_member": self.worst.number, f"worst_{self.key}": self.worst.value}
        if self.at_reference is not None:
            row["at_reference"] = plain(self.at_reference)
        return row
