"""Cost of refraction relative to its ray queries: a trace's queries, replayed alone."""

from __future__ import annotations

import time
from statistics import median
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

from iriftrace.image.aov_image import CHANNELS
from iriftrace.plugins.kernels.march import RefractedHits, refracted_hits
from iriftrace.plugins.kernels.queries import HIT_PART
from iriftrace.plugins.picture import PixelRays
from iriftrace.tracing.scene import Scene

RECORDED = 24
"""Number of queries recorded for each ray; few rays cross more shells of the usual 13."""


class PairOfTimes(NamedTuple):
    """Seconds of a trace and of its queries alone, one right after the other."""

    trace_s: float
    queries_s: float


class Recording:
    """All queries of a pose's refracted rays, in the order in which the tracer makes them.

    The scene must have the integrator ``first_hit``; at most `queries` are recorded for each ray.
    """

    def __init__(self, scene: Scene, queries: int = RECORDED) -> None:
        self.scene: Any = scene.compiled.mitsuba_scene
        self.integrator = scene.compiled.integrator
        self.prepared = self.integrator.prepare(self.scene)
        sensor = self.scene.sensors()[0]
        hits = self.integrator.straight(self.scene, sensor)
        chosen: Any = dr.compress(hits.outcome == HIT_PART)
        self.origin, self.direction = PixelRays(sensor, len(CHANNELS))(chosen)
        dr.eval(self.origin, self.direction)
        self.rays = dr.width(chosen)
        points, directions = [mi.Point3f(self.origin)], [mi.Vector3f(self.direction)]
        for crossings in range(1, queries):
            state = self._trace(crossings)
            points.append(mi.Point3f(state.point + state.direction * self.prepared.step))
            directions.append(mi.Vector3f(state.direction))
            dr.eval(points[-1], directions[-1])
        self.points = mi.Point3f(*(dr.concat([p[k] for p in points]) for k in range(3)))
        self.directions = mi.Vector3f(*(dr.concat([d[k] for d in directions]) for k in range(3)))
        self.last = dr.minimum(self._trace(1000).crossings, queries - 1)
        dr.eval(self.points, self.directions, self.last)

    def _trace(self, max_crossings: int) -> RefractedHits:
        return refracted_hits(
            self.prepared,
            self.origin,
            self.direction,
            coherent=True,
            bending=self.integrator.rule(self.prepared.tables),
            max_crossings=max_crossings,
            drop_inside_hits=self.integrator.inside_hit == "drop",
        )

    def trace(self) -> None:
        """The refracted trace."""
        dr.eval(*self._trace(1000))
        dr.sync_thread()

    def replay(self) -> None:
        """The same queries and nothing else."""
        number = dr.arange(mi.UInt32, self.rays)

        def query(
            k: mi.UInt32, total: mi.Float, active: mi.Bool
        ) -> tuple[mi.UInt32, mi.Float, mi.Bool]:
            index = k * self.rays + number
            ray = mi.Ray3f(
                dr.gather(mi.Point3f, self.points, index, active),
                dr.gather(mi.Vector3f, self.directions, index, active),
            )
            found = self.scene.ray_intersect_preliminary(ray, coherent=True, active=active)
            total += dr.select(active & found.is_valid(), found.t, 0)
            return k + 1, total, active & (k < self.last)

        state = (
            dr.zeros(mi.UInt32, self.rays),
            dr.zeros(mi.Float, self.rays),
            dr.full(mi.Bool, True, self.rays),
        )
        _, total, _ = dr.while_loop(state, lambda *s: s[-1], query, compress=False)
        dr.eval(total)
        dr.sync_thread()

    def time_pairs(self, repeats: int) -> list[PairOfTimes]:
        """Times of trace and replay in turn, after one of each that compiles the kernels."""
        self.trace()
        self.replay()
        pairs = []
        for _ in range(repeats):
            started = time.perf_counter()
            self.trace()
            traced = time.perf_counter()
            self.replay()
            pairs.append(PairOfTimes(traced - started, time.perf_counter() - traced))
        return pairs


def trace_over_queries(scene: Scene, repeats: int) -> tuple[float, int]:
    """Median over pairs of runs of trace time / replay time, and the number of rays."""
    recording = Recording(scene)
    pairs = recording.time_pairs(repeats)
    return median(pair.trace_s / pair.queries_s for pair in pairs), recording.rays
