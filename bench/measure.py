"""Cost of a simulated measurement and of its correction."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from typing import Any
from unittest.mock import patch

import numpy as np
from attrs import evolve

from iriftrace.camera.pose import look_at
from iriftrace.io.ply import write_ply_points
from iriftrace.io.shells import load_shells
from iriftrace.measuring.two_devices import measure as measuring
from iriftrace.measuring.two_devices import two_points
from iriftrace.measuring.two_devices.budget import feature_budget
from iriftrace.measuring.two_devices.correct import correct
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.measuring.two_devices.scan import Scan
from iriftrace.scenes import shells_of
from iriftrace.tracing.hot_air import AirState, HotAir
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


def correction(scene: Scene, scan: Scan, repeats: int) -> tuple[float, float, float]:
    """Medians of the seconds to correct a million points, and of two ratios.

    The first is the correction of a point over the refracted trace of a ray of one pose, the second
    the correction over the tracing in it.
    """
    seconds, ratios, beyond = [], [], []
    for _ in range(repeats + 1):
        metrics = render_scene(scene).metrics
        a_ray = metrics.time_s["refracted"] / metrics.rays.hit
        with timed_traces() as traces_s:
            started = time.perf_counter()
            correct(scan.points, scene, second=scan.second, system="fringe")
            whole = time.perf_counter() - started
        a_point = whole / len(scan.points)
        seconds.append(1e6 * a_point)
        ratios.append(a_point / a_ray)
        beyond.append(whole / sum(traces_s))
    return median(seconds[1:]), median(ratios[1:]), median(beyond[1:])


@contextmanager
def timed_traces() -> Iterator[list[float]]:
    """Collect the seconds of each trace of a measurement or correction inside the block."""
    seconds: list[float] = []

    def timed(trace: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **options: Any) -> Any:
            started = time.perf_counter()
            found = trace(*args, **options)
            seconds.append(time.perf_counter() - started)
            return found

        return call

    with ExitStack() as stack:
        for module, name in ((two_points, "refracted_hits"), (measuring, "traced_as_chosen")):
            stack.enter_context(patch.object(module, name, timed(getattr(module, name))))
        yield seconds


def bytes_a_point(scan: Scan, xml: Path, times: tuple[int, int] = (3, 9)) -> float:
    """Memory of ``iriftrace correct`` for each further point: the difference between two clouds.

    They have so many times the points of a scan, each moved by about 1 um; peaks are those of the
    resident memory of a process. What every run needs is in neither number.
    """
    noise = np.random.default_rng(0)
    peaks = []
    with tempfile.TemporaryDirectory() as folder:
        for count in times:
            points = np.tile(scan.points, (count, 1))
            cloud = Path(folder) / f"{count}.ply"
            write_ply_points(cloud, points + noise.normal(0.0, 1e-3, points.shape), {})
            words = ["correct", str(cloud), str(xml), "-o", f"{folder}/out.vtp", "--no-figures"]
            done = subprocess.run(
                [sys.executable, "-c", PEAK, *words], check=True, capture_output=True, text=True
            )
            peaks.append(1024 * int(done.stdout.splitlines()[-1]))
    return (peaks[1] - peaks[0]) / ((times[1] - times[0]) * len(scan.points))


PEAK = """
import sys
from iriftrace.cli import main
status = main(sys.argv[1:])
print(*[line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM")])
sys.exit(status)
"""
"""A command and its peak of resident memory, kB, on Linux."""


def two_members(scene: Scene) -> Scene:
    """A scene in the air of its shells, and in air that is hotter by 5 % of its contrast."""
    stack = load_shells(shells_of(scene.path.parent.name))
    states = []
    for number, factor in enumerate((1.0, 1.05), start=1):
        shells = tuple(
            evolve(
                each,
                ext=factor * each.ext,
                int_=factor * each.int_,
                refractivity=factor * each.refractivity,
            )
            for each in stack.shells
        )
        source = None if stack.source is None else evolve(stack.source, sha256=f"{number:064d}")
        states.append(
            AirState(None, str(number), ready=evolve(stack, shells=shells, source=source))
        )
    air = HotAir.of_states(states)
    return Scene(
        scene.part, air, scene.camera, scene.second, scene.second_id, engine="shells"
    ).ready


def budget_beyond_traces(scene: Scene, repeats: int) -> float:
    """Median of what a budget takes beyond its traces, over the camera's refracted trace.

    Of the measurement of a two-device scene in the air of two members.
    """
    ensemble, ratios = two_members(scene), []
    for _ in range(repeats + 1):
        trace_s = render_scene(scene).metrics.time_s["refracted"]
        with timed_traces() as traces_s:
            started = time.perf_counter()
            feature_budget(ensemble)
            whole = time.perf_counter() - started
        ratios.append((whole - sum(traces_s)) / trace_s)
    return median(ratios[1:])
