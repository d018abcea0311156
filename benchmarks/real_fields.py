"""Prints how far shells are from the field: ``python -m benchmarks.real_fields FIELD PART X,Y,Z``.

Any number of camera positions, in mm, from which the origin is looked at. Difference of the hits of
13 shells to those of the continuous engine over the displacement, median by median and p95 by p95;
beside it what the engine's other gradient makes of the same field, constant in each tetrahedron.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.engines import camera_at
from iriftrace.exr import AovImage
from iriftrace.field import read_field
from iriftrace.part import read_part
from iriftrace.render import render_scene
from iriftrace.scene import load_scene, write_scene
from iriftrace.shells import contour_shells
from iriftrace.status import Status

LAYERS = 13
FIELD = "recovered gradient"
CELLS = "constant gradient"


def pictures(
    field_path: Path, part_path: Path, origins: list[tuple[float, float, float]]
) -> list[dict[str, AovImage]]:
    """From each position, the pictures of the shells and of the field with either gradient."""
    field, part = read_field(field_path), read_part(part_path)
    cameras = [camera_at(origin) for origin in origins]
    with tempfile.TemporaryDirectory() as folder:
        stack = contour_shells(field, LAYERS)
        xml = write_scene(folder, part, stack, cameras[0], paraview=False, field=field)
        scenes = {
            "shells": load_scene(xml),
            FIELD: load_scene(xml, {"normals": "gradient"}, engine="continuous"),
            CELLS: load_scene(xml, {"normals": "facet"}, engine="continuous"),
        }
        return [
            {
                name: render_scene(scene, camera=camera, nearest=False).image
                for name, scene in scenes.items()
            }
            for camera in cameras
        ]


def row_of(images: dict[str, AovImage]) -> list[str]:
    """Rays, displacement in um, and the differences of the shells and of the other gradient."""
    good = np.all([image.status == Status.GOOD for image in images.values()], axis=0)
    vectors = {name: image.vector("displacement", good) * 1e3 for name, image in images.items()}
    size = np.quantile(np.linalg.norm(vectors[FIELD], axis=1), (0.5, 0.95))
    row = [f"{good.sum():,}", *(f"{value:.3g}" for value in size)]
    for name in ("shells", CELLS):
        off = np.linalg.norm(vectors[name] - vectors[FIELD], axis=1)
        row += [f"{share:.2f}" for share in 100 * np.quantile(off, (0.5, 0.95)) / size]
    return row


def main() -> None:
    """Measure and print."""
    field, part, *positions = sys.argv[1:]
    origins = [tuple(float(x) for x in position.split(",")) for position in positions]
    table = Table(title=Path(field).name)
    for title in ("camera / mm", "rays", "median / um", "p95 / um"):
        table.add_column(title, justify="right")
    for title in (f"{LAYERS} shells", CELLS):
        table.add_column(f"{title}:\nmedian / %", justify="right")
        table.add_column("p95 / %", justify="right")
    for position, images in zip(positions, pictures(Path(field), Path(part), origins), strict=True):
        table.add_row(position, *row_of(images))
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
