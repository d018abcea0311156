"""What thinning out shells changes: ``python -m benchmarks.thinning SCENE FIELD``.

SCENE is the name of a component's scene and FIELD the flow solution it is made from. Displacements
of the rays that are good with all triangles and with the scene's number of them.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from attrs import evolve
from rich.console import Console
from rich.table import Table

from iriftrace.camera.pose import look_at
from iriftrace.image.aov_image import AovImage, Status
from iriftrace.scene.load import load_scene
from iriftrace.scene.write import write_scene
from iriftrace.scenes.components import COMPONENTS, SCALE, shells_around
from iriftrace.shells.decimate import decimate
from iriftrace.trace.render import render_scene

VIEWS = {
    "from above": (1e-3, 0.0, 300.0),
    "from below": (1e-3, 0.0, -250.0),
    "along x": (280.0, 0.0, 0.0),
    "along y": (0.0, -280.0, 0.0),
    "oblique": (60.0, -190.0, 110.0),
    "oblique, from below": (100.0, -150.0, -100.0),
}


def row_of(name: str, one: AovImage, other: AovImage) -> list[str]:
    """Median, mean and 95th percentile before and after, and of the rays' differences, um."""
    both = (one.status == Status.GOOD) & (other.status == Status.GOOD)
    before, after = (image.vector("displacement", both) * 1e3 for image in (one, other))
    columns = [f"{np.count_nonzero(both):,}"]
    sizes = [np.linalg.norm(vectors, axis=1) for vectors in (before, after)]
    for statistic in (np.median, np.mean, lambda values: np.quantile(values, 0.95)):
        columns.append(" to ".join(f"{statistic(size):.3g}" for size in sizes))
    off = np.linalg.norm(after - before, axis=1)
    return [name, *columns, f"{np.median(off):.3g}", f"{np.quantile(off, 0.95):.3g}"]


def main() -> None:
    """Measure and print."""
    name, field = sys.argv[1], Path(sys.argv[2])
    component = COMPONENTS[name]
    part, whole = component.part(), shells_around(name, field)
    thin = decimate(whole, component.triangles)
    camera = evolve(component.camera(), focus_mm=(1.0, 1000.0))
    table = Table(title=f"{name}: {whole.triangles:,} to {thin.triangles:,} triangles; um")
    for title in ("view", "rays", "median", "mean", "p95", "difference, median", "p95"):
        table.add_column(title, justify="left" if title == "view" else "right")
    with tempfile.TemporaryDirectory() as folder:
        scenes = [
            load_scene(write_scene(Path(folder) / kind, part, stack, camera, paraview=False))
            for kind, stack in (("whole", whole), ("thin", thin))
        ]
        for view, origin in {"the scene's own": component.origin_mm, **VIEWS}.items():
            posed = camera.scaled(SCALE).at(look_at(origin, (0.0, 0.0, 0.0)))
            images = [render_scene(scene, camera=posed, nearest=False).image for scene in scenes]
            table.add_row(*row_of(view, *images))
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
