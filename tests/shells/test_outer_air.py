"""Second derivatives at the outermost shell against air that is known everywhere outside it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from iriftrace.shells.hessian import outer_derivatives
from validation.inputs.shell_fields import hexahedra

AMBIENT, FALL, WIDTH_MM = 2.7e-4, 1e-5, 0.8
CENTRE = np.array((0.0, 0.0, -20.0))
RADIUS_MM = 18.0

Fading = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def exponential(height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fall of the index to the ambient above a shell, and how fast it gets less, per mm."""
    fall = FALL * np.exp(-height / WIDTH_MM)
    return fall, fall / WIDTH_MM


def linear(height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same where nothing is left from a certain height on."""
    fall = FALL * np.clip(1.0 - height / WIDTH_MM, 0.0, None)
    return fall, np.where(height < WIDTH_MM, FALL / WIDTH_MM, 0.0)


def derivatives_at(fading: Fading, lean: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Second derivatives found on a sphere, and its normals; the gradient leans with the height."""
    grid = hexahedra(60, 6.0)
    out = np.asarray(grid.points) - CENTRE
    radius = np.linalg.norm(out, axis=1)
    fall, slope = fading(radius - RADIUS_MM)
    grid.point_data["refractivity"] = AMBIENT - fall
    gradient = slope[:, None] * out / radius[:, None]
    gradient[:, 0] += slope * lean * (radius - RADIUS_MM)
    grid.point_data["gradient"] = gradient
    tilts = np.array(((0.0, 0.0), (0.05, 0.02), (-0.03, 0.06)))
    normals = np.column_stack((tilts, np.ones(3)))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    places = CENTRE + RADIUS_MM * normals
    found = outer_derivatives(grid, places, FALL / WIDTH_MM * normals, AMBIENT - FALL, AMBIENT)
    np.testing.assert_allclose(found, found.transpose(0, 2, 1), atol=1e-20)
    return found, normals


@pytest.mark.parametrize(
    ("fading", "slowness", "nearness"), [(exponential, 1.0, 1.0), (linear, 0.0, 0.5)]
)
def test_air_around_a_sphere(fading: Fading, slowness: float, nearness: float) -> None:
    """The shells turn by one over their radius, met at the mean distance."""
    found, normals = derivatives_at(fading)
    steep = FALL / WIDTH_MM
    outer = normals[:, :, None] * normals[:, None, :]
    straight = np.einsum("ij,ijk,ik->i", normals, found, normals)
    np.testing.assert_allclose(straight / (steep / WIDTH_MM), -slowness, atol=0.15)
    rest = found - straight[:, None, None] * outer
    expected = nearness * steep / RADIUS_MM * (np.eye(3) - outer)
    np.testing.assert_allclose(rest, expected, atol=0.2 * steep / RADIUS_MM)


def test_a_gradient_that_leans_with_the_height() -> None:
    """By so much per mm, along the shell."""
    lean = 0.08
    found, normals = derivatives_at(exponential, lean)
    across = np.einsum("ijk,ik->ij", found, normals)
    across -= np.einsum("ij,ij->i", across, normals)[:, None] * normals
    expected = FALL / WIDTH_MM * lean * np.array((1.0, 0.0, 0.0))
    np.testing.assert_allclose(
        across, np.tile(expected, (3, 1)), atol=0.15 * np.linalg.norm(expected)
    )


def test_nothing_is_known_where_the_data_end() -> None:
    """Then the gradient keeps its direction, and where there is none there are no derivatives."""
    grid = hexahedra(4, 2.0)
    grid.point_data["refractivity"] = np.full(grid.n_points, AMBIENT - FALL)
    grid.point_data["gradient"] = np.tile((0.0, 0.0, 1e-5), (grid.n_points, 1))
    places = np.array(((0.0, 0.0, 1.0), (0.3, 0.0, 1.0)))
    gradient = np.array(((0.0, 0.0, 1e-5), (0.0, 0.0, 0.0)))
    found = outer_derivatives(grid, places, gradient, AMBIENT - FALL, AMBIENT)
    assert np.isfinite(found).all()
    np.testing.assert_array_equal(found[1], 0.0)
    np.testing.assert_allclose(found[0, :, :2], 0.0, atol=1e-20)
