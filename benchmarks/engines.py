"""Prints how the two engines converge: ``python -m benchmarks.engines [--split] [FIELD PART]``.

Shells with both kinds of normals against the continuous engine with both kinds of gradient, from
four views. Without FIELD and PART the bundled cylinder is used. With ``--split`` the shells are
contoured in the continuous engine's own tetrahedra and not in the solver's cells.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyvista as pv
from attrs import evolve
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from iriftrace.camera.camera import Camera
from iriftrace.camera.pose import look_at
from iriftrace.field.index_field import IndexField
from iriftrace.field.read import read_field
from iriftrace.field.tetrahedra import tetrahedra_of
from iriftrace.image.aov_image import AovImage, Status
from iriftrace.part.part import Part, read_part
from iriftrace.scene.load import LoadedScene, load_scene
from iriftrace.scene.write import write_scene
from iriftrace.scenes import folder_of
from iriftrace.shells.contour import contour_shells
from iriftrace.trace.render import render_scene

LAYERS = (5, 9, 13, 20, 40, 80)
VIEWS = {
    "corner": (150.0, -100.0, 120.0),
    "45 degrees above": (0.0, -160.0, 160.0),
    "along the axis": (235.0, 0.0, 0.0),
    "oblique": (60.0, -190.0, 110.0),
}
NORMALS = ("gradient", "facet")
TRIMMED = 0.99
"""Share of the differences, the smallest ones, that the trimmed rmse is of."""

Key = tuple[int | str, str]
FloatArray = NDArray[np.float64]


def camera_at(origin: tuple[float, float, float]) -> Camera:
    """The paper's camera, at a quarter of its resolution, sharp everywhere."""
    return Camera(
        focal_length_mm=10.0,
        sensor_mm=(6.7, 5.6),
        resolution=(612, 512),
        matrix=look_at(origin, (0.0, 0.0, 0.0)),
    )


def in_tetrahedra(field: IndexField) -> IndexField:
    """The same values in the tetrahedra of the continuous engine."""
    corners = tetrahedra_of(field.grid).corners.astype(np.int64)
    points = np.asarray(field.grid.points)
    return evolve(field, grid=pv.UnstructuredGrid({pv.CellType.TETRA: corners}, points))


def load_all(
    folder: Path, field: IndexField, part: Part, kinds: Sequence[str] = NORMALS
) -> dict[Key, LoadedScene]:
    """Scenes of each number of shells and of the continuous engine, with these normals."""
    scenes: dict[Key, LoadedScene] = {}
    for layers in LAYERS:
        xml = write_scene(
            folder / str(layers),
            part,
            contour_shells(field, layers),
            camera_at(VIEWS["oblique"]),
            paraview=False,
            field=field if layers == LAYERS[0] else None,
        )
        for normals in kinds:
            scenes[layers, normals] = load_scene(xml, {"normals": normals})
            if layers == LAYERS[0]:
                scenes["continuous", normals] = load_scene(
                    xml, {"normals": normals}, engine="continuous"
                )
    return scenes


def differences(images: dict[Key, AovImage]) -> tuple[dict[Key, FloatArray], int]:
    """Displacements (n, 3), um, of the n rays that are good in all images; and how many are not."""
    good = np.all([image.status == Status.GOOD for image in images.values()], axis=0)
    some = np.any([image.status == Status.GOOD for image in images.values()], axis=0)
    return {key: image.vector("displacement", good) * 1e3 for key, image in images.items()}, int(
        some.sum() - good.sum()
    )


def table_of(name: str, images: dict[Key, AovImage]) -> Table:
    """Displacement of each row, and its differences to both continuous solutions."""
    vectors, unmatched = differences(images)
    count = len(vectors["continuous", "gradient"])
    table = Table(title=f"{name}: {count:,} rays, {unmatched} good in some rows only; um")
    for title in ("shells", "normals", "mean", "median", "p95"):
        table.add_column(title, justify="right")
    for limit in ("recovered", "constant"):
        for statistic in ("median", "p95", "trimmed rmse", "order"):
            table.add_column(f"to {limit}\n{statistic}", justify="right")
    previous: dict[str, tuple[int, list[float]]] = {}
    for key in sorted(vectors, key=lambda k: (k[1], str(k[0]).zfill(3))):
        layers, normals = key
        norm = np.linalg.norm(vectors[key], axis=1)
        row = [f"{x:.4f}" for x in (norm.mean(), np.median(norm), np.quantile(norm, 0.95))]
        medians = []
        for limit in NORMALS:
            off = np.sort(np.linalg.norm(vectors[key] - vectors["continuous", limit], axis=1))
            medians.append(float(np.median(off)))
            kept = off[: int(TRIMMED * len(off))]
            row += [f"{np.median(off):.4f}", f"{np.quantile(off, 0.95):.4f}"]
            row += [f"{np.sqrt(np.mean(kept**2)):.4f}"]
            if isinstance(layers, int) and normals in previous:
                fewer, before = previous[normals]
                gain = np.log(before[len(medians) - 1] / medians[-1])
                row.append(f"{gain / np.log(layers / fewer):.2f}")
            else:
                row.append("")
        if isinstance(layers, int):
            previous[normals] = (layers, medians)
        table.add_row(str(layers), normals, *row)
    return table


def main() -> None:
    """Measure and print."""
    cylinder = folder_of("cylinder")
    paths = [Path(argument) for argument in sys.argv[1:] if argument != "--split"]
    field_path, part_path = paths or (cylinder / "field.vtu", cylinder / "part.ply")
    field = read_field(field_path)
    if "--split" in sys.argv:
        field = in_tetrahedra(field)
    console = Console(width=170)
    with tempfile.TemporaryDirectory() as folder:
        scenes = load_all(Path(folder), field, read_part(part_path))
        for name, origin in VIEWS.items():
            images = {
                key: render_scene(scene, camera=camera_at(origin), nearest=False).image
                for key, scene in scenes.items()
            }
            console.print(table_of(name, images))


if __name__ == "__main__":
    main()
