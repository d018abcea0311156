"""Synthetic and unsteady air, by what a field's origin states: whether a correction has a U."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from attrs import frozen

from iriftrace.field.origin import synthetic_mark
from iriftrace.scene.load import LoadedScene

_NOT_STEADY = re.compile(
    r"NOT STEADY(?: \(heat flow varies by ([\d.]+) ?%, plume by ([\d.]+) K\))?"
)

_RANGE = 2.0 * math.sqrt(3.0)
"""Range over standard deviation of a value that may lie anywhere in between (GUM, 4.3.7)."""


@frozen
class FieldState:
    """What the origin of a scene's field says of the uncertainty of a correction.

    Attributes
    ----------
    synthetic : bool
        Air from formulas, of which no uncertainty is known.
    unsteadiness : float or None
        Relative standard uncertainty of the air's contrast because it changes in time while a scan
        sees one state; 0 of steady air and where nothing is stated, None of unsteady air whose
        changes are not stated.
    """

    synthetic: bool = False
    unsteadiness: float | None = 0.0


def field_state(scene: LoadedScene) -> FieldState:
    """State of a scene's field; the scatter of an ensemble's fields has their unsteadiness."""
    if scene.ensemble is None:
        origin = _origin(scene.source)
        return FieldState(
            synthetic_mark(origin) is not None, _unsteadiness(origin, scene.heating_k)
        )
    members = scene.ensemble.members
    return FieldState(any(synthetic_mark(_origin(one.source)) for one in members))


def _origin(source: Mapping[str, Any] | None) -> str:
    return str((source or {}).get("origin") or "")


def _unsteadiness(origin: str, heating_k: float | None) -> float | None:
    """The larger of heat flow's and plume's relative range, as a rectangular distribution."""
    said = _NOT_STEADY.search(origin)
    if said is None:
        return 0.0
    if said[1] is None or heating_k is None:
        return None
    return max(float(said[1]) / 100.0, float(said[2]) / heating_k) / _RANGE
