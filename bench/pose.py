"""Cost of a whole pose relative to its refracted trace, and kernels compiled by a second one."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

from attrs import frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.plain import JsonObject
from iriftrace.tracing.render import Rendering, render_scene
from iriftrace.tracing.scene import Scene


def pose_over_trace(scene: Scene, repeats: int) -> float:
    """Median of the time of render and files, without figures, over the refracted trace's."""
    ratios = []
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(repeats + 1):
            started = time.perf_counter()
            rendering = render_scene(scene)
            rendering.save(Path(folder) / "pose.exr")
            seconds = time.perf_counter() - started
            ratios.append(seconds / rendering.metrics.time_s["refracted"])
    # The first pose compiles the kernels.
    return median(ratios[1:])


def pose_in_sweep_over_traces(scene: Scene, repeats: int) -> float:
    """Median of the time of a pose without files over its two traces'."""
    ratios = []
    for _ in range(repeats + 1):
        started = time.perf_counter()
        rendering = render_scene(scene)
        seconds = time.perf_counter() - started
        time_s = rendering.metrics.time_s
        ratios.append(seconds / (time_s["straight"] + time_s["refracted"]))
    # The first pose compiles the kernels.
    return median(ratios[1:])


def cells_over_shells(cells: Scene, shells: Scene, repeats: int) -> tuple[float, float]:
    """Time by the cells engine over that by shells: of refracted traces, and of poses.

    Medians of pairs.
    """
    ratios = []
    for _ in range(repeats + 1):
        seconds = []
        for scene in (cells, shells):
            started = time.perf_counter()
            traced = render_scene(scene).metrics.time_s["refracted"]
            seconds.append((traced, time.perf_counter() - started))
        ratios.append([one / other for one, other in zip(*seconds, strict=True)])
    # The first pair compiles the kernels.
    traces, poses = zip(*ratios[1:], strict=True)
    return median(traces), median(poses)


def process_over_trace(scene: Scene, repeats: int) -> float:
    """Median of the time of ``iriftrace render`` without figures over a warm refracted trace's.

    Kernels are compiled and on disk.
    """
    render_scene(scene)
    ratios = []
    with tempfile.TemporaryDirectory() as folder:
        name = str(Path(folder) / "pose.exr")
        command = [sys.executable, "-m", "iriftrace", "render", str(scene.path), "-o", name]
        for _ in range(repeats + 1):
            started = time.perf_counter()
            subprocess.run([*command, "--no-figures"], check=True, capture_output=True)
            seconds = time.perf_counter() - started
            ratios.append(seconds / render_scene(scene).metrics.time_s["refracted"])
    return median(ratios[1:])


def shares(scene: Scene) -> dict[str, float]:
    """Time of each stage of one pose over the refracted trace's."""
    with tempfile.TemporaryDirectory() as folder:
        rendering = render_scene(scene).saved(Path(folder) / "pose.exr")
    time_s = rendering.metrics.time_s
    stages = ("straight", "refracted", "metrics", "write")
    return {stage: time_s[stage] / time_s["refracted"] for stage in stages}


@frozen(eq=False)
class Pose:
    """A rendered pose and its time without loading and files, s."""

    rendering: Rendering
    seconds: float

    @classmethod
    def of(cls, scene: Scene, camera: Camera | None = None) -> Pose:
        """Render a scene, from its own camera by default."""
        started = time.perf_counter()
        rendering = render_scene(scene, camera=camera)
        return cls(rendering, time.perf_counter() - started)

    def moved(self) -> Camera:
        """The pose's camera, some millimetres away."""
        camera = self.rendering.image.camera
        matrix = camera.matrix.copy()
        matrix[:3, 3] += (3.0, -2.0, 5.0)
        return camera.at(matrix)


def kernels_launched(scene: Scene, camera: Camera | None = None) -> tuple[Pose, list[JsonObject]]:
    """A pose, and Dr.Jit's records of the kernels that it launches."""
    import drjit as dr

    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        pose = Pose.of(scene, camera)
        history = dr.kernel_history()
    return pose, [one for one in history if one["type"] == dr.KernelType.JIT]


def kernels_of_second_pose(scene: Scene) -> int:
    """Kernels of a second pose that the first one of a scene just loaded has not launched.

    They would be compiled if they were not on disk from an earlier run.
    """
    first, kernels = kernels_launched(scene)
    _, others = kernels_launched(scene, first.moved())
    known = {one["hash"] for one in kernels}
    return sum(one["hash"] not in known for one in others)
