"""A corrected size, distance or angle with its uncertainty by groups of inputs, and the verdict."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from attrs import evolve

from iriftrace.measuring.features.drawing import u_of_growth
from iriftrace.measuring.features.quantity import DRAWING, Quantity
from iriftrace.measuring.two_devices.changes import Changes
from iriftrace.measuring.two_devices.statistics import worst_member
from iriftrace.measuring.uncertainty.air_groups import AirGroups
from iriftrace.measuring.uncertainty.budget import Contribution, uncertainty_of
from iriftrace.measuring.uncertainty.decision import Tolerance, decide
from iriftrace.measuring.uncertainty.inputs import Inputs
from iriftrace.part.growth import Growth

SENSOR = "sensor"
"""The group of the noise of the measured points."""


def with_uncertainty(
    value: Quantity,
    groups: AirGroups,
    inputs: Inputs,
    changes: Sequence[Changes],
    growth: Growth | None,
    tolerance: Tolerance | None = None,
    *,
    doubts: Sequence[str] = (),
) -> Quantity:
    """A value with its uncertainty by groups, and with the verdict on a tolerance.

    `doubts` are groups that are not known of this value, without which U is a lower bound; with
    `SENSOR` among them the points have no noise, and their scatter is not in U.
    """
    measured, corrected = value.by_cloud["measured"], value.by_cloud["corrected"]
    if measured is None or corrected is None:
        return value
    members, worst = None, None
    if groups.weights is not None:
        members = np.array(value.by_member, dtype=np.float64)
        if groups.weights.several:
            numbers = range(1, len(members) + 1)
            worst = worst_member(members, corrected, groups.weights, numbers)
    effect = None if members is None else members - measured
    parts = groups.parts(corrected - measured, effect)
    sources = groups.sources()
    found = [Contribution(name, float(u), "B", sources[name]) for name, u in parts.items()]
    drawn = value.by_cloud.get(DRAWING)
    by_points = value.u["corrected" if drawn is None else DRAWING]
    if by_points is not None and SENSOR not in doubts:
        stated = inputs.sensor_mm is not None
        how = "stated" if stated else "scatter of the points"
        found.append(Contribution(SENSOR, by_points, "B" if stated else "A", how))
    missing = [*groups.missing, *doubts]
    for change in changes:
        by_change = value.u_of_group(change.group)
        if by_change is None:
            missing.append(change.group)
        else:
            found.append(Contribution(change.group, by_change, "B", change.source))
    angle = value.unit == "deg"
    if drawn is not None and growth is not None:
        by_growth = u_of_growth(inputs, growth, corrected, drawn, angle)
        if by_growth is None:
            missing.append("growth of the part")
        else:
            found.append(Contribution("growth of the part", by_growth, "B", "stated"))
    if inputs.other_mm and not angle:
        found.append(Contribution("other", inputs.other_mm, "B", "stated"))
    mixture = groups.mixture(effect)
    u = uncertainty_of(corrected if drawn is None else drawn, found, mixture, missing)
    decision = None if tolerance is None else decide(tolerance, u, value.uncorrected)
    return evolve(value, uncertainty=u, decision=decision, worst=worst)
