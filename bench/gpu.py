"""Time and memory of a pose on a CUDA device and on the processor, as a table and a file to send.

``python -m bench.gpu [SCALE ...]``: scales of the bundled cylinder's picture, by default 0.5 and 1.
Writes gpu.json.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import numpy as np
from rich.console import Console
from rich.table import Table

from bench.pose import Pose, kernels_launched
from iriftrace.core.errors import InputError, SetupError
from iriftrace.core.plain import JsonObject
from iriftrace.image.aov_image import AovImage, Status
from iriftrace.tracing.load import load_scene
from scenes.generators.bundled import paper_copied

SCALES = (0.5, 1.0)
REPEATS = 5
VARIANTS = ("cuda_ad_mono", "llvm_ad_mono")
FILE = Path("gpu.json")


def measured(engine: str, scale: float, variant: str) -> tuple[JsonObject, AovImage]:
    """Times, ms, memory and statuses of a first pose and of further ones, and the first picture.

    `compile` is the time of Dr.Jit's code generation and of LLVM or CUDA for the kernels that
    were not compiled before in this process; `wall` includes it in the first pose.
    """
    with TemporaryDirectory() as folder:
        return _measured(paper_copied(Path(folder) / "cylinder"), engine, scale, variant)


def _measured(xml: Path, engine: str, scale: float, variant: str) -> tuple[JsonObject, AovImage]:
    started = time.perf_counter()
    scene = load_scene(xml, {"scale": scale}, engine=engine, variant=variant)
    load = time.perf_counter() - started
    import drjit as dr

    backend = dr.JitBackend.CUDA if variant.startswith("cuda") else dr.JitBackend.LLVM
    dr.detail.malloc_clear_statistics()
    first, kernels = kernels_launched(scene)
    compiled = [one for one in kernels if not one["cache_hit"]]
    moved = first.moved()
    _, further = kernels_launched(scene, moved)
    known = {one["hash"] for one in kernels}
    poses = [Pose.of(scene, moved) for _ in range(REPEATS)]
    status = first.rendering.image.status
    record = {
        "engine": engine,
        "scale": scale,
        "variant": variant,
        "rays_that_hit": first.rendering.metrics.rays.hit,
        "status": {one.key: int((status == one).sum()) for one in Status},
        "load_ms": 1e3 * load,
        "first_pose": {
            "wall_ms": 1e3 * first.seconds,
            "compile_ms": sum(one["codegen_time"] + one["backend_time"] for one in compiled),
            "kernels": len(compiled),
        },
        "second_pose_kernels": sum(one["hash"] not in known for one in further),
        "pose_ms": {
            "wall": 1e3 * median(pose.seconds for pose in poses),
            **{
                stage: 1e3 * median(pose.rendering.metrics.time_s[stage] for pose in poses)
                for stage in ("straight", "refracted", "metrics")
            },
        },
        "peak_memory_bytes": dr.detail.malloc_watermark(backend),
    }
    return record, first.rendering.image


def difference(one: AovImage, other: AovImage) -> JsonObject:
    """Number of pixels whose status differs, and 99.9th percentile of the distance, nm."""
    good = (one.status == 0) & (other.status == 0)
    apart = (one.vector("displacement") - other.vector("displacement"))[good]
    return {
        "statuses": int((one.status != other.status).sum()),
        "p999_nm": 1e6 * float(np.percentile(np.linalg.norm(apart, axis=1), 99.9)),
    }


def device() -> str:
    """Name and driver of the device, as stated by NVIDIA's program."""
    command = ["nvidia-smi", "--query-gpu=name,driver_version", "--format=csv,noheader"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return "unknown CUDA device"
    return done.stdout.splitlines()[0]


def main(scales: Sequence[float]) -> None:
    """Measure, print and write."""
    records = []
    for engine in ("shells", "cells"):
        for scale in scales:
            (cuda, picture), (llvm, known) = (measured(engine, scale, one) for one in VARIANTS)
            records += [cuda | {"against_llvm": difference(picture, known)}, llvm]
    versions = {name: version(name) for name in ("iriftrace", "mitsuba", "drjit")}
    content = {"device": device(), "versions": versions, "poses": records}
    FILE.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    Console(width=110).print(table_of(content))
    print(f"{FILE.absolute()} has all numbers; please send it.")


def table_of(content: JsonObject) -> Table:
    """The main numbers, a row for each engine, scale and variant.

    Time of the first pose and of compiling in it; of the traces and the whole of a later pose;
    kernels that only a second pose has; peak memory; pixels with another status than on the
    processor, and the distance of the hits.
    """
    table = Table(title=f"{content['device']}; ms, median of {REPEATS} poses after two others")
    for heading in (
        *("variant", "engine", "rays", "first", "compile", "straight", "bent", "pose"),
        *("new", "MiB", "status", "nm"),
    ):
        table.add_column(heading, justify="right")
    for one in content["poses"]:
        apart = one.get("against_llvm", {"statuses": "", "p999_nm": None})
        nm = "" if apart["p999_nm"] is None else f"{apart['p999_nm']:.2g}"
        first, later = one["first_pose"], one["pose_ms"]
        table.add_row(
            *(one["variant"].partition("_")[0], one["engine"], f"{one['rays_that_hit']:,}"),
            *(f"{first['wall_ms']:.0f}", f"{first['compile_ms']:.0f}"),
            *(f"{later[name]:.1f}" for name in ("straight", "refracted", "wall")),
            *(str(one["second_pose_kernels"]), f"{one['peak_memory_bytes'] / 2**20:.0f}"),
            *(str(apart["statuses"]), nm),
        )
    return table


if __name__ == "__main__":
    # Kernels on disk from earlier runs would hide the time to compile.
    with tempfile.TemporaryDirectory() as cache:
        os.environ["DRJIT_CACHE_DIR"] = cache
        try:
            main([float(text) for text in sys.argv[1:]] or SCALES)
        except (InputError, SetupError) as error:
            sys.exit(f"error: {error}")
