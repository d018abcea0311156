"""The gradient of n against what it must integrate to, and its order of convergence."""

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

from iriftrace.io.field import read_field
from iriftrace.medium.gradient import point_gradient
from iriftrace.medium.index_field import IndexField

TREE = Path(__file__).parents[2]
RAYS, STEPS = 400, 2000


@pytest.fixture(
    scope="module", params=["scenes/cylinder/field.vtu", "validation/data/cylinder_A.vtu"]
)
def field(request) -> IndexField:
    return read_field(TREE / request.param)


def oblique_rays() -> tuple[np.ndarray, np.ndarray]:
    """Starts and ends: from 50 mm off the axis to 0.1 mm before the wall, at up to 45 degrees."""
    random = np.random.default_rng(1)
    angle = random.uniform(0.0, 2.0 * np.pi, RAYS)
    across = np.column_stack([np.zeros(RAYS), np.cos(angle), np.sin(angle)])
    place = np.outer(random.uniform(-80.0, 80.0, RAYS), (1.0, 0.0, 0.0))
    slant = np.outer(random.uniform(-30.0, 30.0, RAYS), (1.0, 0.0, 0.0))
    return place + slant + 50.0 * across, place + 13.6 * across


def integral_errors(field: IndexField, gradient: np.ndarray) -> np.ndarray:
    """Relative errors of the integral of grad(n) . d along rays, against the change of n."""
    start, end = oblique_rays()
    change = field.sample(end) - field.sample(start)
    along = (np.arange(STEPS) + 0.5) / STEPS
    points = start[:, None] + (end - start)[:, None] * along[:, None]
    carrier = field.grid.copy()
    carrier.point_data["gradient"] = gradient
    found = pv.PolyData(points.reshape(-1, 3)).sample(carrier)
    local = np.asarray(found.point_data["gradient"]).reshape(RAYS, STEPS, 3)
    integral = np.einsum("rsk,rk->r", local, end - start) / STEPS
    inside = np.asarray(found.point_data["vtkValidPointMask"]).reshape(RAYS, STEPS).all(axis=1)
    inside &= np.isfinite(change)
    # Coarse cells cut the corner at the heads; nearly all rays must be left.
    assert inside.sum() > 0.95 * RAYS
    return np.abs(integral / change - 1.0)[inside]


def test_the_gradient_integrates_to_the_change_of_n(field):
    errors = integral_errors(field, field.gradient)
    # What the meshes allow: on the coarse one a median of 0.011, a 95th percentile of 0.058 and at
    # most 0.10; on the finer one 0.010, 0.037 and 0.11.
    assert np.median(errors) < 0.015
    assert np.quantile(errors, 0.95) < 0.07
    assert errors.max() < 0.2


def test_an_unweighted_mean_of_the_cells_would_not(field):
    # This is what the weights are for: sliver cells make VTK's own gradient useless on many rays.
    derived = field.grid.compute_derivative("refractivity", gradient="gradient")
    unweighted = integral_errors(field, np.asarray(derived.point_data["gradient"]))
    weighted = integral_errors(field, field.gradient)
    assert np.quantile(unweighted, 0.95) > 5.0 * np.quantile(weighted, 0.95)


def test_the_gradient_is_of_second_order_on_hexahedra():
    # The air around the hot cylinder of the reference cases: 1373.15 K at 13.5 mm, falling with
    # ln r to 293.15 K at 60 mm, on cells that grow outwards.
    errors = []
    for cells in (20, 40):
        radius = np.geomspace(13.5, 60.0, cells + 1)
        angle = np.linspace(0.0, np.pi / 2, cells + 1)
        depth = np.linspace(0.0, 10.0, 4)
        r, a, z = np.meshgrid(radius, angle, depth, indexing="ij")
        grid = pv.StructuredGrid(r * np.cos(a), r * np.sin(a), z).cast_to_unstructured_grid()
        x, y, _ = np.asarray(grid.points, float).T
        r = np.hypot(x, y)
        slope = 1080.0 / np.log(60.0 / 13.5)
        kelvin = 1373.15 - slope * np.log(r / 13.5)
        gradient = point_gradient(grid, 2.718e-4 * 293.15 / kelvin)
        radial = 2.718e-4 * 293.15 / kelvin**2 * slope / r
        exact = np.column_stack([radial * x / r, radial * y / r, np.zeros_like(x)])
        # At the boundary the mean is one-sided and of first order.
        inside = (r > 15.0) & (r < 50.0) & (x > 1.0) & (y > 1.0)
        off = np.linalg.norm(gradient - exact, axis=1) / radial
        errors.append(off[inside].max())
    assert errors[0] < 0.02
    assert errors[0] / errors[1] > 3.5
