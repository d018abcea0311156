"""How far shells are from a field: ``python -m benchmarks.real_fields FIELD PART X,Y,Z [...]``.

Any number of camera positions, in mm, from which the origin is looked at. Difference of the hits of
13 shells to those of the continuous engine over the displacement, median by median and p95 by p95;
beside it what the engine's other gradient makes of the same field, constant in each tetrahedron.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from attrs import frozen
from rich.console import Console
from rich.table import Table

from benchmarks.engines import camera_at
from iriftrace.exr import AovImage
from iriftrace.field import read_field
from iriftrace.index_field import IndexField
from iriftrace.part import Part, read_part
from iriftrace.render import render_scene
from iriftrace.scene import load_scene, write_scene
from iriftrace.shells import contour_shells
from iriftrace.status import Status

LAYERS = 13
Position = tuple[float, float, float]


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
    displacement_um: tuple[float, float]
    shells: tuple[float, float]
    constant: tuple[float, float]


def agreements(
    folder: Path, field: IndexField, part: Part, positions: Sequence[Position]
) -> list[Agreement]:
    """Compare shells and field from each position."""
    cameras = [camera_at(position) for position in positions]
    stack = contour_shells(field, LAYERS)
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
    exact, *others = (image.vector("displacement", good) * 1e3 for image in images)
    size = _median_and_p95(exact)
    shells, constant = (
        tuple(100 * off / of for off, of in zip(_median_and_p95(other - exact), size, strict=True))
        for other in others
    )
    return Agreement(int(good.sum()), size, shells, constant)


def _median_and_p95(vectors: np.ndarray) -> tuple[float, float]:
    median, p95 = np.quantile(np.linalg.norm(vectors, axis=1), (0.5, 0.95))
    return float(median), float(p95)


def main() -> None:
    """Measure and print."""
    field, part, *given = sys.argv[1:]
    positions = [tuple(float(x) for x in position.split(",")) for position in given]
    table = Table(title=Path(field).name)
    for title in ("camera / mm", "rays", "median / um", "p95 / um"):
        table.add_column(title, justify="right")
    for title in (f"{LAYERS} shells", "constant gradient"):
        table.add_column(f"{title}:\nmedian / %", justify="right")
        table.add_column("p95 / %", justify="right")
    with tempfile.TemporaryDirectory() as folder:
        found = agreements(Path(folder), read_field(field), read_part(part), positions)
    for position, one in zip(given, found, strict=True):
        sizes = (f"{size:.3g}" for size in one.displacement_um)
        shares = (f"{share:.2f}" for share in (*one.shells, *one.constant))
        table.add_row(position, f"{one.rays:,}", *sizes, *shares)
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
