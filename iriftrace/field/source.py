"""Where a field comes from and what its file states of its own making."""

from __future__ import annotations

import re
from enum import Enum

from attrs import Factory, field, frozen

from iriftrace.core.plain import structured

_STEADY = re.compile(r"(?<![\w-])steady\b", re.IGNORECASE)
_UNSTEADY = re.compile(r"\b(?:not steady|unsteady)\b", re.IGNORECASE)


class FieldKind(Enum):
    """What kind of air a field's file says that it holds."""

    SYNTHETIC = "synthetic"
    """Of a model that made it up."""
    STEADY = "steady"
    UNSTEADY = "unsteady"
    """A state of air, or a mean, that changes in time."""
    NOT_STATED = "not stated"


@frozen
class FieldFacts:
    """What a field's file states in numbers and names beside the text of its origin.

    Attributes
    ----------
    kind : FieldKind
    heat_variation : float or None
        Largest less smallest heat flow from the part over some time, as a share of its mean.
    plume_swing_k : float or None, K
        Largest less smallest temperature at the restless one of some points in the plume.
    bodies : tuple of str
        Names of the bodies beside the part around which the field was solved.
    time : str
        ``"mean"`` or ``"snapshot"``; "" where it does not say.
    symmetry : str
        Such as "mirrored at y = 0 mm"; "" where it does not say.
    """

    kind: FieldKind = FieldKind.NOT_STATED
    heat_variation: float | None = None
    plume_swing_k: float | None = None
    bodies: tuple[str, ...] = ()
    time: str = ""
    symmetry: str = ""

    @classmethod
    def in_words(cls, origin: str) -> FieldFacts:
        """What a text says of it, where nothing else does: files of other programs."""
        if origin.lower().startswith(FieldKind.SYNTHETIC.value):
            return cls(FieldKind.SYNTHETIC)
        if _UNSTEADY.search(origin):
            return cls(FieldKind.UNSTEADY)
        return cls(FieldKind.STEADY if _STEADY.search(origin) else FieldKind.NOT_STATED)


@frozen
class FieldSource:
    """Where a field comes from.

    Attributes
    ----------
    path : str
        The file as it was named.
    sha256 : str
        Of that file alone, also where it names others (`.pvd`, `.vtm`, `.pvtu`); of an OpenFOAM
        case that of the list of its files' checksums.
    array : str
        The array that was used.
    quantity : str
        What the array holds: ``"temperature"``, ``"density"`` or ``"index"``.
    length_unit : str
        Unit of the file's coordinates.
    origin : str
        What the file says of its own making (field data ``field_origin``), such as "OpenFOAM,
        snapshot at 2 s"; "" where it says nothing.
    wall_heat_w : float, optional
        Heat from the whole part, W, as the solver counted it, where the file states it.
    unit_stated : bool
        Whether the file states its length unit, or its format has one (OpenFOAM: m).
    facts : FieldFacts
        What it states in numbers and names (field data ``field_facts``).
    """

    path: str
    sha256: str
    array: str
    quantity: str
    length_unit: str
    origin: str = ""
    wall_heat_w: float | None = None
    unit_stated: bool = False
    facts: FieldFacts = field(
        default=Factory(lambda source: FieldFacts.in_words(source.origin), takes_self=True)
    )

    @property
    def steady(self) -> bool:
        """True for air that does not change in time, as that of the synthetic model."""
        return self.facts.kind in (FieldKind.STEADY, FieldKind.SYNTHETIC)

    @property
    def time(self) -> str:
        """What the field is in time: ``"steady"``, ``"mean"``, ``"snapshot"`` or ""."""
        return "steady" if self.steady else self.facts.time


def stated_source(values: object) -> FieldSource | None:
    """The source that a header or a table states in plain values; None where it states none."""
    try:
        return structured(values, FieldSource)
    except ValueError:
        return None


def synthetic_mark(source: FieldSource | None) -> str | None:
    """Words for a picture of a result that rests on no simulation; None for other sources."""
    synthetic = source is not None and source.facts.kind is FieldKind.SYNTHETIC
    return "SYNTHETIC FIELD" if synthetic else None
