"""Straight lines through a field, and its outer boundary: gradient integrals, open ends."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.field import IndexField
from iriftrace.field_check_wall import WallState
from iriftrace.field_wall import inner_wall
from iriftrace.part import Part

FloatArray = NDArray[np.float64]

SIDES = ("-x", "+x", "-y", "+y", "-z", "+z")

_LINES = 400
_STEPS = 600
_FARTHEST_IN_LAYERS = 3.0
_STEEPEST_DEG = 45.0
_FACES = 300


@frozen(eq=False)
class GradientErrors:
    """Relative errors of the integral of grad(n) . d along lines, against the change of n."""

    errors: FloatArray

    @property
    def median(self) -> float:
        """Median; NaN without a line."""
        return float(np.median(self.errors)) if len(self.errors) else float("nan")

    @property
    def p95(self) -> float:
        """95th percentile; NaN without a line."""
        return float(np.percentile(self.errors, 95)) if len(self.errors) else float("nan")


def gradient_errors(field: IndexField, wall: WallState) -> GradientErrors:
    """Integrate the gradient along lines that start at the wall, up to 45 degrees from its normal.

    Lines that leave the data, or along which the index changes by less than a tenth of its whole
    range, are not counted.
    """
    random = np.random.default_rng(1)
    chosen = random.choice(len(wall.areas), _LINES, p=wall.areas / wall.areas.sum())
    layer = float(np.nanmedian(wall.layer_mm))
    normal = wall.normals[chosen]
    sideways = random.normal(size=(_LINES, 3))
    sideways -= np.einsum("ij,ij->i", sideways, normal)[:, None] * normal
    sideways /= np.linalg.norm(sideways, axis=1)[:, None]
    tilt = np.radians(random.uniform(0.0, _STEEPEST_DEG, _LINES))[:, None]
    direction = np.cos(tilt) * normal + np.sin(tilt) * sideways
    # Off the wall by a little, because coarse cells cut the part's own edges.
    start = wall.centres[chosen] + 0.02 * layer * normal
    path = _FARTHEST_IN_LAYERS * layer * direction
    along = (np.arange(_STEPS) + 0.5) / _STEPS
    points = start[:, None] + path[:, None] * along[:, None]
    carrier = field.grid.copy()
    carrier.point_data["gradient"] = field.gradient
    found = pv.PolyData(points.reshape(-1, 3)).sample(carrier)
    gradient = np.asarray(found.point_data["gradient"]).reshape(_LINES, _STEPS, 3)
    inside = np.asarray(found.point_data["vtkValidPointMask"]).reshape(_LINES, _STEPS).all(axis=1)
    integral = np.einsum("rsk,rk->r", gradient, path) / _STEPS
    change = field.sample(start + path) - field.sample(start)
    span = field.ambient_refractivity - field.hottest_refractivity
    with np.errstate(invalid="ignore"):
        counted = inside & np.isfinite(change) & (np.abs(change) > 0.1 * span)
    return GradientErrors(np.abs(integral[counted] / change[counted] - 1.0))


def hottest_at_sides(field: IndexField) -> dict[str, float]:
    """Highest temperature, K, where the data end, by the side of their box that is nearest.

    Data that were cropped cell by cell end in steps, so hardly any point may lie in the box's own
    side. NaN for a side where nothing ends.
    """
    grid = pv.UnstructuredGrid()
    grid.copy_structure(field.grid)
    grid.point_data["number"] = np.arange(grid.n_points)
    outer = np.zeros(grid.n_points, dtype=bool)
    surface = grid.extract_surface(algorithm="geometry")
    outer[np.asarray(surface.point_data["number"], dtype=np.int64)] = True
    inner = inner_wall(grid)
    if inner.n_points:
        outer[np.asarray(inner.point_data["number"], dtype=np.int64)] = False
    points = np.asarray(grid.points, dtype=np.float64)[outer]
    temperature = field.temperature_k[outer]
    gaps = np.hstack((points - points.min(axis=0), points.max(axis=0) - points))
    nearest = gaps[:, (0, 3, 1, 4, 2, 5)].argmin(axis=1)
    return {
        side: float(temperature[nearest == place].max()) if (nearest == place).any() else np.nan
        for place, side in enumerate(SIDES)
    }


def share_through_open_sides(field: IndexField, part: Part, origin: FloatArray) -> float:
    """Share of the lines from a camera to the faces it may see that enter the data in hot air.

    Hot is air whose index differs from ambient by more than half a step of 13 shells, where rays
    are counted as ``open_boundary``.

    Parameters
    ----------
    field, part
    origin : (3,) array, mm, world
        Where the camera stands.
    """
    sight = origin - part.face_centres
    towards = np.flatnonzero(np.einsum("ij,ij->i", sight, part.face_normals) > 0.0)
    if not len(towards):
        return float("nan")
    weight = part.face_areas[towards] / part.face_areas[towards].sum()
    random = np.random.default_rng(1)
    chosen = towards[random.choice(len(towards), _FACES, p=weight)]
    start = part.face_centres[chosen]
    along = np.linspace(0.0, 1.0, _STEPS)
    points = start[:, None] + (origin - start)[:, None] * along[:, None]
    index = field.sample(points.reshape(-1, 3)).reshape(_FACES, _STEPS)
    inside = np.isfinite(index)
    crosses = inside.any(axis=1)
    last = _STEPS - 1 - inside[:, ::-1].argmax(axis=1)
    at_exit = index[np.arange(_FACES), last]
    half_step = 0.5 * (field.ambient_refractivity - field.hottest_refractivity) / 13
    hot = crosses & (field.ambient_refractivity - at_exit > half_step)
    return float(hot.mean())
