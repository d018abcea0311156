"""Origin of a field, and what its file states about it."""

from __future__ import annotations

from enum import Enum
from typing import Literal

from attrs import frozen

from iriftrace.core.plain import structured


class FieldKind(Enum):
    """Kind of air that a field's file states."""

    SYNTHETIC = "synthetic"
    """Air of an analytical model."""
    STEADY = "steady"
    UNSTEADY = "unsteady"
    """Unsteady air: a snapshot or a mean."""
    NOT_STATED = "not stated"


VariedInput = Literal["wall", "ambient", "pressure"]
"""Input of a flow solution that may be changed in it."""


@frozen
class Variation:
    """What was changed in a flow solution that only says what this input changes.

    Attributes
    ----------
    quantity : str
        ``"wall"``, ``"ambient"`` or ``"pressure"``.
    step : float
        By how much, K or Pa.
    of : str
        SHA-256 of the file of the field that was solved with the input as it is.
    """

    quantity: VariedInput
    step: float
    of: str

    @property
    def text(self) -> str:
        """Description for tables and for the field's origin."""
        step = f"{self.step / 100.0:g} hPa" if self.quantity == "pressure" else f"{self.step:g} K"
        return f"varies {self.quantity} by {step}"


@frozen
class FieldFacts:
    """What a field's file states in numbers and names besides the text of its origin.

    Written by iriftrace; of a file of another program nothing is stated, whatever its texts say.

    Attributes
    ----------
    kind : FieldKind
    heat_variation : float or None
        Range of the heat flow from the part over some time, as a fraction of its mean.
    plume_swing_k : float or None, K
        Range of the temperature over time, at the point in the plume where it is largest.
    bodies : tuple of str
        Names of the bodies around which the field was solved besides the part.
    time : str
        ``"mean"`` or ``"snapshot"``; "" if not stated.
    symmetry : str
        Such as "mirrored at y = 0 mm", or "none, all sides were solved"; "" if not stated.
    draught_m_s : (3,) tuple of float or None, m/s, the file's coordinates
        Velocity of the draught in which the field was solved; None in still air or if not stated.
    variation : Variation or None
        Of a field that varies another one.
    """

    kind: FieldKind = FieldKind.NOT_STATED
    heat_variation: float | None = None
    plume_swing_k: float | None = None
    bodies: tuple[str, ...] = ()
    time: str = ""
    symmetry: str = ""
    draught_m_s: tuple[float, float, float] | None = None
    variation: Variation | None = None


@frozen
class FieldSource:
    """Origin of a field.

    Attributes
    ----------
    path : str
        The file as given by the user.
    sha256 : str
        Of that file alone, even if it names others (`.pvd`, `.vtm`, `.pvtu`); for an OpenFOAM
        case, of the list of its files' checksums.
    array : str
        The array that was used.
    quantity : str
        What the array holds: ``"temperature"``, ``"density"`` or ``"index"``.
    length_unit : str
        Unit of the file's coordinates.
    origin : str
        What the file states about its origin (field data ``field_origin``), such as "OpenFOAM,
        snapshot at 2 s"; "" if nothing.
    wall_heat_w : float, optional
        Heat from the whole part, W, as computed by the solver, if the file states it.
    unit_stated : bool
        Whether the file states its length unit, or its format has one (OpenFOAM: m).
    facts : FieldFacts
        What the file states in numbers and names (field data ``field_facts``).
    """

    path: str
    sha256: str
    array: str
    quantity: str
    length_unit: str
    origin: str = ""
    wall_heat_w: float | None = None
    unit_stated: bool = False
    facts: FieldFacts = FieldFacts()

    @property
    def state(self) -> tuple[str, str]:
        """Key of the air: its file, and the origin, which names one of several states in it."""
        return self.sha256, self.origin

    @property
    def steady(self) -> bool:
        """True for steady air, such as that of the synthetic model."""
        return self.facts.kind in (FieldKind.STEADY, FieldKind.SYNTHETIC)

    @property
    def time(self) -> str:
        """Time dependence of the field: ``"steady"``, ``"mean"``, ``"snapshot"`` or ""."""
        return "steady" if self.steady else self.facts.time


def stated_source(values: object) -> FieldSource | None:
    """The source that a header or a table states in plain values; None if it states none."""
    try:
        return structured(values, FieldSource)
    except ValueError:
        return None


def synthetic_mark(source: FieldSource | None) -> str | None:
    """Note for a figure of a result without a simulation; None for other sources."""
    synthetic = source is not None and source.facts.kind is FieldKind.SYNTHETIC
    return "SYNTHETIC FIELD" if synthetic else None
