"""Cost of a simulated measurement and of its correction."""

from __future__ import annotations

import time
from statistics import median

from iriftrace.camera.pose import look_at
from iriftrace.measuring.two_devices.correct import correct
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.measuring.two_devices.scan import Scan
from iriftrace.tracing.render import render_scene
from iriftrace.tracing.scene import Scene


def measure_over_trace(scene: Scene, repeats: int) -> tuple[float, Scan]:
    """Median of a measurement's time over the refracted trace's of one pose, and the scan.

    The projector stands 80 mm below the camera of the bundled cylinder.
    """
    projector = scene.camera.at(look_at((150.0, -100.0, 40.0), (0.0, 0.0, 0.0)))
    ratios = []
    for _ in range(repeats + 1):
        trace_s = render_scene(scene).metrics.time_s["refracted"]
        started = time.perf_counter()
        scan = measure(scene, second=projector, system="fringe")
        ratios.append((time.perf_counter() - started) / trace_s)
    # The first pair compiles the kernels.
    return median(ratios[1:]), scan


def correction(scene: Scene, scan: Scan, repeats: int) -> tuple[float, float]:
    """Medians of the seconds to correct a million points, and of these over a million traced rays.

    The second is the correction of a point over the refracted trace of a ray of one pose.
    """
    seconds, ratios = [], []
    for _ in range(repeats + 1):
        metrics = render_scene(scene).metrics
        a_ray = metrics.time_s["refracted"] / metrics.rays.hit
        started = time.perf_counter()
        correct(scan.points, scene, second=scan.second, system="fringe")
        a_point = (time.perf_counter() - started) / len(scan.points)
        seconds.append(1e6 * a_point)
        ratios.append(a_point / a_ray)
    return median(seconds[1:]), median(ratios[1:])
