"""Uncertainty of the features that two devices will measure, before anything is measured.

A measurement is simulated in the mean air, and corrected by it; what is left is the uncertainty.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from attrs import frozen

from iriftrace.core.errors import InputError
from iriftrace.measuring.features.choice import FeatureChoice
from iriftrace.measuring.features.drawing import check_growth
from iriftrace.measuring.features.fitted import FittedFeature
from iriftrace.measuring.features.relations import Relation
from iriftrace.measuring.options import GATE, Phase
from iriftrace.measuring.two_devices.changes import mixture_changes, pose_changes
from iriftrace.measuring.two_devices.correction import Correction
from iriftrace.measuring.two_devices.correction_status import CorrectionStatus
from iriftrace.measuring.two_devices.devices import sensor_of
from iriftrace.measuring.two_devices.measure import measured
from iriftrace.measuring.uncertainty.air_groups import AirGroups
from iriftrace.measuring.uncertainty.decision import Tolerance
from iriftrace.measuring.uncertainty.inputs import NOTHING_STATED, Inputs
from iriftrace.tracing.engine import choose
from iriftrace.tracing.scene import Scene
from iriftrace.tracing.second_options import System


@frozen(eq=False)
class FeatureBudget:
    """Features of a simulated measurement after its correction, with their uncertainties."""

    correction: Correction
    features: tuple[FittedFeature, ...]
    relations: tuple[Relation, ...]
    mixture_unchecked: str  # why mixed air was not traced; "" if it was or nothing is mixed


def feature_budget(
    scene: Scene,
    inputs: Inputs = NOTHING_STATED,
    *,
    choices: Sequence[str | FeatureChoice] = (),
    tolerances: Mapping[str, Tolerance] = {},
    gate: float | None = GATE,
    system: System | None = None,
    phase: Phase | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> FeatureBudget:
    """Simulate what two devices measure, and state the uncertainty of its corrected features.

    The points are simulated without noise: if `inputs` state no sensor, U is a lower bound.
    Costs as much as :func:`iriftrace.measure`, whose errors and warnings it has, and traces a
    sample of the points in mixed air and with moved devices. Points that are seen through no hot
    air are not corrected, as by `correct`. `choices`, `tolerances` and `gate` are those of
    `Correction.features`, and `progress` that of `measure`. Raises InputError also if no point is
    seen through hot air, or `inputs` state the uncertainty of a growth that the part does not have.
    """
    ready, sensor = sensor_of(scene, None, None, system, phase)
    check_growth(inputs, ready.part.growth)
    traced = choose(ready, *sensor.devices).scene
    scan = measured(traced, sensor, varied=True, progress=progress)
    if not scan.in_air.any():
        raise InputError(
            f"None of the {len(scan.points):,} points is seen through hot air that is known, so "
            "there is no correction whose uncertainty could be stated; check the frame and the "
            "length unit of the field.",
            code="devices.no_hot_air",
        )
    in_air = scan.in_air[:, None]
    groups, unchecked = AirGroups.of(ready, inputs), ""
    sampled = np.where(scan.in_air, scan.face, -1)
    changes = pose_changes(traced, sensor, inputs, scan.true, sampled)
    try:
        mixed = mixture_changes(ready, sensor, groups, scan.true, sampled)
        changes += () if mixed is None else (mixed,)
    except InputError as error:
        unchecked = str(error)
    correction = Correction(
        measured=scan.points,
        error=scan.error * in_air,
        status=np.where(
            scan.in_air, CorrectionStatus.CORRECTED, CorrectionStatus.OUTSIDE_FIELD
        ).astype(np.int64),
        face=scan.face,
        face_normals=ready.part.surface.normals,
        system=scan.system,
        provenance=scan.provenance,
        inputs=inputs,
        groups=groups,
        errors=None if scan.errors is None else scan.errors * in_air,
        growth=scan.growth,
        one_line=scan.one_line,
        changes=changes,
        without_noise=True,
    )
    features = correction.features(ready.part, choices, gate, tolerances=tolerances)
    return FeatureBudget(correction, features, correction.relations(features), unchecked)
