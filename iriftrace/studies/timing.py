"""Times of each stage of a picture."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from statistics import median

from iriftrace.scene.load import LoadedScene
from iriftrace.studies.picture import rendered
from iriftrace.trace.query_replay import Recording

STAGES = {
    "load": "reading the scene and building the acceleration structure",
    "build": "building the tables and finding the layer at the wall",
    "straight": "straight trace",
    "refracted": "refracted trace",
    "search": "intersection search of the refracted trace alone: its queries replayed",
    "refraction": "what the refracted trace takes beside its search",
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
"""Times each picture is traced after the first, which compiles the kernels.

The fastest counts: other programs on the machine can only make it slower.
"""


def times(scene: LoadedScene) -> dict[str, float | int]:
    """Fastest time of each of `STAGES`, s, the search's share, rays and the process."""
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(REPEATS + 1):
            picture = rendered(scene)
            picture.save(Path(folder) / "picture.exr")
            pictures.append(picture.metrics)
    fastest = {
        f"time_{stage}": min(metrics.time_s[stage] or 0.0 for metrics in pictures[1:])
        for stage in ("load", "build", "straight", "metrics", "write")
    }
    recording = Recording(scene)
    pairs = recording.time_pairs(REPEATS)
    share = median(pair.queries_s / pair.trace_s for pair in pairs)
    trace = min(pair.trace_s for pair in pairs)
    return {
        **fastest,
        "time_refracted": trace,
        "time_search": share * trace,
        "time_refraction": (1.0 - share) * trace,
        "search_share": share,
        "rays": pictures[0].rays.launched or 0,
        "rays_refracted": recording.rays,
        "process": os.getpid(),
    }
