"""Hot air of a formula around a block, whose plume leans in a draught: a family of fields."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv
from attrs import evolve

from iriftrace.camera.pose import look_at
from iriftrace.core.arrays import FloatArray
from iriftrace.core.files import FileOrigin
from iriftrace.io.field import read_field
from iriftrace.io.measured_shift import MeasuredShift
from iriftrace.medium.index_field import IndexField
from iriftrace.part.board import Board
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.tracing.rays import trace_rays
from iriftrace.tracing.scene import Scene
from validation.inputs.cameras import camera_at
from validation.inputs.hot_block import AMBIENT, HALF, block

UPRIGHT = np.array(((1.0, 0, 0, 0), (0, 0, -1.0, 60.0), (0, 1.0, 0, 12.0), (0, 0, 0, 1.0)))
"""The board's frame to the world's: upright, 60 mm behind the block's middle, facing -y."""

ACROSS = np.array(((0, 0, 1.0, -60.0), (1.0, 0, 0, 0), (0, 1.0, 0, 12.0), (0, 0, 0, 1.0)))
"""The same for a board 60 mm beside the block, facing +x."""

BOARD = Board((70.0, 70.0), 1.5)

BOARD_CAMERA = camera_at(
    (0.0, -130.0, 10.0), (0.0, 0.0, 10.0), focal_length_mm=20.0, resolution=(2400, 2000)
)

CAMERA_ACROSS = evolve(
    BOARD_CAMERA,
    resolution=(1200, 1000),
    matrix=look_at((130.0, 0.0, 10.0), (0.0, 0.0, 10.0)),
)

LEEWARD = tuple(
    camera_at(place, (0.0, 0.0, 5.0), focal_length_mm=20.0, resolution=(36, 30))
    for place in ((55.0, -25.0, 70.0), (55.0, 25.0, 70.0))
)


def leaning(lean: float, folder: Path, cells: int = 12, turn_deg: float = 0.0) -> IndexField:
    """Air whose plume drifts by `lean` mm for each mm of height, towards +x or turned from there.

    The layer around the block falls off with the distance to it, and the plume is a Gaussian
    around its axis that grows with the height and ends inside the data.
    """
    grid = _around(cells)
    x, y, z = np.asarray(grid.points).T
    outside = np.maximum(np.abs(np.asarray(grid.points)) - HALF, 0.0)
    distance = np.linalg.norm(outside, axis=1)
    layer = np.exp(-distance / 3.0) * np.maximum(1.0 - distance / 11.0, 0.0)
    height = np.maximum(z - HALF, 0.0)
    radius = 4.0 + 0.05 * height
    turn = np.radians(turn_deg)
    off = (x - lean * np.cos(turn) * height) ** 2 + (y - lean * np.sin(turn) * height) ** 2
    plume = height / (height + 4.0) * np.exp(-off / (2.0 * radius**2))
    plume *= np.maximum(1.0 - (height / 34.0) ** 2, 0.0)
    grid.point_data["T"] = AMBIENT + 700.0 * layer + 450.0 * plume
    file = folder / f"lean_{lean:g}_{turn_deg:g}.vtu"
    grid.save(file)
    return read_field(file)


def hot_block_part() -> Part:
    """The block, mm, world."""
    mesh = block()
    return part_of_mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces), name="block")


def measured_shifts(
    scene: Scene,
    noise_px: float,
    seed: int = 1,
    board: Board = BOARD,
    to_world: FloatArray = UPRIGHT,
) -> MeasuredShift:
    """Shifts of a board's dots in the air of a scene, with noise; hidden dots are left out."""
    dots = board.centres @ to_world[:3, :3].T + to_world[:3, 3]
    cold = scene.camera.project(dots)
    size = np.array(scene.camera.resolution)
    cold = cold[(np.abs(cold - 0.5 * (size - 1)) < 0.48 * size).all(axis=1)]
    hot = cold.copy()
    for _ in range(6):
        hits = trace_rays(scene, *scene.camera.rays(hot))
        hot += cold - scene.camera.project(hits.refracted)
        seen = np.isfinite(hot).all(axis=1)
        cold, hot = cold[seen], hot[seen]
    noise = np.random.default_rng(seed).normal(0.0, noise_px, cold.shape)
    return MeasuredShift(cold, hot - cold + noise, None, FileOrigin("twin", ""))


def _around(cells: int) -> pv.UnstructuredGrid:
    """Hexahedra around the block, 60 x 36 x 60 mm of them, `cells` along its doubled edge."""
    axes = [HALF * np.linspace(-3, end, (end + 3) * cells // 4 + 1) for end in (7, 3, 7)]
    grid = pv.StructuredGrid(*np.meshgrid(*axes, indexing="ij"))
    whole = grid.cast_to_unstructured_grid()
    centres = np.abs(np.asarray(whole.cell_centers().points))
    around = whole.extract_cells(np.flatnonzero((centres > HALF).any(axis=1)))
    bare = pv.UnstructuredGrid()
    bare.copy_structure(around)
    return bare


def along_normal(part: Part, points: FloatArray, face: FloatArray) -> FloatArray:
    """Distances (n,), mm, of points (n, 3) from the planes of faces (n,) of a part."""
    numbers = np.asarray(face, dtype=np.int64)
    heights: FloatArray = np.einsum("ij,ij->i", points, part.face_normals[numbers])
    return heights - part.face_offsets[numbers]
