"""Findings about a field's wall: temperature, heat flux, cells across the layer, gradient."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pyvista as pv
from attrs import frozen
from scipy.integrate import cumulative_trapezoid

from iriftrace.core.arrays import FloatArray, IntArray, as_float64
from iriftrace.core.errors import InputError
from iriftrace.core.mesh.triangles import area_vectors, unit_vectors
from iriftrace.flow.check.finding import Finding, Grade
from iriftrace.medium.air import thermophysics as gas
from iriftrace.medium.gradient import ROUNDS, cell_corners, consistent_gradient, point_gradient
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.tetrahedra import tetrahedra_of
from iriftrace.part.part import Part
from iriftrace.part.region_choice import placed_regions

_POTENTIAL_STEPS = 2000
_LEAST_EXCESS_K = 1.0
WALL_TOLERANCE_K = 0.5
_LINES = 400
_STEPS = 600
_FARTHEST_IN_LAYERS = 3.0
_STEEPEST_DEG = 45.0


@frozen(eq=False)
class WallState:
    """The part's wall, m triangles on n points that belong to no other body's wall.

    `flux_of_cells` uses their mean gradient, which belongs to a location above the wall: it is too
    small by some per cent, and the difference shows how well the cells resolve the layer. The layer
    is the conduction thickness, (T_wall - T_ambient) over the gradient.
    """

    points: FloatArray  # (n, 3), mm
    temperature_k: FloatArray  # (n,)
    centres: FloatArray  # (m, 3), mm
    nearest_face: IntArray  # (m,), of the part, to each centre
    normals: FloatArray  # (m, 3), out of the part
    areas: FloatArray  # (m,), mm2
    flux: FloatArray  # (m,), W/m2, conducted into the air, positive for a hot wall
    flux_of_cells: FloatArray  # (m,), W/m2
    layer_mm: FloatArray  # (n,); NaN where the wall is not hotter than the room
    cell_mm: FloatArray  # (n,), height of the first cell above the wall
    bodies_w: float  # heat conducted from the walls of other bodies, W

    @property
    def area_mm2(self) -> float:
        """Area of the whole wall."""
        return float(self.areas.sum())

    @property
    def heat_w(self) -> float:
        """Heat conducted from the whole wall, W."""
        return float(np.sum(self.flux * self.areas)) * 1e-6


def wall_state(field: IndexField, part: Part, bodies: Sequence[Part] = ()) -> WallState:
    """Measure the part's wall in a field, without those of other `bodies`.

    The flux is the gradient of the integral of the conductivity over the temperature, which is
    nearly linear in the distance where the air is at rest, so cells of finite height cause little
    error. Its length is corrected so that it fits the values along the cells' edges
    (`consistent_gradient`). The conductivity is that of `iriftrace.medium.air.thermophysics`.

    Raises InputError if the field has no inner boundary, its wall is not hotter than the room, or
    the part is not closed.
    """
    wall = field.wall
    if not wall.n_points:
        raise InputError(
            f"{field.source.path} has no inner boundary around a part, so its wall cannot be "
            "checked; export the air without the solid.",
            code="field.no_wall",
        )
    number = np.asarray(wall.point_data["number"], dtype=np.int64)
    faces = np.asarray(wall.regular_faces, dtype=np.int64)
    points = np.asarray(wall.points, dtype=np.float64)
    surface = part.closed_surface
    centres = points[faces].mean(axis=1)
    nearest_face = surface.nearest(centres)[1]
    owner = np.argmin([body.surface.distance(centres) for body in (part, *bodies)], axis=0)
    own = owner == 0
    alone = np.setdiff1d(faces[own], faces[~own])
    areas = area_vectors(points, faces)
    normals = unit_vectors(areas)
    # The triangles' own direction, reversed if it disagrees with the body's normal.
    outward = part.face_normals[nearest_face]
    for place, body in enumerate(bodies, start=1):
        of_body = owner == place
        outward[of_body] = body.face_normals[body.surface.nearest(centres[of_body])[1]]
    normals *= np.where(np.einsum("ij,ij->i", normals, outward) < 0.0, -1.0, 1.0)[:, None]

    temperature = field.temperature_k
    potential = conduction_potential(temperature)
    of_cells = point_gradient(field.grid, potential)
    slope = _fitting_gradient(field.grid, number, potential, of_cells)[number]

    def conducted(gradient: FloatArray) -> FloatArray:
        return as_float64(-1e3 * np.einsum("ij,ij->i", gradient[faces].mean(axis=1), normals))

    flux, size = conducted(slope), np.linalg.norm(areas, axis=1)
    layer = _conduction_thickness(field, temperature[number], slope)
    cells = _first_cells(field.grid, number, surface.normals[surface.nearest(points)[1]])
    return WallState(
        points=points[alone],
        temperature_k=temperature[number[alone]],
        centres=centres[own],
        nearest_face=nearest_face[own],
        normals=normals[own],
        areas=size[own],
        flux=flux[own],
        flux_of_cells=conducted(of_cells[number])[own],
        layer_mm=layer[alone],
        cell_mm=cells[alone],
        bodies_w=1e-6 * float(flux[~own] @ size[~own]),
    )


def _conduction_thickness(field: IndexField, at_wall: FloatArray, slope: FloatArray) -> FloatArray:
    """Excess over the room (n,) over its slope, mm; NaN where the wall is hardly hotter.

    `slope` (n, 3) is the gradient of `conduction_potential`, W/m per mm.
    """
    excess = at_wall - field.air.temperature_k
    if excess.max() < _LEAST_EXCESS_K:
        raise InputError(
            f"The wall in {field.source.path} has at most {at_wall.max():.1f} K in a room of "
            f"{field.air.temperature_k:.1f} K, so there is no hot air to be checked; check "
            "the ambient temperature.",
            code="field.no_hot_air",
            argument="ambient",
        )
    fall = np.linalg.norm(slope, axis=1) / gas.conductivity(at_wall)
    hot = excess > 0.05 * float(excess.max())
    layer = np.full(len(at_wall), np.nan)
    layer[hot] = excess[hot] / np.maximum(fall[hot], 1e-12)
    return layer


def _fitting_gradient(
    grid: pv.UnstructuredGrid, wall: IntArray, values: FloatArray, gradient: FloatArray
) -> FloatArray:
    """The gradient (n, 3) with lengths at the wall that fit the values along the edges.

    Only for the cells around the wall and the neighbours that a correction there depends on.
    """
    near = np.zeros(grid.n_points, dtype=bool)
    near[wall] = True
    for _ in range(ROUNDS + 1):
        chosen = {}
        for kind, (cells, corners) in cell_corners(grid).items():
            touching = near[corners].any(axis=1)
            chosen[kind] = cells[touching]
            near[corners[touching]] = True
    around = grid.extract_cells(np.concatenate(list(chosen.values())))
    number = np.asarray(around.point_data["vtkOriginalPointIds"], dtype=np.int64)
    fitting = gradient.copy()
    fitting[number] = consistent_gradient(
        np.asarray(around.points), tetrahedra_of(around).corners, values[number], gradient[number]
    )
    return fitting


def conduction_potential(temperature: FloatArray) -> FloatArray:
    """Integral of the conductivity over the temperature, W/m."""
    knots = np.linspace(float(temperature.min()), float(temperature.max()), _POTENTIAL_STEPS)
    integral = cumulative_trapezoid(gas.conductivity(knots), knots, initial=0.0)
    return as_float64(np.interp(temperature, knots, integral))


def _first_cells(grid: pv.UnstructuredGrid, wall: IntArray, normals: FloatArray) -> FloatArray:
    """Height (n,), mm, of the cells on each point of the wall, normal to it."""
    points = np.asarray(grid.points, dtype=np.float64)
    place = np.full(len(points), -1)
    place[wall] = np.arange(len(wall))
    height = np.full(len(wall), np.inf)
    for _, corners in cell_corners(grid).values():
        on_wall = place[corners] >= 0
        touching = on_wall.any(axis=1)
        cells = corners[touching]
        for one in range(cells.shape[1]):
            at = place[cells[:, one]]
            some = at >= 0
            arms = points[cells[some]] - points[cells[some, one]][:, None]
            across = np.einsum("ijk,ik->ij", arms, normals[at[some]])
            # The height of the cell: its farthest corner along the normal.
            reach = across.max(axis=1)
            np.minimum.at(height, at[some], np.where(reach > 1e-6, reach, np.inf))
    height[~np.isfinite(height)] = np.nan
    return height


def temperature_finding(
    wall: WallState, set_k: FloatArray | None, measured_from: str | None = None
) -> Finding:
    """Judge the wall's temperature against the expected one, (n,) K, or its own median.

    Without a verdict if it was set to measured temperatures, whose file may be gone.
    """
    middle = float(np.median(wall.temperature_k))
    target = np.full(len(wall.temperature_k), middle) if set_k is None else set_k
    off = np.abs(wall.temperature_k - target)
    within = float(np.mean(off <= WALL_TOLERANCE_K))
    low, high = float(target.min()), float(target.max())
    one = f"the set {high:.2f} K" if low == high else ""
    several = f"the set {low:.2f} to {high:.2f} K of its regions"
    compared = "its own median" if set_k is None else one or several
    remark = (
        f"{within:.1%} of the wall's points within {WALL_TOLERANCE_K} K of {compared}; worst "
        f"{off.max():.3g} K"
    )
    verdict: Grade = "good" if within >= 0.99 else "doubtful" if within >= 0.9 else "bad"
    if measured_from is not None and set_k is None:
        coolest, hottest = wall.temperature_k.min(), wall.temperature_k.max()
        remark = f"{coolest:.2f} to {hottest:.2f} K; set to the temperatures in {measured_from}"
        verdict = "-"
    return Finding(
        "wall temperature",
        f"{middle:.2f} K",
        verdict,
        remark,
        {
            "median_k": middle,
            "target_k": float(np.median(target)),
            "share_within": within,
            "worst_k": off.max(),
        },
    )


def layer_finding(wall: WallState) -> Finding:
    """Judge the number of cells across the boundary layer."""
    cells = wall.layer_mm / wall.cell_mm
    median, low = np.nanpercentile(cells, (50, 5)).tolist()
    layer = float(np.nanmedian(wall.layer_mm))
    first = float(np.nanmedian(wall.cell_mm))
    return Finding(
        "boundary layer",
        f"{median:.1f} cells",
        "good" if median >= 5.0 else "doubtful" if median >= 3.0 else "bad",
        f"across its conduction thickness of {layer:.2f} mm, first cell {first:.2f} mm; 5th "
        f"percentile {low:.1f}; 5 keep the wall's gradient within some per cent",
        {"cells_median": median, "cells_p5": low, "layer_mm": layer, "first_cell_mm": first},
    )


def heat_finding(wall: WallState, part: Part, counted_w: float | None) -> Finding:
    """Heat from the wall, by the solver if the field states it, spread as the gradient there is."""
    heat_w = wall.heat_w if counted_w is None else counted_w
    flux = wall.flux * (heat_w / wall.heat_w if wall.heat_w > 0.0 else 1.0)
    region = part.region_of_face[wall.nearest_face]
    regions = {
        name: float(np.average(flux[region == i], weights=wall.areas[region == i]))
        for i, name in enumerate(part.region_names)
        if wall.areas[region == i].sum() > 0.0
    }
    names = dict(zip(part.region_names, placed_regions(part), strict=True))
    mean = float(np.average(flux, weights=wall.areas))
    most = sorted(regions.items(), key=lambda item: -item[1])[:3]
    source = (
        "conducted at the wall"
        if counted_w is None
        else f"counted by the solver ({wall.heat_w:.4g} W by the gradient at the wall)"
    )
    return Finding(
        "heat from the wall",
        f"{heat_w:.4g} W",
        "-" if heat_w > 0.0 else "bad",
        f"{source}; {wall.area_mm2:.5g} mm2, mean {mean:.4g} W/m2; "
        + ", ".join(f"{names[name]} {flux:.4g}" for name, flux in most),
        {
            "heat_w": heat_w,
            "heat_by_gradient_w": wall.heat_w,
            "flux_w_m2": mean,
            "regions_w_m2": regions,
        },
    )


def gradient_errors(field: IndexField, wall: WallState) -> FloatArray:
    """Relative errors of the integral of grad(n) . d along lines, against the change of n.

    The lines start at the wall, up to 45 degrees from its normal. Lines that leave the data, or
    along which the index changes by less than a tenth of its whole range, are not counted.
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
    # Slightly off the wall, because coarse cells cut the part's own edges.
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
    return as_float64(np.abs(integral[counted] / change[counted] - 1.0))


def gradient_finding(field: IndexField, wall: WallState) -> Finding:
    """Judge whether the gradient, integrated along lines, equals the change of the index."""
    errors = gradient_errors(field, wall)
    if len(errors) < 20:
        why = f"only {len(errors)} lines from the wall stay in the data; is there air around "
        return Finding("gradient", "n/a", "bad", f"{why}the part?", {"lines": len(errors)})
    median, p95 = np.percentile(errors, (50, 95)).tolist()
    fine = median <= 0.02 and p95 <= 0.1
    return Finding(
        "gradient",
        f"{median:.1%} off",
        "good" if fine else "doubtful" if median <= 0.05 else "bad",
        f"median of |integral of grad n along a line / change of n - 1| over {len(errors)} "
        f"lines; 95th percentile {p95:.1%}; at most 2 % and 10 %",
        {"median": median, "p95": p95, "lines": len(errors)},
    )
