"""Test of a scene's shells in a view: the change when every second one is left out.

Needs no field. Where hits hardly move without half of the shells, single rays have converged; where
lines of sight run along the layers, as straight down a plume, they move by as much as the air does.
"""

from __future__ import annotations

import time
import warnings
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from attrs import asdict, frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import IriftraceWarning
from iriftrace.runtime import variant as runtime
from iriftrace.scene.load import LoadedScene
from iriftrace.trace.pose_image import sensor_for

if TYPE_CHECKING:
    from iriftrace.plugins.kernels.queries import StraightHits

SAMPLE = 5000
"""Rays of the picture that are traced to test the shells."""

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
    displacement's. Rays that no shell bends, though they run through hot air between two of them,
    are wrong altogether: a share of 1.
    """

    rays: int  # of the sample that hit the part both times
    median_mm: float
    p95_mm: float
    median_share: float
    p95_share: float
    unmet: int = 0  # rays of the sample that run through hot air without meeting a shell

    @property
    def suffices(self) -> bool:
        """Whether single rays of this view can be relied on."""
        return self.p95_share <= LIMIT

    def as_dict(self) -> dict[str, float | int | bool]:
        """Plain JSON values."""
        return {**asdict(self), "suffices": self.suffices}


class PictureTest(NamedTuple):
    """What a picture's rays say of the shells, and its straight hits, of which these are."""

    resolution: ShellResolution | None
    straight: StraightHits | None  # None without a test
    straight_s: float
    rays: tuple[Any, Any] | None = None  # origins (Point3d) and directions (Vector3d) of the sample


NOT_TESTED = PictureTest(None, None, 0.0)


def shell_resolution(
    scene: LoadedScene, camera: Camera | None = None, sample: int = SAMPLE
) -> PictureTest:
    """Trace a sample of a picture's rays with all shells and with every second one.

    Of the scene's own camera or of another, before the picture is traced. No resolution is found
    with the continuous engine, of an ensemble, with fewer than 5 shells or such as do not lead from
    one index to the next, where no ray is bent, and with fewer than `FEWEST` rays.
    """
    if not _can_be_thinned_out(scene):
        return NOT_TESTED
    with runtime.using(scene.variant):
        sensor = sensor_for(scene, camera)
        started = time.perf_counter()
        straight = scene.integrator.straight(scene.mitsuba_scene, sensor)
        seconds = time.perf_counter() - started
        rays = scene.integrator.sharp_rays(sensor, straight, sample)
        found = None if rays is None else _resolution(scene, *rays)
        return PictureTest(found, straight, seconds, rays)


def _can_be_thinned_out(scene: LoadedScene) -> bool:
    return scene.engine == "shells" and scene.ensemble is None


def _resolution(scene: LoadedScene, origin: Any, direction: Any) -> ShellResolution | None:
    """Of rays with origins (Point3d) and directions (Vector3d)."""
    ways = scene.integrator.moved_by_fewer_shells(scene.mitsuba_scene, origin, direction)
    if ways is None:
        return None
    displacement, moved, blind = map(np.array, ways)
    known, unmet = np.isfinite(moved), int(blind.sum())
    bent = known & (displacement > 0.0)
    if bent.sum() < FEWEST and unmet < FEWEST:
        return None
    whole = change = shares = np.zeros(2)
    if bent.sum() >= FEWEST:
        whole, change = (np.quantile(a[known], SHARES) for a in (displacement, moved))
        if not whole[0] > 0.0:
            whole = np.quantile(displacement[bent], SHARES)
        shares = change / whole
    wrong = unmet / len(blind) > 1.0 - np.array(SHARES)
    shares = np.where(wrong, 1.0, shares)
    (median, p95), (median_share, p95_share) = change.tolist(), shares.tolist()
    return ShellResolution(int(known.sum()), median, p95, median_share, p95_share, unmet)


def warn_of_coarse_shells(found: ShellResolution, through_field: bool = False) -> None:
    """Warn that shells are too few for single rays of a view, or that the field served instead."""
    if not found.suffices:
        change = (
            f"Hits of this view change by {1e3 * found.p95_mm:.3g} um ({found.p95_share:.1%} of "
            f"the displacement; 95th percentiles) {WHY}"
        )
        if found.p95_share == 1.0:
            change = (
                f"{found.unmet:,} rays of a sample run through hot air between two shells and meet "
                "none, so that no shell bends them"
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
