"""How far shells are from a field: ``python -m benchmarks.real_fields FIELD PART X,Y,Z [...]``.

FIELD PART may also be a field alone that the tree keeps (`benchmarks.solved_fields`: wishbone,
cylinder_B ...). Any number of camera positions, in mm, from which the origin is looked at.
Difference of the hits of the shells to those of the continuous engine over the displacement, median
by median and p95 by p95; beside it what the engine's other gradient makes of the same field,
constant in each tetrahedron.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.accuracy.agreement import share
from benchmarks.engines import camera_at
from benchmarks.solved_fields import SOLVED
from iriftrace.field.index_field import IndexField
from iriftrace.field.read import read_field
from iriftrace.image.aov_image import AovImage, Status
from iriftrace.part.part import Part, read_part
from iriftrace.scene.load import load_scene
from iriftrace.scene.write import write_scene
from iriftrace.shells.contour import contour_shells
from iriftrace.shells.levels import RULES
from iriftrace.shells.stack import ShellStack
from iriftrace.trace.render import render_scene

Position = tuple[float, float, float]


def rows(
    folder: Path, field: IndexField, part: Part, stack: ShellStack, positions: Sequence[Position]
) -> list[list[str]]:
    """For each position rays, displacement (um) and differences (per cent), as printed."""
    cameras = [camera_at(position) for position in positions]
    xml = write_scene(folder, part, stack, cameras[0], paraview=False, field=field)
    scenes = [
        load_scene(xml, {"normals": "gradient"}, engine="continuous"),
        load_scene(xml),
        load_scene(xml, {"normals": "facet"}, engine="continuous"),
    ]
    return [
        _row([render_scene(one, camera=camera, nearest=False).image for one in scenes])
        for camera in cameras
    ]


def _row(images: Sequence[AovImage]) -> list[str]:
    good = np.all([image.status == Status.GOOD for image in images], axis=0)
    exact, *others = (image.vector("displacement", good) * 1e3 for image in images)
    norm = np.linalg.norm(exact, axis=1)
    row = [f"{good.sum():,}", *(f"{um:.3g}" for um in np.quantile(norm, (0.5, 0.95)))]
    for other in others:
        median, p95, _ = share(np.linalg.norm(other - exact, axis=1), norm)
        row += [f"{median:.2f}", f"{p95:.2f}"]
    return row


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("field")
    parser.add_argument("words", nargs="+", metavar="[PART] X,Y,Z")
    parser.add_argument("--layers", type=int, default=13)
    parser.add_argument("--rule", choices=RULES, default=RULES[0])
    given = parser.parse_args()
    solved = SOLVED.get(given.field)
    part = solved.part if solved else read_part(given.words.pop(0))
    positions = [tuple(float(x) for x in position.split(",")) for position in given.words]
    table = Table(title=Path(given.field).name)
    for title in ("camera / mm", "rays", "median / um", "p95 / um"):
        table.add_column(title, justify="right")
    for title in (f"{given.layers} shells", "constant gradient"):
        table.add_column(f"{title}:\nmedian / %", justify="right")
        table.add_column("p95 / %", justify="right")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        field = solved.field(folder) if solved else read_field(given.field)
        stack = contour_shells(field, given.layers, rule=given.rule)
        found = rows(folder / "scene", field, part, stack, positions)
    for position, row in zip(given.words, found, strict=True):
        table.add_row(position, *row)
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
