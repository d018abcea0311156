"""Test of a scene's shells in a view: the change when every second one is left out.

Needs no field. Where hits hardly move without half of the shells, single rays have converged; where
lines of sight run along the layers, as straight down a plume, they move by as much as the air does.
"""

from __future__ import annotations

import warnings

import numpy as np
from attrs import asdict, frozen

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import IriftraceWarning
from iriftrace.image.aov_image import AovImage, Status
from iriftrace.runtime import variant as runtime
from iriftrace.scene.load import LoadedScene

SAMPLE = 5000
"""Good rays of the picture that are traced again."""

SHARES = 0.5, 0.95

FEWEST = 100
"""As for the metrics: fewer good rays give no numbers."""

LIMIT = 0.03
"""Of the share of the 95th percentile: what the shells are to be right by."""

WHY = "when every second shell is left out, as where lines of sight run along the layers of hot air"


@frozen
class ShellResolution:
    """By how much hits move when every second shell is left out.

    Median and 95th percentile of the distances between the hits are also stated as shares of the
    displacement's.
    """

    rays: int  # of the sample that hit the part both times
    median_mm: float
    p95_mm: float
    median_share: float
    p95_share: float

    @property
    def suffices(self) -> bool:
        """Whether single rays of this view can be relied on."""
        return self.p95_share <= LIMIT

    def as_dict(self) -> dict[str, float | int | bool]:
        """Plain JSON values."""
        return {**asdict(self), "suffices": self.suffices}


def shell_resolution(
    scene: LoadedScene, image: AovImage, sample: int = SAMPLE
) -> ShellResolution | None:
    """Trace a sample of a picture's good rays again, with all shells and with every second one.

    None with the continuous engine, of an ensemble, with fewer than 5 shells or such as do not lead
    from one index to the next, where no ray is bent, and with fewer than `FEWEST` rays.
    """
    good = np.flatnonzero(image.status == Status.GOOD)
    if len(good) == 0:
        return None
    pixels = good[np.linspace(0, len(good) - 1, min(sample, len(good))).astype(np.int64)]
    row, column = np.divmod(pixels, image.status.shape[1])
    origin, direction = image.camera.rays(np.column_stack((column, row)) + 0.5)
    size = image.channels["displacement.norm"].ravel()[pixels].astype(np.float64)
    return resolution_of_rays(scene, origin, direction, size)


def resolution_of_rays(
    scene: LoadedScene, origin: FloatArray, direction: FloatArray, displacement_mm: FloatArray
) -> ShellResolution | None:
    """As `shell_resolution`, of rays that hit the part with the displacements (n,), mm.

    Origins and unit directions are (n, 3) arrays, mm, world.
    """
    if scene.engine != "shells" or scene.ensemble is not None or len(origin) < FEWEST:
        return None
    with runtime.using(scene.variant):
        import mitsuba as mi

        from iriftrace.plugins.kernels.tables import aligned

        places = mi.Point3d(*(mi.Float64(aligned(column)) for column in origin.T))
        headings = mi.Vector3d(*(mi.Float64(aligned(column)) for column in direction.T))
        distances = scene.integrator.moved_by_fewer_shells(scene.mitsuba_scene, places, headings)
        if distances is None:
            return None
        moved = np.array(distances)
    known = np.isfinite(moved)
    if known.sum() < FEWEST:
        return None
    whole = np.quantile(displacement_mm[known], SHARES)
    if not whole[0] > 0.0:
        return None
    change = np.quantile(moved[known], SHARES)
    return ShellResolution(int(known.sum()), *change.tolist(), *(change / whole).tolist())


def warn_of_coarse_shells(found: ShellResolution, through_field: bool = False) -> None:
    """Warn that shells are too few for single rays of a view, or that the field served instead."""
    if not found.suffices:
        change = (
            f"Hits of this view change by {1e3 * found.p95_mm:.3g} um ({found.p95_share:.1%} of "
            f"the displacement; 95th percentiles) {WHY}"
        )
        warnings.warn(
            f'{change}; the field itself was traced instead (load_scene with engine="shells", or '
            "--engine shells, insists on shells)."
            if through_field
            else f'{change}; load the scene with engine="continuous" (--engine continuous), or '
            "make it with layers=20 (--layers 20).",
            IriftraceWarning,
            stacklevel=3,
        )


def warn_of_coarse_poses(
    p95_shares: FloatArray, p95_mm: FloatArray, through_field: FloatArray
) -> None:
    """The same of a sweep's n poses, (n,) arrays.

    Shares are NaN where nothing is known; `through_field` is 1 where the field served instead.
    """
    coarse = p95_shares > LIMIT
    for these, what in (
        (
            coarse & (through_field == 1),
            "the field itself was traced there (--engine shells insists on shells)",
        ),
        (
            coarse & (through_field != 1),
            "sweep with --engine continuous, or make the scene with --layers 20",
        ),
    ):
        if these.any():
            warnings.warn(
                f"Hits of {these.sum()} of {len(these)} poses change by over {LIMIT:.0%} of the "
                f"displacement (95th percentiles, variable every_second_shell_p95), by up to "
                f"{1e3 * np.nanmax(p95_mm[these]):.3g} um, {WHY}; {what}.",
                IriftraceWarning,
                stacklevel=4,
            )
