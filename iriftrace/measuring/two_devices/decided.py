"""Verdicts on the tolerances of a correction that has been saved."""

from __future__ import annotations

from collections.abc import Mapping

from attrs import evolve

from iriftrace.core.plain import JsonObject
from iriftrace.measuring.features.choice import FeatureChoice
from iriftrace.measuring.features.fitted import check_names
from iriftrace.measuring.features.quantity import Quantity
from iriftrace.measuring.uncertainty.decision import Tolerance, decide


def decided(values: JsonObject, tolerances: Mapping[str, Tolerance]) -> JsonObject:
    """The JSON values of a correction with the verdicts on these tolerances alone.

    They are those of `Correction.features`, without computing the correction again. Raises
    InputError for a tolerance that `Correction.features` refuses, and LookupError, TypeError or
    ValueError for other values.
    """
    rows = {str(FeatureChoice(one["kind"], one["region"])): one for one in values["features"]}
    found = {name: evolve(Quantity.of(row), decision=None) for name, row in rows.items()}
    check_names(tolerances, list(rows))
    features = []
    for name, row in rows.items():
        value = found[name]
        kept = {key: one for key, one in row.items() if key != "decision"}
        if name in tolerances and value.uncertainty is not None:
            decision = decide(tolerances[name], value.uncertainty, value.uncorrected)
            kept["decision"] = decision.as_dict()
        features.append(kept)
    return {**values, "features": features}
