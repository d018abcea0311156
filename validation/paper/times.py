"""Pictures of a study, and the time of each of their stages."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from statistics import median

from bench.queries import Recording
from iriftrace.core.errors import without_warnings
from iriftrace.tracing.render import Rendering, render_scene
from iriftrace.tracing.scene import Scene

STAGES = {
    "load": "making the scene and its acceleration structure",
    "build": "building the tables and finding the layer at the wall",
    "straight": "straight trace",
    "refracted": "refracted trace",
    "search": "intersection search of the refracted trace alone: its queries replayed",
    "refraction": "refracted trace without its search",
    "metrics": "reduction to metrics",
    "write": "writing the EXR",
}

COUNTS = {
    "rays": "rays launched",
    "rays_refracted": "rays that are refracted",
    "triangles": "triangles of all shells",
    "triangles_per_shell": "triangles per shell, mean",
    "process": "number of the process that measured",
}
REPEATS = 5
"""Number of times that each picture is traced after the first, which compiles the kernels.

The fastest counts: other programs on the machine can only make it slower.
"""


def rendered(scene: Scene) -> Rendering:
    """Render a scene without warnings."""
    with without_warnings():
        # A study has odd cases on purpose, and its table has the outcomes of the rays.
        return render_scene(scene, empty=True)


def times(scene: Scene) -> dict[str, float | int]:
    """Fastest time of each of `STAGES`, s, the search's fraction, and `COUNTS`."""
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(REPEATS + 1):
            picture = rendered(scene).saved(Path(folder) / "picture.exr")
            pictures.append(picture.metrics)
    fastest = {
        f"time_{stage}": min(metrics.time_s[stage] or 0.0 for metrics in pictures[1:])
        for stage in ("load", "build", "straight", "metrics", "write")
    }
    recording = Recording(scene.ready)
    pairs = recording.time_pairs(REPEATS)
    fraction = median(pair.queries_s / pair.trace_s for pair in pairs)
    trace = min(pair.trace_s for pair in pairs)
    stack = scene.air.states[0].shells
    return {
        **fastest,
        "time_refracted": trace,
        "time_search": fraction * trace,
        "time_refraction": (1.0 - fraction) * trace,
        "search_share": fraction,
        "rays": pictures[0].rays.launched or 0,
        "rays_refracted": recording.rays,
        "triangles": stack.triangles,
        "triangles_per_shell": stack.triangles // len(stack.shells),
        "process": os.getpid(),
    }
