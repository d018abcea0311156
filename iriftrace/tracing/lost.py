"""Warning about rays whose end is not known: lost on the way, or deflected too much for air."""

from __future__ import annotations

from iriftrace.core.errors import warn
from iriftrace.image.ray_statistics import RayCounts

LIMIT = 0.005
"""Fraction of a view's hits above which a warning is issued."""

REMEDY = (
    "use the other engine (shells or cells), and write the scene again from the solver's own mesh, "
    "with all triangles of its shells"
)


def warn_of_lost_rays(rays: RayCounts) -> None:
    """Warn about a picture with many pixels of status 5 or 6."""
    if rays.lost_fraction > LIMIT:
        warn(
            f"{rays.lost:,} of {rays.hit:,} hits ({rays.lost_fraction:.1%}) have no reliable "
            f"refracted ray ({rays.index_mismatch:,} with inconsistent deflection, "
            f"status 5; {rays.gave_up:,} lost on the way, status 6), so these pixels have no "
            f"displacement; {REMEDY}.",
            argument="engine",
        )


def warn_of_lost_points(lost: int, points: int, where: str) -> None:
    """Warn about a cloud in which `lost` of so many points have no reliable line of sight."""
    if lost > LIMIT * points:
        warn(
            f"{lost:,} of {points:,} points ({lost / points:.1%}) {where}, because a refracted ray "
            f"to them was lost or has an impossible deflection; {REMEDY}.",
            argument="engine",
        )
