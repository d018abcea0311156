"""The poses of a sweep that together see the most of the part within limits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.errors import InputError
from iriftrace.face_sightings import seen_by_pose
from iriftrace.plan_candidates import ranked_region
from iriftrace.view_cover import ViewSet, choose_views

if TYPE_CHECKING:
    import xarray as xr

BoolArray = NDArray[np.bool_]


@frozen
class ViewLimits:
    """How badly a pose may see a face for it to count as seen.

    Attributes
    ----------
    displacement_mm : float, mm
        Largest mean displacement of the rays on the face.
    incidence_deg : float, degree
        Largest angle of incidence of the ray that hits the face most squarely.
    """

    displacement_mm: float = math.inf
    incidence_deg: float = 90.0

    @property
    def text(self) -> str:
        """The limits in words, after "seen"."""
        limits = []
        if math.isfinite(self.displacement_mm):
            limits.append(f"with a displacement of {1e3 * self.displacement_mm:g} um at most")
        if self.incidence_deg < 90.0:
            limits.append(f"at an angle of {self.incidence_deg:g} degrees at most")
        return " and ".join(limits) or "at all"


NO_LIMITS = ViewLimits()


def plan_views(
    dataset: xr.Dataset,
    views: int,
    limits: ViewLimits = NO_LIMITS,
    *,
    region: str = "part",
    min_hits: int = 100,
) -> ViewSet:
    """Choose the poses that together see the most area, each face within the limits.

    Parameters
    ----------
    dataset
        A sweep that says which faces each pose sees.
    views
        Number of poses, at least 1.
    limits
        A face beyond them does not count as seen.
    region
        ``part`` (all of it), or the region that matters.
    min_hits
        Poses with fewer good rays on the region are no candidates.

    Returns
    -------
    ViewSet
        Its shares are those of the region's area.

    Raises
    ------
    InputError
        A limit or the number of views is wrong, the sweep is an older one without faces, or no
        pose sees a face within the limits.
    """
    if views < 1:
        raise InputError(f"The number of views is {views}, so nothing is seen; give at least 1.")
    number = ranked_region(dataset, ["rays_good"], region)
    seen = seen_by_pose(
        dataset,
        max_displacement_mm=limits.displacement_mm,
        max_incidence_deg=limits.incidence_deg,
    )
    areas = np.asarray(dataset["face_area"].values, dtype=np.float64)
    if number > 0:
        areas = np.where(dataset["face_region"].values == number, areas, 0.0)
    enough = np.asarray(dataset["rays_good"].isel(region=number).values) >= min_hits
    seen &= enough[:, None]
    if not np.any(seen & (areas > 0)):
        raise InputError(_nothing(dataset, areas > 0, region))
    return choose_views(seen, areas, views)


def _nothing(dataset: xr.Dataset, wanted: BoolArray, region: str) -> str:
    """Why no face is left, and which limits would leave some."""
    rows = wanted[dataset["sighting_face"].values]
    if not rows.any():
        return f"No pose sees a face of {region}, so there is nothing to choose from; sweep others."
    displacement = dataset["sighting_displacement"].values[rows]
    incidence = dataset["sighting_incidence"].values[rows]
    return (
        f"No pose sees a face of {region} within the limits: displacements of the faces seen are "
        f"{1e3 * displacement.min():.3g} to {1e3 * displacement.max():.3g} um and angles of "
        f"incidence {incidence.min():.3g} to {incidence.max():.3g} degrees; relax "
        "--max-displacement, --max-incidence or --min-hits."
    )
