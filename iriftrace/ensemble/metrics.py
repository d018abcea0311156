"""Numbers of one pose that only an ensemble has: bias, scatter, and how many rays they rest on."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from iriftrace.channels import MEMBERS_CHANNEL
from iriftrace.exr import AovImage
from iriftrace.ray_statistics import FEWEST_RAYS, STATISTICS, root_mean_square, statistics

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def has_ensemble(image: AovImage) -> bool:
    """Whether an image holds the mean and the scatter of several fields."""
    return MEMBERS_CHANNEL in image.channels


def ensemble_metrics(
    image: AovImage, pixels: IntArray, hits: IntArray, bias: dict[str, Any]
) -> dict[str, Any]:
    """Bias and scatter of some pixels.

    Parameters
    ----------
    image : AovImage
        With the channels of an ensemble.
    pixels : (n,) array
        Row-major numbers of the pixels whose rays count.
    hits : (m,) array
        Those of all pixels on the part.
    bias : dict
        ``displacement_mm`` and ``shift_px`` of the same pixels; of an ensemble's image they are
        those of the mean.

    Returns
    -------
    dict
        ``members``; ``bias_mm`` and ``bias_px``, statistics over the pixels of the mean, which can
        be corrected; ``scatter_mm`` and ``scatter_px``, statistics over the pixels of the standard
        deviation, which cannot; ``rays_in_all`` and ``rays_in_some``, pixels that count in all and
        only in some of the members. Statistics of fewer than 100 pixels are None.
    """
    members = int((image.header.get("ensemble") or {}).get("count") or 0)
    counted = np.rint(image.channels[MEMBERS_CHANNEL].ravel()[hits]).astype(np.int64)
    members = members or int(counted.max(initial=0))
    shift = [image.channels[f"shift.px.std.{a}"].ravel()[pixels].astype(np.float64) for a in "XY"]
    return {
        "members": members,
        "bias_mm": bias["displacement_mm"],
        "scatter_mm": _statistics(image.channels["displacement.std.norm"].ravel()[pixels]),
        "bias_px": bias["shift_px"],
        "scatter_px": _statistics(np.hypot(*shift)),
        "rays_in_all": int(np.count_nonzero(counted == members)),
        "rays_in_some": int(np.count_nonzero((counted > 0) & (counted < members))),
    }


def _statistics(values: NDArray[Any]) -> dict[str, float | None]:
    if len(values) < FEWEST_RAYS:
        return dict.fromkeys((*STATISTICS, "rms"))
    exact = values.astype(np.float64)
    return {**statistics(exact), "rms": root_mean_square(exact)}
