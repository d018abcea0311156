"""Time of a pose on a CUDA device and on the processor, as one table to send in.

``python -m bench.gpu [SCALE ...]``: scales of the bundled cylinder's picture, by default 0.5 and 1.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from importlib.metadata import version
from statistics import median

import numpy as np
from rich.console import Console
from rich.table import Table

from iriftrace.core.errors import InputError, SetupError
from iriftrace.image.aov_image import AovImage
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.render import Rendering, render_scene

SCALES = (0.5, 1.0)
REPEATS = 5
VARIANTS = ("cuda_ad_mono", "llvm_ad_mono")


def timed(engine: str, scale: float, variant: str) -> tuple[dict[str, float], Rendering]:
    """Median times of warm poses, ms, that of the first one, and its rendering."""
    xml = folder_of("cylinder") / "scene.xml"
    scene = load_scene(xml, {"scale": scale}, engine=engine, variant=variant)
    poses = [render_scene(scene) for _ in range(REPEATS + 1)]
    traces = [pose.metrics.time_s["straight"] + pose.metrics.time_s["refracted"] for pose in poses]
    wholes = [
        trace + pose.metrics.time_s["metrics"] for trace, pose in zip(traces, poses, strict=True)
    ]
    times = {"first": traces[0], "trace": median(traces[1:]), "pose": median(wholes[1:])}
    return {name: 1e3 * seconds for name, seconds in times.items()}, poses[0]


def difference(one: AovImage, other: AovImage) -> tuple[int, float]:
    """Number of pixels whose status differs, and 99.9th percentile of the distance, nm."""
    good = (one.status == 0) & (other.status == 0)
    apart = (one.vector("displacement") - other.vector("displacement"))[good]
    differ = int((one.status != other.status).sum())
    return differ, 1e6 * float(np.percentile(np.linalg.norm(apart, axis=1), 99.9))


def device() -> str:
    """Name and driver of the device, as stated by NVIDIA's program."""
    command = ["nvidia-smi", "--query-gpu=name,driver_version", "--format=csv,noheader"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return "unknown CUDA device"
    return done.stdout.splitlines()[0]


def main(scales: Sequence[float]) -> None:
    """Measure and print."""
    versions = ", ".join(f"{name} {version(name)}" for name in ("iriftrace", "mitsuba", "drjit"))
    table = Table(title=f"{device()}; {versions}; ms, median of {REPEATS} warm poses")
    for heading in (
        *("engine", "rays", "first trace", "trace", "with metrics", "LLVM trace"),
        *("other statuses", "nm apart"),
    ):
        table.add_column(heading, justify="right")
    for engine in ("shells", "cells"):
        for scale in scales:
            (cuda, pose), (llvm, known) = (timed(engine, scale, one) for one in VARIANTS)
            differ, apart = difference(pose.image, known.image)
            table.add_row(
                *(engine, f"{pose.metrics.rays.hit:,}"),
                *(f"{cuda[name]:.1f}" for name in ("first", "trace", "pose")),
                *(f"{llvm['trace']:.1f}", str(differ), f"{apart:.2g}"),
            )
    Console(width=110).print(table)


if __name__ == "__main__":
    try:
        main([float(text) for text in sys.argv[1:]] or SCALES)
    except (InputError, SetupError) as error:
        sys.exit(f"error: {error}")
