"""What refraction costs beyond the ray queries themselves: the recorded queries, replayed alone."""

from __future__ import annotations

import time
from statistics import median
from typing import Any

from iriftrace.plugins.tracing import refracted_hits, straight_hits
from iriftrace.scene import LoadedScene

RECORDED = 24
"""Queries recorded of each ray; hardly one crosses more shells."""


class Recording:
    """All queries of a pose's refracted rays, in the order in which the tracer makes them."""

    def __init__(self, scene: LoadedScene) -> None:
        import drjit as dr
        import mitsuba as mi

        self.scene = scene.mitsuba_scene
        self.prepared = scene.integrator.prepare(self.scene)
        sensor = self.scene.sensors()[0]
        width, height = sensor.film().size()
        pixel = dr.arange(mi.UInt32, int(width) * int(height))
        origin, direction = self._rays(sensor, pixel, int(width))
        hits = straight_hits(
            self.prepared.opaque,
            self.prepared.tables,
            origin,
            direction,
            coherent=True,
            step=self.prepared.step,
        )
        chosen = dr.compress(hits.outcome == 1)
        self.origin, self.direction = self._rays(sensor, chosen, int(width))
        dr.eval(self.origin, self.direction)
        self.rays = dr.width(chosen)
        points, directions = [mi.Point3f(self.origin)], [mi.Vector3f(self.direction)]
        for crossings in range(1, RECORDED):
            state = self._trace(crossings)
            points.append(mi.Point3f(state.point + state.direction * self.prepared.step))
            directions.append(mi.Vector3f(state.direction))
            dr.eval(points[-1], directions[-1])
        self.points = mi.Point3f(*(dr.concat([p[k] for p in points]) for k in range(3)))
        self.directions = mi.Vector3f(*(dr.concat([d[k] for d in directions]) for k in range(3)))
        self.last = dr.minimum(self._trace(1000).crossings, RECORDED - 1)
        dr.eval(self.points, self.directions, self.last)

    @staticmethod
    def _rays(sensor: Any, pixel: Any, width: int) -> tuple[Any, Any]:
        import mitsuba as mi

        return sensor.rays64(mi.Float64(pixel % width) + 0.5, mi.Float64(pixel // width) + 0.5)

    def _trace(self, max_crossings: int) -> Any:
        return refracted_hits(
            self.scene,
            self.prepared.opaque,
            self.prepared.tables,
            self.origin,
            self.direction,
            coherent=True,
            gradient_normals=True,
            max_crossings=max_crossings,
            step=self.prepared.step,
        )

    def trace(self) -> None:
        """The refracted trace."""
        import drjit as dr

        dr.eval(*self._trace(1000))
        dr.sync_thread()

    def replay(self) -> None:
        """The same queries and nothing else."""
        import drjit as dr
        import mitsuba as mi

        number = dr.arange(mi.UInt32, self.rays)

        def query(k: Any, total: Any, active: Any) -> tuple[Any, Any, Any]:
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


def trace_over_queries(scene: LoadedScene, repeats: int) -> tuple[float, int]:
    """Median over pairs of runs of trace time / replay time, and the number of rays."""
    recording = Recording(scene)
    recording.trace()
    recording.replay()
    ratios = []
    for _ in range(repeats):
        started = time.perf_counter()
        recording.trace()
        traced = time.perf_counter()
        recording.replay()
        ratios.append((traced - started) / (time.perf_counter() - traced))
    return median(ratios), recording.rays
