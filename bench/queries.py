"""Cost of refraction relative to the ray queries themselves."""

from __future__ import annotations

from statistics import median

from iriftrace.scene.scene import Scene
from iriftrace.trace.query_replay import Recording


def trace_over_queries(scene: Scene, repeats: int) -> tuple[float, int]:
    """Median over pairs of runs of trace time / replay time, and the number of rays."""
    recording = Recording(scene)
    pairs = recording.time_pairs(repeats)
    return median(pair.trace_s / pair.queries_s for pair in pairs), recording.rays
