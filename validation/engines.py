"""Scenes of one field for both engines, and the differences of their displacements."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyvista as pv
from attrs import evolve
from numpy.typing import NDArray

from iriftrace.camera.camera import Camera
from iriftrace.camera.pose import look_at
from iriftrace.field.index_field import IndexField
from iriftrace.field.tetrahedra import tetrahedra_of
from iriftrace.image.aov_image import AovImage, Status
from iriftrace.part.part import Part
from iriftrace.scene.load import LoadedScene, load_scene
from iriftrace.scene.write import write_scene
from iriftrace.shells.contour import contour_shells

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
