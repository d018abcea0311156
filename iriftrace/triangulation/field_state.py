"""Synthetic and unsteady air, as a field's file states it: whether a correction has a U."""

from __future__ import annotations

import math

from attrs import frozen

from iriftrace.field.source import FieldFacts, FieldKind, FieldSource
from iriftrace.scene.loaded import LoadedScene

_RANGE = 2.0 * math.sqrt(3.0)
"""Range over standard deviation of a value that may lie anywhere in between (GUM, 4.3.7)."""


@frozen
class FieldState:
    """What the file of a scene's field states about the uncertainty of a correction."""

    synthetic: bool = False  # air from formulas, whose uncertainty is not known
    # Relative standard uncertainty of the air's contrast because it changes in time while a scan
    # sees one state; 0 for steady air and where nothing is stated, None for unsteady air whose
    # changes are not stated.
    unsteadiness: float | None = 0.0


def field_state(scene: LoadedScene) -> FieldState:
    """State of a scene's field; the scatter of an ensemble's fields has their unsteadiness."""
    if scene.ensemble is not None:
        return FieldState(any(_synthetic(one.source) for one in scene.ensemble.members))
    source = scene.source
    unsteady = source is not None and source.facts.kind is FieldKind.UNSTEADY
    return FieldState(
        _synthetic(source),
        _unsteadiness(source.facts, scene.stated.heating_k) if source and unsteady else 0.0,
    )


def _synthetic(source: FieldSource | None) -> bool:
    return source is not None and source.facts.kind is FieldKind.SYNTHETIC


def _unsteadiness(facts: FieldFacts, heating_k: float | None) -> float | None:
    """The larger of heat flow's and plume's relative range, as a rectangular distribution."""
    if facts.heat_variation is None or facts.plume_swing_k is None or heating_k is None:
        return None
    return max(facts.heat_variation, facts.plume_swing_k / heating_k) / _RANGE
