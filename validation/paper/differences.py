"""Distances between the refracted hits of two runs, ray by ray."""

from __future__ import annotations

import numpy as np
from attrs import asdict, frozen

from iriftrace.core.arrays import BoolArray, FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.statistics import rms, spread
from iriftrace.image.aov_image import AovImage, Status

TRIMMED = 0.01
"""Fraction of the rays, those that differ most, that the trimmed rmse leaves out."""


@frozen(eq=False)
class Hits:
    """Hits of one picture of n pixels, for a comparison."""

    displacement: FloatArray  # (n, 3), mm, world: refracted minus straight hit; 0 without both
    good: BoolArray  # (n,) rays with status 0
    hit: BoolArray  # (n,) rays whose straight twin hits the part in focus


@frozen
class Differences:
    """Differences of two runs over the rays good in both: distances of refracted hits, mm.

    The root mean square is as in Kern et al. (2025); outliers of several mm at silhouettes dominate
    it.
    """

    rmse: float
    rmse_trimmed: float  # without the fraction `TRIMMED` of rays, those that differ most
    median: float
    p95: float
    matched: int  # rays good in both runs
    # Unmatched rays: good in only one of the runs.
    only_here: int
    only_reference: int

    def as_dict(self) -> dict[str, float | int]:
        """Plain JSON values."""
        return asdict(self)


def hits_of(image: AovImage) -> Hits:
    """Extract the data for a comparison from a picture."""
    status = image.status.ravel()
    away = (Status.MISSED, Status.OUT_OF_FOCUS, Status.BLOCKED, Status.ONLY_REFRACTED)
    return Hits(
        displacement=image.vector("displacement").reshape(-1, 3).astype(np.float64),
        good=status == Status.GOOD,
        hit=~np.isin(status, away),
    )


def compare(here: Hits, reference: Hits) -> Differences:
    """Differences of two runs of one camera on one part.

    The straight hits of both runs are the same numbers, so the distance of the refracted hits is
    that of the displacements. Single precision holds these to 1e-7 of their own length, instead of
    the distance to the origin. Raises InputError if the pictures differ in size, or no ray is good
    in both.
    """
    if here.good.shape != reference.good.shape:
        raise InputError(
            f"Pictures of {len(here.good)} and {len(reference.good)} pixels cannot be compared ray "
            "by ray; give both the same camera.",
            code="validation.other_size",
        )
    both = here.good & reference.good
    if not both.any():
        raise InputError(
            "No ray is good in both runs, so there is nothing to compare; let the camera look at "
            "the part.",
            code="validation.no_rays",
        )
    distance = np.linalg.norm(here.displacement[both] - reference.displacement[both], axis=1)
    return Differences(
        rmse=rms(distance),
        rmse_trimmed=rms(np.sort(distance)[: max(1, int((1 - TRIMMED) * len(distance)))]),
        **spread(distance, ("median", "p95")),
        matched=int(both.sum()),
        only_here=int((here.good & ~both).sum()),
        only_reference=int((reference.good & ~both).sum()),
    )


def displacement_statistics(hits: Hits) -> dict[str, float | int]:
    """Displacement of one run: median, p95 and rms over its good rays, mm, and the counts."""
    norm = np.linalg.norm(hits.displacement[hits.good], axis=1)
    if len(norm) == 0:
        raise InputError(
            "No ray of the picture is good, so there is nothing to compare.",
            code="validation.no_rays",
        )
    sizes = spread(norm, ("median", "p95", "rms"))
    return {
        **{f"displacement_{name}": size for name, size in sizes.items()},
        "rays_good": int(hits.good.sum()),
        "rays_lost": int((hits.hit & ~hits.good).sum()),
    }
