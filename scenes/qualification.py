"""Scenarios of the qualification: rays, parts and air whose answers are closed forms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pyvista as pv
import trimesh
from numpy.typing import ArrayLike

from iriftrace.core.arrays import FloatArray
from iriftrace.measuring.qualification import Scenario, StatedAir, Statement, vectors
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.source import FieldSource
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.scenes import closed_forms as exact

PLATE_ANGLES = ((-15, 15), (-30, 30), (0, 30), (20, 50), (30, 60))
CYLINDER_ANGLES = ((-30, 30), (-60, 60), (30, 60))
"""Angles, degrees, of two devices to the normal of the point at which they look."""

PLATE_TARGET = np.array((0.0, 0.4, 0.0))
CYLINDER_TARGET = np.array((0.1, -exact.RADIUS_MM, 0.0))
FAR_MM = 20_000.0
"""Distance of the devices next to the cylinder: the closed form is that of parallel rays."""

_AIR = StatedAir(exact.REFRACTIVITY, exact.AMBIENT_K)
_LINEAR = "T = 1373.15 K - 1080 K z / (20 mm) for 0 < z < 20 mm"
_LOGARITHM = "T = 1373.15 K - 1080 K ln(r / 13.5 mm) / ln(60 / 13.5), r^2 = y^2 + z^2, to r = 60 mm"
_RECIPROCAL = (
    "T = 1373.15 K - 1080 K (1/13.5 - mm/r) / (1/13.5 - 1/60), r^2 = x^2 + y^2 + z^2, to r = 60 mm"
)
_SQUARE = "T = 293.15 K + 1080 K (1 - d / (8 mm))^2 for d < 8 mm from the plate"
_INDEX = "n - 1 = refractivity temperature_k / T, and no air bends rays outside the field."
_ASKED = (
    "Answer: where the refracted ray ends on the part minus where the straight ray ends, mm.",
    "Answer: a ray from the first device ends on the part at X along its refracted path. Find the "
    "direction in which the second device sees X. The straight lines of both devices meet, or are "
    "nearest, at X'; the answer is X' - X, mm.",
)


class Rays(NamedTuple):
    """Rays and their answers, (n, 3) arrays: mm and unit vectors, world."""

    origin: FloatArray
    direction: FloatArray
    truth: FloatArray
    second: FloatArray | None = None


def slab_rays() -> Rays:
    """Rays of `closed_forms.SLAB_SHIFT_UM` in the x-z plane."""
    angle = np.radians(list(exact.SLAB_SHIFT_UM))
    direction = np.column_stack((np.sin(angle), 0 * angle, -np.cos(angle)))
    origin = np.array((1.0, 0.3, 0.0)) - direction * (25 / np.cos(angle))[:, None]
    truth = 1e-3 * np.outer(list(exact.SLAB_SHIFT_UM.values()), (1.0, 0.0, 0.0))
    return Rays(origin, direction, truth)


def cylinder_rays() -> Rays:
    """Rays of `closed_forms.CYLINDER_UM` along y, past the axis."""
    return _along_y(list(exact.CYLINDER_UM), exact.around, np.array((0.0, 0.0, 1.0)), 0.123)


def sphere_rays() -> Rays:
    """Rays along y past the centre."""
    away = np.array((np.sin(0.4), 0.0, np.cos(0.4)))
    return _along_y((0.5, 0.75, 0.9), exact.around_sphere, away, 0.0)


def _along_y(heights: Sequence[float], air: exact.Profile, away: FloatArray, x: float) -> Rays:
    """Rays at heights, in radii, over an axis or centre."""
    off = [exact.round_displacement_um(height, air) for height in heights]
    truth = 1e-3 * np.array(off) @ np.stack(((0.0, 1.0, 0.0), away))
    origin = exact.RADIUS_MM * np.outer(heights, away) + (x, -100.0, 0.0)
    return Rays(origin, np.tile((0.0, 1.0, 0.0), (len(heights), 1)), truth)


def layer_rays() -> Rays:
    """Rays at 75 degrees through the layer above the middle of a plate."""
    angle = np.radians(75.0)
    target = np.stack(np.meshgrid((-5.0, 0.0, 5.0), (-7.0, 0.0, 7.0), (0.0,)), -1).reshape(-1, 3)
    direction = np.tile((np.sin(angle), 0.0, -np.cos(angle)), (len(target), 1))
    shift = exact.slab_shift_um(75.0, exact.in_layer, exact.LAYER_MM)
    truth = np.tile((1e-3 * shift, 0.0, 0.0), (len(target), 1))
    return Rays(target - 100.0 * direction, direction, truth)


def above_plate(angle_deg: ArrayLike) -> FloatArray:
    """Place, mm, of a device 300 mm from the plate's point, in the x-z plane."""
    angle = np.radians(angle_deg)
    return PLATE_TARGET + 300.0 * np.stack((np.sin(angle), 0 * angle, np.cos(angle)), -1)


def beside_cylinder(angle_deg: ArrayLike) -> FloatArray:
    """Place, mm, of a device far from the cylinder's point, across the axis."""
    angle = np.radians(angle_deg)
    return CYLINDER_TARGET + FAR_MM * np.stack((0 * angle, -np.cos(angle), np.sin(angle)), -1)


def plate_pairs() -> Rays:
    """Two devices above the slab, the first of which aims at `PLATE_TARGET`."""
    first, second = above_plate(np.transpose(PLATE_ANGLES))
    truth = []
    for near, other in zip(first, second, strict=True):
        slope = near[0] / near[2]
        place = -_shift(slope)  # of the point that the first device sees
        towards = other[0] / other[2]
        for _ in range(9):
            towards = (other[0] - place - _shift(towards)) / other[2]
        depth, lateral = exact.slab_pair_error_um(slope, towards)
        truth.append((lateral, 0.0, -depth))
    return _aimed(first, second, PLATE_TARGET, truth)


def _shift(slope: float) -> float:
    """Shift in the slab, mm, of a line of sight of a signed slope, against its straight end."""
    size = 1e-3 * exact.slab_shift_um(float(np.degrees(np.arctan(abs(slope)))))
    return float(np.copysign(size, slope))


def cylinder_pairs() -> Rays:
    """Two devices far from the cylinder, the first of which aims at `CYLINDER_TARGET`."""
    first, second = beside_cylinder(np.transpose(CYLINDER_ANGLES))
    off = [exact.cylinder_pair_error_um(*np.radians(angles)) for angles in CYLINDER_ANGLES]
    return _aimed(first, second, CYLINDER_TARGET, [(0.0, -out, side) for out, side in off])


def _aimed(first: FloatArray, second: FloatArray, target: FloatArray, truth_um: ArrayLike) -> Rays:
    along = target - first
    direction = along / np.linalg.norm(along, axis=1)[:, None]
    return Rays(first, direction, 1e-3 * np.asarray(truth_um), second)


def slab_cells(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> pv.UnstructuredGrid:
    """Tetrahedra between planes at coordinates in mm."""
    return pv.RectilinearGrid(x, y, z).cast_to_unstructured_grid().triangulate()


def cylinder_cells(layers: int, angles_deg: ArrayLike, x: ArrayLike) -> pv.UnstructuredGrid:
    """Hexahedra around the cylinder, denser towards the wall, between planes across the axis."""
    share = np.linspace(0, 1, layers + 1)
    radius = exact.RADIUS_MM * (exact.OUTER_MM / exact.RADIUS_MM) ** share
    r, a, x = np.meshgrid(radius, np.radians(angles_deg), x, indexing="ij")
    return pv.StructuredGrid(x, r * np.cos(a), r * np.sin(a)).cast_to_unstructured_grid()


def sphere_cells(layers: int, subdivisions: int) -> pv.UnstructuredGrid:
    """Wedges around the sphere, denser towards the wall."""
    ball = trimesh.creation.icosphere(subdivisions, 1.0)
    count, faces = len(ball.vertices), ball.faces
    radii = 1 / np.linspace(1 / exact.RADIUS_MM, 1 / exact.OUTER_MM, layers + 1)
    cells = [np.hstack((faces + k * count, faces + (k + 1) * count)) for k in range(layers)]
    points = np.concatenate([radius * ball.vertices for radius in radii])
    return pv.UnstructuredGrid({pv.CellType.WEDGE: np.concatenate(cells)}, points)


def _field(grid: pv.UnstructuredGrid, refractivity: FloatArray) -> IndexField:
    source = FieldSource("the kit", "0" * 64, "T", "temperature", "mm")
    return IndexField(grid, refractivity, _AIR.air, source)


def _slab() -> tuple[Part, IndexField]:
    plate = trimesh.creation.box((800.0, 800.0, 5.0))
    plate.apply_translation((0, 0, -2.5))
    rows = exact.SLAB_MM * np.linspace(0, 1, 61) ** 1.5
    grid = slab_cells(np.linspace(-260, 60, 33), np.linspace(-20, 20, 5), rows)
    return _part(plate), _field(grid, exact.above(np.asarray(grid.points)[:, 2]))


def _cylinder() -> tuple[Part, IndexField]:
    solid = trimesh.creation.cylinder(exact.RADIUS_MM, 60.0, sections=7200)
    solid.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (0, 1, 0)))
    grid = cylinder_cells(30, np.linspace(0, 360, 241), (-5.0, 0.0, 5.0)).clean()
    return _part(solid), _field(grid, exact.around(np.hypot(*np.asarray(grid.points).T[1:])))


def _sphere() -> tuple[Part, IndexField]:
    grid = sphere_cells(20, 4)
    radius = np.linalg.norm(grid.points, axis=1)
    ball = trimesh.creation.icosphere(6, exact.RADIUS_MM)
    return _part(ball), _field(grid, exact.around_sphere(radius))


def _layer() -> tuple[Part, IndexField]:
    from iriftrace.flow.synthetic.field import synthetic_grid
    from iriftrace.flow.synthetic.mesh import AirMesh
    from iriftrace.flow.synthetic.model import synthetic_air

    plate = trimesh.creation.box((80.0, 30.0, 4.0))
    plate.apply_translation((0, 0, -2))
    part = _part(plate)
    air = synthetic_air(part, boundary_layer_mm=exact.LAYER_MM, plume=0.0)
    grid = synthetic_grid(air, AirMesh(cell_mm=1.0, sides_mm=12.0, height_mm=12.0))
    return part, _field(grid, _AIR.air.refractivity(np.asarray(grid.point_data["T"])))


def _part(mesh: trimesh.Trimesh) -> Part:
    return part_of_mesh(mesh.vertices, mesh.faces, name="iriftrace.scenes.qualification")


def scenarios() -> list[Scenario]:
    """The numbered scenarios of the kit."""
    slab, cylinder = _slab(), _cylinder()
    snell = "The truth follows from n sin(theta), constant in plane layers, by quadrature."
    bouguer = "The truth follows from n r sin(theta), constant after Bouguer, by quadrature."
    made = (
        ("slab", "Plane layers", snell, _LINEAR, slab, slab_rays(), 0.01),
        ("cylinder", "Hot cylinder", bouguer, _LOGARITHM, cylinder, cylinder_rays(), 0.01),
        ("sphere", "Hot sphere", bouguer, _RECIPROCAL, _sphere(), sphere_rays(), 0.03),
        ("plate", "Hot plate, irregular mesh", snell, _SQUARE, _layer(), layer_rays(), 0.03),
        ("slab_devices", "Two devices, slab", snell, _LINEAR, slab, plate_pairs(), 0.01),
        (
            "cylinder_devices",
            "Two devices, cylinder",
            f"{bouguer} Rays of a device count as parallel, which leaves 0.03 %.",
            _LOGARITHM,
            cylinder,
            cylinder_pairs(),
            0.01,
        ),
    )
    return [
        Scenario(
            f"{number:02d}_{name}",
            Statement(
                title=title,
                text=f"{_ASKED[rays.second is not None]} {_INDEX} {text}",
                formula=formula,
                air=_AIR,
                origin_mm=vectors(rays.origin),
                direction=vectors(rays.direction),
                truth_mm=vectors(rays.truth),
                second_mm=None if rays.second is None else vectors(rays.second),
                bound=bound,
                judged="median" if name == "plate" else "each",
            ),
            part,
            air,
        )
        for number, (name, title, text, formula, (part, air), rays, bound) in enumerate(made, 1)
    ]
