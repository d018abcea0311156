"""How far shells are from a field: ``python -m benchmarks.real_fields FIELD PART X,Y,Z [...]``.

FIELD PART may also be a bundled component alone (hybrid_cylinder, bevel_gear, wishbone), whose air
the tree keeps. Any number of camera positions, in mm, from which the origin is looked at.
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
from attrs import frozen
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.component_fields import SOLVED, component_field
from benchmarks.engines import camera_at
from iriftrace.exr import AovImage
from iriftrace.field import read_field
from iriftrace.index_field import IndexField
from iriftrace.part import Part, read_part
from iriftrace.render import render_scene
from iriftrace.scene import load_scene, write_scene
from iriftrace.scenes import folder_of
from iriftrace.shell_levels import RULES
from iriftrace.shell_stack import ShellStack
from iriftrace.shells import contour_shells
from iriftrace.status import Status

Position = tuple[float, float, float]
Pair = tuple[float, float]


@frozen
class Agreement:
    """Shells and field, seen from one position; pairs are median and 95th percentile.

    Attributes
    ----------
    rays : int
        That are good in all pictures.
    displacement_um : (2,) float, um
        By the continuous engine with the recovered gradient.
    shells : (2,) float, per cent
        Difference of the shells over it.
    constant : (2,) float, per cent
        Difference of the engine with the gradient that is constant in each tetrahedron.
    """

    rays: int
    displacement_um: Pair
    shells: Pair
    constant: Pair


def agreements(
    folder: Path, field: IndexField, part: Part, stack: ShellStack, positions: Sequence[Position]
) -> list[Agreement]:
    """Compare shells and field from each position."""
    cameras = [camera_at(position) for position in positions]
    xml = write_scene(folder, part, stack, cameras[0], paraview=False, field=field)
    scenes = [
        load_scene(xml, {"normals": "gradient"}, engine="continuous"),
        load_scene(xml),
        load_scene(xml, {"normals": "facet"}, engine="continuous"),
    ]
    return [
        _agreement([render_scene(one, camera=camera, nearest=False).image for one in scenes])
        for camera in cameras
    ]


def _agreement(images: Sequence[AovImage]) -> Agreement:
    good = np.all([image.status == Status.GOOD for image in images], axis=0)
    exact, shells, constant = (image.vector("displacement", good) * 1e3 for image in images)
    size = _median_and_p95(exact)
    return Agreement(
        int(good.sum()), size, _share(shells - exact, size), _share(constant - exact, size)
    )


def _share(off: NDArray[np.float64], size: Pair) -> Pair:
    median, p95 = _median_and_p95(off)
    return 100 * median / size[0], 100 * p95 / size[1]


def _median_and_p95(vectors: NDArray[np.float64]) -> Pair:
    median, p95 = np.quantile(np.linalg.norm(vectors, axis=1), (0.5, 0.95))
    return float(median), float(p95)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("field")
    parser.add_argument("words", nargs="+", metavar="[PART] X,Y,Z")
    parser.add_argument("--layers", type=int, default=13)
    parser.add_argument("--rule", choices=RULES, default=RULES[0])
    given = parser.parse_args()
    part_path = folder_of(given.field) / "part.ply" if given.field in SOLVED else given.words.pop(0)
    positions = [tuple(float(x) for x in position.split(",")) for position in given.words]
    table = Table(title=Path(given.field).name)
    for title in ("camera / mm", "rays", "median / um", "p95 / um"):
        table.add_column(title, justify="right")
    for title in (f"{given.layers} shells", "constant gradient"):
        table.add_column(f"{title}:\nmedian / %", justify="right")
        table.add_column("p95 / %", justify="right")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        known = given.field in SOLVED
        field = component_field(given.field, folder) if known else read_field(given.field)
        part = read_part(part_path)
        stack = contour_shells(field, given.layers, rule=given.rule)
        found = agreements(folder / "scene", field, part, stack, positions)
    for position, one in zip(given.words, found, strict=True):
        sizes = (f"{size:.3g}" for size in one.displacement_um)
        shares = (f"{share:.2f}" for share in (*one.shells, *one.constant))
        table.add_row(position, f"{one.rays:,}", *sizes, *shares)
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
