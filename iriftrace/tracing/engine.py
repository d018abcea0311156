"""Choice of the engine that bends rays: shells, or cells where the shells are too coarse.

There is one test on one sample of rays: shells suffice if hits hardly move when every second
shell is left out. Where lines of sight run along the layers, as straight down a plume, they move by
as much as the displacement itself. All tracing calls `choose`, so the same rays have the same
numbers in a picture, a measurement, a correction and a sweep.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from attrs import asdict, evolve, frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import warn
from iriftrace.core.runtime import variant as runtime
from iriftrace.image.aov_image import Status
from iriftrace.tracing.lost import LIMIT as LOST_LIMIT
from iriftrace.tracing.pose_image import sensor_for
from iriftrace.tracing.scene import Scene

if TYPE_CHECKING:
    import mitsuba as mi

    from iriftrace.plugins.kernels.bundle import StraightHits

PIXELS = 100_000
"""Maximum number of pixels of the picture by which a camera is tested."""

SAMPLE = 5000
"""Maximum number of rays of a picture or bundle that are traced in the test."""

QUANTILES = 0.5, 0.95

FEWEST = 100
"""Minimum number of refracted rays of a picture for a test; as for the metrics."""

LIMIT = 0.03
"""Largest relative change of the hits (95th percentiles) for which shells suffice."""

TOO_COARSE = "shells too few for single rays"

_WHEN = (
    "when every second shell is left out, as where lines of sight run along the layers of hot air"
)

_PREVENTED = 'which engine="shells" prevents'

CHANGE = "change of the hits without every second shell, 95th percentile"
"""Name of `EngineTest.p95_mm` in files."""

View = Camera | tuple[FloatArray, FloatArray] | None
"""Rays of a test: a camera's, a bundle's (origins, mm, and directions, (n, 3) each), or those of
the scene's own sensor."""


@frozen
class EngineTest:
    """Change of the hits when every second shell is left out.

    Median and 95th percentile of the distances between the hits are also stated as fractions of the
    displacement's. Rays that run through hot air between two shells without being refracted by one
    are entirely wrong: a fraction of 1.
    """

    rays: int  # of the sample that hit the part both times
    median_mm: float
    p95_mm: float
    median_share: float
    p95_share: float
    unmet: int = 0  # rays of the sample that run through hot air without meeting a shell

    @property
    def suffices(self) -> bool:
        """True if single rays of this view can be relied on."""
        return self.p95_share <= LIMIT


@frozen(eq=False)
class Choice:
    """The scene as it is to be traced, and the test of its shells."""

    scene: Scene
    test: EngineTest | None = None  # the worst of all views and members; None if not tested
    through_cells: bool = False  # cells are traced instead of shells
    straight: StraightHits | None = None  # of the picture, if tested at its own resolution
    straight_s: float = 0.0  # seconds that these took

    def as_dict(self) -> dict[str, float | int | bool] | None:
        """Plain JSON values, for every result; None without a test."""
        if self.test is None:
            return None
        said = {"suffices": self.test.suffices, "through_cells": self.through_cells}
        return {**asdict(self.test), **said}


def choose(scene: Scene, *views: View) -> Choice:
    """Choose the engine that bends the rays of some views, the same for all.

    Cells are chosen if the shells are too few for one of the views in one of an ensemble's members
    that count, the field file lies next to the scene, no engine was requested, and the cells lose
    at most 0.5 % of the same rays. Nothing is tested if the scene has only cells or was loaded to
    use them, has fewer than 5 shells or shells that do not lead from one index to the next, or if
    no ray of the views is refracted (in a picture, fewer than 100).

    Warns
    -----
    IriftraceWarning
        The shells are too few, whether or not cells are used instead.
    """
    if scene.compiled.engine.through_cells:
        return Choice(scene)
    with runtime.using(scene.compiled.variant):
        samples = [_sample(scene, view) for view in views]
        chosen = _by_samples(scene, [one for one in samples if one.rays is not None])
    if len(samples) != 1:
        return chosen
    return evolve(chosen, straight=samples[0].straight, straight_s=samples[0].straight_s)


class _Sample(NamedTuple):
    """Rays of a view that hit the part in focus, and how many of them must be refracted."""

    rays: tuple[mi.Point3d, mi.Vector3d] | None  # origins, mm, and directions
    fewest: int
    straight: StraightHits | None = None  # of a picture that is tested at its own resolution
    straight_s: float = 0.0


def _by_samples(scene: Scene, samples: list[_Sample]) -> Choice:
    tests = [
        found
        for member in scene.alone(scene.counted)
        for sample in samples
        if (found := _tested(member, sample)) is not None
    ]
    worst = max(tests, key=lambda test: test.p95_share, default=None)
    if worst is None or worst.suffices:
        return Choice(scene, worst)
    cells = scene.through_cells
    lost = 0.0 if cells is None else _lost_fraction(cells, samples)
    if lost > LOST_LIMIT:
        warn(
            f"The shells are too coarse for this view, but the field loses {lost:.1%} of its "
            "rays in cells that are badly shaped, so the shells are used; check the field's "
            "mesh (iriftrace field check), or write the scene with more shells (layers=40).",
            argument="layers",
        )
        return Choice(scene, worst)
    _warn_of_coarse_shells(worst, cells is not None)
    return Choice(cells or scene, worst, cells is not None)


def _sample(scene: Scene, view: View) -> _Sample:
    if isinstance(view, tuple):
        return _Sample(_of_bundle(*view), 1)
    camera = view or scene.camera
    width, height = camera.resolution
    # The sensor of a camera with parallel rays is the file's own, at its own resolution.
    whole = width * height <= PIXELS or camera.projection != "pinhole"
    if not whole:
        view = camera.scaled((PIXELS / (width * height)) ** 0.5)
    sensor = sensor_for(scene, view)
    started = time.perf_counter()
    integrator = scene.compiled.integrator
    straight = integrator.straight(scene.compiled.mitsuba_scene, sensor)
    seconds = time.perf_counter() - started
    rays = integrator.sharp_rays(sensor, straight, SAMPLE)
    return _Sample(rays, FEWEST, straight, seconds) if whole else _Sample(rays, FEWEST)


def _of_bundle(origins: FloatArray, directions: FloatArray) -> tuple[mi.Point3d, mi.Vector3d]:
    import mitsuba as mi

    from iriftrace.plugins.kernels.vertex_table import aligned_rows

    count = min(SAMPLE, len(origins))
    chosen = (np.arange(count) * (len(origins) / count)).astype(np.int64)
    return (
        mi.Point3d(*aligned_rows(origins[chosen])),
        mi.Vector3d(*aligned_rows(directions[chosen])),
    )


def _tested(scene: Scene, sample: _Sample) -> EngineTest | None:
    fewest = sample.fewest
    assert sample.rays is not None
    compiled = scene.compiled
    changes = compiled.integrator.moved_by_fewer_shells(compiled.mitsuba_scene, *sample.rays)
    if changes is None:
        return None
    displacement, moved, blind = map(np.array, changes)
    known, unmet = np.isfinite(moved), int(blind.sum())
    bent = known & (displacement > 0.0)
    if bent.sum() < fewest and unmet < fewest:
        return None
    whole = change = relative = np.zeros(2)
    if bent.sum() >= fewest:
        whole, change = (np.quantile(a[known], QUANTILES) for a in (displacement, moved))
        if not whole[0] > 0.0:
            whole = np.quantile(displacement[bent], QUANTILES)
        relative = change / whole
    wrong = unmet / len(blind) > 1.0 - np.array(QUANTILES)
    relative = np.where(wrong, 1.0, relative)
    (median, p95), (median_share, p95_share) = change.tolist(), relative.tolist()
    return EngineTest(int(known.sum()), median, p95, median_share, p95_share, unmet)


def _lost_fraction(scene: Scene, samples: list[_Sample]) -> float:
    """Largest fraction of a sample's rays, over the members that count, whose end is not known."""
    return max(
        _lost_of(member, *sample.rays)
        for member in scene.alone(scene.counted)
        for sample in samples
        if sample.rays is not None
    )


def _lost_of(scene: Scene, origin: mi.Point3d, direction: mi.Vector3d) -> float:
    import drjit as dr

    from iriftrace.plugins.kernels.bundle import rays_of

    trace = scene.compiled.integrator.trace(
        scene.compiled.mitsuba_scene,
        rays_of(origin, direction),
        dr.width(origin, direction),
        focus=(0.0, float("inf")),
        coherent=False,
        trace_all=True,
    ).trace
    lost = np.isin(np.array(trace.status), [code for code in Status if code.lost])
    return float(lost.mean())


def _warn_of_coarse_shells(found: EngineTest, through_cells: bool) -> None:
    change = (
        f"Hits of this view change by {1e3 * found.p95_mm:.3g} um ({found.p95_share:.1%} of "
        f"the displacement; 95th percentiles) {_WHEN}"
    )
    if found.p95_share == 1.0:
        change = (
            f"{found.unmet:,} rays of a sample run through hot air between two shells without "
            "meeting one, so that they are not refracted"
        )
    warn(
        f"{change}; the field data were traced instead, {_PREVENTED}."
        if through_cells
        else f'{change}; trace the field data (engine="cells"), or use more shells (layers=20).',
        argument="engine",
    )


def warn_of_coarse_poses(
    p95_shares: FloatArray, p95_mm: FloatArray, through_cells: FloatArray
) -> None:
    """The same warning for a sweep's n poses, (n,) arrays.

    Fractions are NaN where nothing is known; `through_cells` is 1 where cells were used instead.
    """
    coarse = p95_shares > LIMIT
    for these, what in (
        (coarse & (through_cells == 1), f"the field data were traced there, {_PREVENTED}"),
        (
            coarse & (through_cells != 1),
            'sweep with engine="cells", or make the scene with more shells (layers=20)',
        ),
    ):
        if these.any():
            warn(
                f"Hits of {these.sum()} of {len(these)} poses change by over {LIMIT:.0%} of the "
                f"displacement (95th percentiles, variable engine_test_p95), by up to "
                f"{1e3 * np.nanmax(p95_mm[these]):.3g} um, {_WHEN}; {what}.",
                argument="engine",
            )
