"""The cells engine in hot air whose rays are known: the slab and the hot cylinder.

As formulas, in steps of one length, and on cells fine enough to leave half a per cent at most.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
import trimesh
from numpy.typing import NDArray

from iriftrace.medium.index_field import IndexField
from iriftrace.medium.path_data import cells_of
from iriftrace.medium.shells.stack import ShellStack
from iriftrace.part.part import Part
from iriftrace.plugins.kernels.tetrahedra import TetrahedralAir
from iriftrace.scenes.analytic import CYLINDER_RADIUS_MM, HOT_AIR_RADIUS_MM, SLAB_MM, WALL_K
from iriftrace.scenes.closed_forms import above, around
from iriftrace.scenes.qualification import cylinder_cells, cylinder_rays, slab_cells, slab_rays
from iriftrace.tracing.hot_air import AirState
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.scene import Scene
from iriftrace.tracing.write import write_scene
from validation.inputs.scene_rays import ANY_CAMERA
from validation.inputs.shell_fields import field_of
from validation.inputs.small_scenes import part
from validation.inputs.smooth_medium import Ends, SmoothMedium, follow
from validation.oracles.exact_layers import RoundAir

FloatArray = NDArray[np.float64]

STEP_MM = 0.02
AIR = RoundAir()
AMBIENT_K, REFRACTIVITY = float(AIR.temperature_k), AIR.ambient_refractivity


def cylinder_air(point: Any) -> tuple[Any, Any]:
    """n - 1 and its gradient: temperature linear in ln r from the wall to 60 mm, n - 1 as 1 / T."""
    import drjit as dr
    import mitsuba as mi

    squared = point.y * point.y + point.z * point.z
    slope = -(WALL_K - AMBIENT_K) / math.log(HOT_AIR_RADIUS_MM / CYLINDER_RADIUS_MM)
    warm = squared < HOT_AIR_RADIUS_MM**2
    temperature = WALL_K + slope * dr.log(squared / CYLINDER_RADIUS_MM**2) / 2
    temperature = dr.select(warm, temperature, AMBIENT_K)
    refractivity = REFRACTIVITY * AMBIENT_K / temperature
    steep = dr.select(warm, -refractivity / temperature * slope / squared, 0)
    return refractivity, mi.Vector3d(0 * steep, steep * point.y, steep * point.z)


def to_the_cylinders_edge(point: Any, direction: Any) -> Any:
    """Distance along rays to where the hot air begins."""
    import drjit as dr

    squared = direction.y**2 + direction.z**2
    along = point.y * direction.y + point.z * direction.z
    outside = point.y**2 + point.z**2 - HOT_AIR_RADIUS_MM**2
    return (-along - dr.sqrt(dr.maximum(along**2 - squared * outside, 0))) / squared


def cylinder_grid(layers: int = 100, around: int = 400) -> pv.UnstructuredGrid:
    """Tetrahedra of the side that the rays come from: 100 degrees."""
    return cylinder_cells(layers, np.linspace(85, 185, around + 1), (-0.5, 0.5)).triangulate()


def cylinder_values(points: FloatArray) -> FloatArray:
    """The same n - 1 at the corners of cells."""
    return around(np.hypot(points[:, 1], points[:, 2]))


def slab_air(point: Any) -> tuple[Any, Any]:
    """n - 1 and its gradient: temperature linear in z between the plate at 0 and 20 mm above."""
    import drjit as dr
    import mitsuba as mi

    slope = (AMBIENT_K - WALL_K) / SLAB_MM
    warm = point.z < SLAB_MM
    temperature = dr.select(warm, WALL_K + slope * point.z, AMBIENT_K)
    refractivity = REFRACTIVITY * AMBIENT_K / temperature
    steep = dr.select(warm, -refractivity / temperature * slope, 0)
    return refractivity, mi.Vector3d(0 * steep, 0 * steep, steep)


def to_the_slabs_top(point: Any, direction: Any) -> Any:
    """Distance along rays to where the hot air begins."""
    return (SLAB_MM - point.z) / direction.z


def slab_grid() -> pv.UnstructuredGrid:
    """Tetrahedra in 80 layers, thinner towards the wall."""
    rows = SLAB_MM * np.linspace(0, 1, 81) ** 1.5
    return slab_cells(np.linspace(-260, 20, 57), (-2.0, 0.0, 2.0), rows)


def slab_values(points: FloatArray) -> FloatArray:
    """The same n - 1 at the corners of cells."""
    return above(points[:, 2].astype(np.float64))


def on_cells(grid: pv.UnstructuredGrid, values: Any, recovered: bool) -> TetrahedralAir:
    """Air on cells, with either kind of gradient."""
    return TetrahedralAir(cells_of(field_of(grid, values)), recovered)


def slab_medium() -> SmoothMedium:
    """The air above the plate, by its formula."""
    return SmoothMedium(slab_air, STEP_MM, kink=to_the_slabs_top)


def cylinder_medium() -> SmoothMedium:
    """The air around the cylinder, by its formula."""
    return SmoothMedium(cylinder_air, STEP_MM, kink=to_the_cylinders_edge)


def formula_scene(
    folder: Path, part: Part, shells: ShellStack, field: IndexField, medium: SmoothMedium
) -> Scene:
    """A scene for the cells engine, whose field is then replaced by a formula."""
    xml = write_scene(folder, part, AirState(field, ready=shells), ANY_CAMERA, paraview=False)
    scene = load_scene(xml, engine="cells")
    scene.compiled.integrator._air = medium
    return scene


def cylinder_ends(folder: Path, medium: Any = None) -> tuple[Ends, FloatArray]:
    """Ends and straight hits of the rays of ``CYLINDER_UM``; by default through the formula."""
    solid = trimesh.creation.cylinder(CYLINDER_RADIUS_MM, 60.0, sections=40_000)
    solid.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (0, 1, 0)))
    rays = cylinder_rays()
    if medium is None:
        medium = cylinder_medium()
    return follow(part(folder, solid), medium, rays.origin, rays.direction)


def slab_ends(folder: Path, medium: Any = None) -> tuple[Ends, FloatArray]:
    """Ends and straight hits of the rays of ``SLAB_SHIFT_UM``; by default through the formula."""
    plate = trimesh.creation.box((1000.0, 1000.0, 5.0))
    plate.apply_translation((0, 0, -2.5))
    rays = slab_rays()
    if medium is None:
        medium = slab_medium()
    return follow(part(folder, plate), medium, rays.origin, rays.direction)
