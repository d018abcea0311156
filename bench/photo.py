"""Cost of a photograph relative to a trace of as many rays."""

from __future__ import annotations

import time
from statistics import median

from iriftrace.photo.light import Light
from iriftrace.photo.options import SAMPLES
from iriftrace.photo.photograph import photograph
from iriftrace.tracing.render import render_scene
from iriftrace.tracing.scene import Scene


def photograph_over_trace(scene: Scene, repeats: int) -> float:
    """Median of the time of a fringe sensor's four photographs over that of a picture's two traces.

    That picture has a pixel for each ray of the photographs, which have the same rays.
    """
    fine, ratios = scene.camera.scaled(SAMPLES), []
    for _ in range(repeats + 1):
        started = time.perf_counter()
        photograph(scene, light=Light("fringes"))
        seconds = time.perf_counter() - started
        time_s = render_scene(scene, camera=fine).metrics.time_s
        ratios.append(seconds / (time_s["straight"] + time_s["refracted"]))
    # The first pair compiles the kernels.
    return median(ratios[1:])
