"""Warnings about single poses of a sweep, as flags that its file stores."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import BoolArray, Variable
from iriftrace.image.aov_image import Status
from iriftrace.sweep.store import WARNED, WHOLE_PART
from iriftrace.tracing.engine import LIMIT, TOO_COARSE
from iriftrace.tracing.lost import LIMIT as LOST_LIMIT

if TYPE_CHECKING:
    import xarray as xr

FRACTION = 0.05
"""Fraction of rays from which on they can determine a 95th percentile by themselves."""


@frozen
class Flag:
    """One reason for a warning."""

    name: str
    """As in the file's ``flag_meanings`` (CF conventions 1.11, section 3.5)."""
    letter: str
    """For tables."""
    text: str


FLAGS = (
    Flag("air_too_coarse", "s", TOO_COARSE),
    Flag("open_boundary", "o", f"over {FRACTION:.0%} of the rays pass an open end of the data"),
    Flag("out_of_focus", "f", f"over {FRACTION:.0%} of the hits out of focus"),
    Flag("part_beyond_picture", "b", "part reaches beyond the picture"),
    Flag("rays_lost", "l", f"over {LOST_LIMIT:.1%} of the hits or points lost"),
)
"""In the order of their bits, the lowest first."""


def warned_variable(dataset: xr.Dataset) -> Variable:
    """Flags of each pose of a sweep, with the attributes that explain them in the file."""
    whole = dataset.sel(region=WHOLE_PART)
    counts = ("rays_good", "rays_hit", "hits_at_border", "rays_out_of_focus", "rays_open_boundary")
    good, hit, beyond, blurred, passed = (whole[name].values.astype(np.float64) for name in counts)
    lost = sum(whole[f"rays_{status.key}"].values for status in Status if status.lost)
    missing = np.zeros(len(good), dtype=np.bool_)
    if "points_lost" in whole:
        points, gone = (whole[f"points_{name}"].values for name in ("measured", "lost"))
        missing = gone > LOST_LIMIT * (points + gone)
    coarse = (whole["engine_test_p95"].values > LIMIT) & (whole["through_cells"].values != 1)
    found = (
        *(coarse, passed > FRACTION * good, blurred > FRACTION * hit, (beyond > 0) | (hit == 0)),
        (lost > LOST_LIMIT * hit) | missing,
    )
    flags = sum((one & (good >= 0)).astype(np.int8) << bit for bit, one in enumerate(found))
    attributes = {
        "long_name": "what the sweep warns of in this pose",
        "flag_masks": np.array([1 << bit for bit in range(len(FLAGS))], dtype=np.int8),
        "flag_meanings": " ".join(flag.name for flag in FLAGS),
    }
    return ("pose",), np.asarray(flags, dtype=np.int8), attributes


def warned_of(dataset: xr.Dataset) -> BoolArray:
    """Mask (n, number of `FLAGS`) of a sweep's poses."""
    found: BoolArray = (dataset[WARNED].values[:, None] >> np.arange(len(FLAGS))) & 1 == 1
    return found
