"""Prints the speed ratios of the paper's view of the cylinder and the bounds they should keep."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.table import Table

from bench.measure import budget_beyond_traces, bytes_a_point, correction, measure_over_trace
from bench.photo import photograph_over_trace
from bench.pose import (
    cells_over_shells,
    kernels_of_second_pose,
    pose_in_sweep_over_traces,
    pose_over_trace,
    process_over_trace,
    shares,
)
from bench.queries import trace_over_queries
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from scenes.generators.bundled import paper_copied

REPEATS = 7

FINE_SCALE = 0.588
"""Scale of the camera's picture, at which two devices measure 290,000 points."""


def main() -> None:
    """Measure and print."""
    with TemporaryDirectory() as folder:
        _measure(paper_copied(Path(folder) / "cylinder"))


def _measure(xml: Path) -> None:
    scene = load_scene(xml)
    table = Table(title="Ratios, median of pairs of runs")
    table.add_column("quantity")
    table.add_column("value", justify="right")
    table.add_column("bound", justify="right")
    ratio, rays = trace_over_queries(scene, REPEATS)
    table.add_row(
        f"refracted trace of {rays:,} rays / its ray queries alone", f"{ratio:.2f}", "1.25"
    )
    table.add_row(
        "whole pose without figures / refracted trace",
        f"{pose_over_trace(scene, REPEATS):.2f}",
        "4",
    )
    table.add_row(
        "pose of a sweep (all metrics, no files) / straight and refracted trace",
        f"{pose_in_sweep_over_traces(scene, REPEATS):.2f}",
        "1.5",
    )
    if find_spec("embreex") is None:
        table.add_row("a loop with trimesh and Embree: pip install -e '.\\[peers]'", "", "")
    else:
        from bench.peers import peer_over_trace

        ratio, rays = peer_over_trace(load_scene(xml, {"bending": "shells"}), REPEATS)
        table.add_row(
            f"{rays:,} rays by a loop with trimesh, Embree and NumPy / the trace at the shells",
            f"{ratio:.2f}",
            "",
        )
    fine = load_scene(xml, {"scale": FINE_SCALE})
    ratio, scan = measure_over_trace(fine, REPEATS)
    table.add_row(
        f"measurement of {len(scan.points):,} points / refracted trace of its camera",
        f"{ratio:.2f}",
        "4",
    )
    seconds, over_trace, over_own = correction(fine, scan, REPEATS)
    table.add_row("correction of a point / refracted trace of a ray", f"{over_trace:.2f}", "")
    table.add_row("correction / its tracing", f"{over_own:.2f}", "2")
    table.add_row("seconds to correct a million points", f"{seconds:.1f}", "10")
    two = load_scene(folder_of("fringe_cylinder") / "scene.xml")
    memory = bytes_a_point(measure(two), two.path)
    table.add_row("bytes of `iriftrace correct` a further point", f"{memory:.0f}", "150")
    table.add_row(
        "budget of two members without its traces / refracted trace",
        f"{budget_beyond_traces(two, REPEATS):.1f}",
        "8",
    )
    table.add_row(
        "photographs of a fringe sensor / straight and refracted trace of as many rays",
        f"{photograph_over_trace(two, REPEATS):.1f}",
        "6",
    )
    cells = load_scene(xml, engine="cells")
    traces, poses = cells_over_shells(cells, scene, REPEATS)
    table.add_row("refracted trace by the cells engine / by 13 shells", f"{traces:.2f}", "")
    table.add_row("pose by the cells engine / by 13 shells", f"{poses:.2f}", "")
    table.add_row(
        "`iriftrace render` as a process, compiled kernels on disk / warm refracted trace",
        f"{process_over_trace(scene, REPEATS):.1f}",
        "",
    )
    for engine in ("shells", "cells"):
        kernels = kernels_of_second_pose(load_scene(xml, engine=engine))
        table.add_row(f"kernels of a second pose alone, {engine}", str(kernels), "0")
    for stage, share in shares(scene).items():
        table.add_row(f"  {stage} / refracted trace", f"{share:.2f}", "")
    Console().print(table)


if __name__ == "__main__":
    main()
