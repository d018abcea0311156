"""Maps of the part's faces from a sweep, in readable units."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.image.sightings import COUNTS

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.sweep.measures import Limits


# Outliers of several mm at silhouettes; these percentiles keep them out of the colours.
_PERCENTILES = (1.0, 99.0)


@frozen(eq=False)
class FaceMap:
    """One number for each of the m faces of the part: an (m,) array, NaN if no pose sees it.

    The key is for files, the label states the unit. The limits are the ends of the colours, which
    are logarithmic if the first is positive.
    """

    key: str
    title: str
    label: str
    values: FloatArray
    limits: Limits


def face_maps_of(dataset: xr.Dataset) -> tuple[FaceMap, ...]:
    """Mean displacement, times seen and best incidence of each face; none if none is seen."""
    times = np.asarray(dataset["face_times_seen"].values, dtype=np.float64)
    times[times == 0] = np.nan
    if np.isnan(times).all():
        return ()
    displacement = 1e3 * np.asarray(dataset["face_displacement"].values, dtype=np.float64)
    incidence = np.asarray(dataset["face_incidence"].values, dtype=np.float64)
    return (
        FaceMap(
            "displacement",
            "Mean displacement on each face, all poses",
            "Mean displacement (µm)",
            displacement,
            displacement_limits(displacement),
        ),
        FaceMap(
            "times_seen",
            "How many poses see each face",
            "Poses that see the face",
            times,
            (0.0, float(np.nanmax(times))),
        ),
        FaceMap(
            "incidence",
            "Best angle of incidence on each face, all poses",
            "Smallest angle of incidence (°)",
            incidence,
            (0.0, 90.0),
        ),
    )


def faces_seen(dataset: xr.Dataset, region: str) -> IntArray:
    """(n,) array: how many faces of a region each pose sees."""
    counts = np.asarray(dataset[COUNTS].values, dtype=np.int64)
    number = [str(name) for name in dataset["region"].values].index(region)
    if number == 0:
        return counts
    pose = np.repeat(np.arange(len(counts)), counts)
    inside = dataset["face_region"].values[dataset["sighting_face"].values] == number
    return np.bincount(pose[inside], minlength=len(counts)).astype(np.int64)


def displacement_limits(values: FloatArray) -> Limits:
    """Limits of the colours of displacements, their 1st and 99th percentile, never equal.

    The lower one is positive, for a logarithmic scale, unless nothing moves: then 0 and 1.
    """
    low, high = (float(v) for v in np.nanpercentile(values, _PERCENTILES))
    if not high > 0.0:
        return 0.0, 1.0
    low = max(low, 1e-4 * high)
    return (low, high) if high > 1.05 * low else (low / 1.05, high * 1.05)
