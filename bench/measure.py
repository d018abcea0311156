"""Cost of a simulated measurement and of its correction."""

from __future__ import annotations

import time
from statistics import median

from iriftrace.camera.pose import look_at
from iriftrace.scene.load import LoadedScene
from iriftrace.trace.render import render_scene
from iriftrace.triangulation.correct import correct
from iriftrace.triangulation.scan import Scan, measure


def measure_over_trace(scene: LoadedScene, repeats: int) -> tuple[float, Scan]:
    """Median of a measurement's time over the refracted trace's of one pose, and the scan.

    The projector stands 80 mm below the camera of the bundled cylinder.
    """
    projector = scene.camera.at(look_at((150.0, -100.0, 40.0), (0.0, 0.0, 0.0)))
    ratios = []
    for _ in range(repeats + 1):
        trace_s = render_scene(scene, nearest=False).metrics.time_s["refracted"]
        started = time.perf_counter()
        scan = measure(scene, second=projector, system="fringe")
        ratios.append((time.perf_counter() - started) / trace_s)
    # The first pair compiles the kernels.
    return median(ratios[1:]), scan


def seconds_per_million_corrected(scene: LoadedScene, scan: Scan, repeats: int) -> float:
    """Median time of the correction of a million points of a scan."""
    seconds = []
    for _ in range(repeats + 1):
        started = time.perf_counter()
        correct(scan.points, scene, second=scan.second, system="fringe")
        seconds.append((time.perf_counter() - started) * 1e6 / len(scan.points))
    return median(seconds[1:])
