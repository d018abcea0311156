"""Time of a trace over rays, triangles and cells: docs/scaling.png.

Synthetic air around the bundled cylinder on meshes of different cell sizes, traced both ways; and
the memory and time in which large inputs become a scene.
"""

from __future__ import annotations

import tempfile
import warnings
from pathlib import Path
from statistics import median

import numpy as np
from attrs import frozen
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from rich.console import Console
from rich.table import Table

from bench.size import sizes
from iriftrace.core.errors import IriftraceWarning
from iriftrace.figures.style import COLOURS, write_figure
from iriftrace.flow.synthetic.field import synthetic_field
from iriftrace.flow.synthetic.mesh import usual_mesh
from iriftrace.flow.synthetic.model import SyntheticAir
from iriftrace.io.part_files import read_part
from iriftrace.scenes import folder_of
from iriftrace.tracing.hot_air import HotAir
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.render import render_scene
from iriftrace.tracing.scene import Scene

CELLS_MM = (4.0, 2.5, 1.6, 1.0)
"""Edges of the cells at the wall, mm."""

SCALES = (0.0625, 0.125, 0.25, 0.5, 1.0)
"""Scales of the picture, with the second of the meshes."""

REPEATS = 5
PICTURE = Path(__file__).parents[1] / "docs/scaling.png"


@frozen
class Cost:
    """Time of a warm refracted trace."""

    cell_mm: float
    cells: int
    triangles: int
    rays: int
    engine: str
    seconds: float


def measured(folder: Path) -> list[Cost]:
    """Costs over the scales with one mesh, and over the meshes at a quarter of the resolution."""
    bundled = folder_of("cylinder")
    part = read_part(bundled / "part.ply")
    camera = load_scene(folder_of("cylinder_paper") / "scene.xml", {"scale": 1}).camera
    air = SyntheticAir(part)
    costs = []
    for cell_mm in CELLS_MM:
        field = synthetic_field(air, usual_mesh(air, cell_mm=cell_mm))
        saved = Scene(part, HotAir(field), camera).save(folder / f"{cell_mm:g}" / "scene.xml")
        triangles = sum(len(shell.faces) for shell in saved.shells.shells)
        for scale in SCALES if cell_mm == CELLS_MM[1] else (0.25,):
            for engine in ("shells", "cells"):
                scene = load_scene(saved.path, {"scale": scale}, engine=engine)
                poses = [render_scene(scene) for _ in range(REPEATS + 1)]
                seconds = median(pose.metrics.time_s["refracted"] for pose in poses[1:])
                rays = poses[0].metrics.rays.hit
                costs.append(Cost(cell_mm, field.grid.n_cells, triangles, rays, engine, seconds))
    return costs


def figure(costs: list[Cost]) -> Figure:
    """Microseconds per ray over rays and over cells."""
    drawn = Figure(figsize=(7.2, 2.8), layout="constrained")
    over_rays, over_cells = drawn.subplots(1, 2, sharey=True)
    for engine, colour in zip(("shells", "cells"), COLOURS, strict=False):
        own = [cost for cost in costs if cost.engine == engine]
        for axes, rows, name in (
            (over_rays, [c for c in own if c.cell_mm == CELLS_MM[1]], "rays"),
            (over_cells, [c for c in own if c in quarter(own)], "cells"),
        ):
            x = [getattr(cost, name) for cost in rows]
            y = [1e6 * cost.seconds / cost.rays for cost in rows]
            axes.semilogx(x, y, "o-", color=colour, label=engine)
            axes.set_xlabel(name)
            axes.xaxis.set_minor_formatter(NullFormatter())
            axes.grid(alpha=0.3)
    over_cells.set_xlim(5e4, 2e6)
    over_rays.set_ylim(0, None)
    over_rays.set_ylabel("refracted trace, µs a ray")
    over_rays.legend(frameon=False)
    return drawn


def quarter(costs: list[Cost]) -> list[Cost]:
    """Those at a quarter of the resolution, which all meshes have."""
    rays = {cost.rays for cost in costs if cost.cell_mm != CELLS_MM[1]}
    return [cost for cost in costs if cost.rays in rays]


def exponent(x: list[int], y: list[float]) -> float:
    """Slope of the straight line through the logarithms."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def main() -> None:
    """Measure, print and draw."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", IriftraceWarning)
        costs = measured(Path(folder))
        large = sizes(Path(folder))
    table = Table(title=f"Refracted traces, median of {REPEATS}")
    for heading in ("engine", "cells", "triangles", "rays", "seconds", "ns a ray"):
        table.add_column(heading, justify="right")
    for cost in sorted(costs, key=lambda one: (one.engine, one.cells, one.rays)):
        table.add_row(
            *(cost.engine, f"{cost.cells:,}", f"{cost.triangles:,}", f"{cost.rays:,}"),
            *(f"{cost.seconds:.3f}", f"{1e9 * cost.seconds / cost.rays:.0f}"),
        )
    console = Console(width=100)
    console.print(table)
    for engine in ("shells", "cells"):
        own = [cost for cost in costs if cost.engine == engine]
        rows = [cost for cost in own if cost.cell_mm == CELLS_MM[1]]
        meshes = quarter(own)
        of_rays = exponent([c.rays for c in rows], [c.seconds for c in rows])
        of_cells = exponent([c.cells for c in meshes], [c.seconds / c.rays for c in meshes])
        console.print(f"{engine}: time ~ rays^{of_rays:.2f}, a ray ~ cells^{of_cells:.2f}")
    table = Table(title="Large inputs becoming a scene")
    for heading in ("input", "count", "bytes each at peak", "seconds a million"):
        table.add_column(heading, justify="right")
    for size in large:
        row = f"{size.count:,}", f"{size.peak_bytes:,.0f}", f"{size.seconds:.1f}"
        table.add_row(size.name, *row)
    console.print(table)
    write_figure(figure(costs), PICTURE)


if __name__ == "__main__":
    main()
