"""Outcomes of the correction of each point."""

from __future__ import annotations

import numpy as np

from iriftrace.core.arrays import AnyIntArray, BoolArray
from iriftrace.measuring.two_devices.statistics import PointStatus


class CorrectionStatus(PointStatus):
    """Outcome of a measured point.

    Outside the field, neither line of sight meets hot air of which anything is known. A point is
    lost if the refracted ray from a device is not known (`iriftrace.image.aov_image.Status.lost`).
    It is outside the view if it lies behind a device, or so far outside its picture that its lens
    has no ray there. Rows of the cloud's file that are not a point are not measured. An uncertain
    point is corrected like others, by the mean, but its correction scatters over an ensemble's
    members by more than itself.
    """

    CORRECTED = 0
    FAR_FROM_PART = 1
    HIDDEN = 2
    SEVERAL_IMAGES = 3
    OUTSIDE_FIELD = 4
    UNCERTAIN = 5
    LOST = 6
    OUTSIDE_VIEW = 7
    NOT_MEASURED = 8


def is_corrected(status: AnyIntArray) -> BoolArray:
    """Mask (n,) of the points whose outcome (n,) is a correction."""
    return np.isin(status, (CorrectionStatus.CORRECTED, CorrectionStatus.UNCERTAIN))
