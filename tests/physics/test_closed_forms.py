"""The closed forms that the tracer is checked with, against values of 30-digit quadrature."""

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from iriftrace.medium.shells.levels import index_levels
from iriftrace.scenes.analytic import cylinder_radii
from iriftrace.scenes.closed_forms import (
    CYLINDER_UM,
    LAYER_MM,
    OUTER_MM,
    RADIUS_MM,
    REFRACTIVITY,
    SLAB_SHIFT_UM,
    WALL_K,
    Profile,
    around,
    around_sphere,
    in_layer,
    refractivity,
    round_displacement_um,
    slab_shift_um,
)
from validation.oracles.exact_layers import RoundAir, layered_cylinder_displacement_um
from validation.oracles.media import AIR_PARABOLA_UM


def test_slab_cylinder_and_parabola() -> None:
    assert SLAB_SHIFT_UM == pytest.approx({15: 0.906732, 60: 21.891213, 85: 4921.029686}, rel=1e-6)
    assert CYLINDER_UM == pytest.approx(
        {0.25: 0.484096, 0.75: 2.430121, 0.95: 7.621401, 0.999: 67.019772}, rel=1e-6
    )
    assert AIR_PARABOLA_UM == pytest.approx(
        {100: 49.986414, 200: 199.945655, 500: 1249.660342}, rel=1e-8
    )


@pytest.mark.parametrize(
    ("layers", "per_cent"),
    [(5, (1.45, 1.67, 1.42)), (13, (0.265, 0.406, 0.561)), (26, (0.069, 0.120, 0.244))],
)
def test_concentric_shells_err_by(layers: int, per_cent: tuple[float, ...]) -> None:
    surfaces, e = index_levels(REFRACTIVITY, refractivity(WALL_K), layers, "midpoint")
    radii = cylinder_radii(surfaces, RoundAir())
    for b, expected in zip((0.25, 0.75, 0.95), per_cent, strict=True):
        found = layered_cylinder_displacement_um(b, radii, e) / CYLINDER_UM[b] - 1
        assert 100 * found == pytest.approx(expected, abs=0.006)


def led(air: Profile, place: Sequence[float], heading: Sequence[float], end: float) -> np.ndarray:
    """Where a ray in the x-y plane ends by the ray equation, y and radius being the air's own.

    The air depends on y (`end` 0, a wall there) or on the distance from the origin, where a wall
    has the radius `end`.
    """

    def size(state: np.ndarray) -> float:
        return float(np.hypot(*state[:2]) if end else state[1])

    def slopes(_: float, state: np.ndarray) -> np.ndarray:
        away = state[:2] / size(state) if end else np.array((0.0, 1.0))
        step = 1e-4
        low, high = (float(air(np.array(size(state) + s))) for s in (-step, step))
        gradient = away * (high - low) / (2 * step)
        u = state[2:]
        bent = (gradient - (gradient @ u) * u) / (1 + float(air(np.array(size(state)))))
        return np.concatenate((u, bent))

    def wall(_: float, state: np.ndarray) -> float:
        return size(state) - end

    wall.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(
        slopes, (0, 400), (*place, *heading), "DOP853", events=wall, rtol=1e-11, atol=1e-13
    )
    return np.asarray(found.y[:2, -1])


def test_rays_by_their_differential_equation_end_where_the_quadrature_says() -> None:
    """The closed forms of sphere, cylinder and boundary layer, from just inside the hot air."""
    for air in (around, around_sphere):
        for height in (0.5, 0.9):
            b = height * RADIUS_MM
            start = (-np.sqrt((OUTER_MM - 1e-3) ** 2 - b**2), b)
            straight = np.array((-np.sqrt(RADIUS_MM**2 - b**2), b))
            off = 1e3 * (led(air, start, (1.0, 0.0), RADIUS_MM) - straight)
            assert off == pytest.approx(round_displacement_um(height, air), rel=2e-4)
    sine, cosine = np.sin(np.radians(75.0)), np.cos(np.radians(75.0))
    start = (0.0, LAYER_MM - 1e-3)
    off = 1e3 * (led(in_layer, start, (sine, -cosine), 0.0)[0] - start[1] * sine / cosine)
    assert off == pytest.approx(slab_shift_um(75.0, in_layer, LAYER_MM), rel=1e-4)


def test_both_components_have_the_length_of_the_displacement() -> None:
    for height, um in CYLINDER_UM.items():
        assert np.hypot(*round_displacement_um(height)) == pytest.approx(um, rel=1e-9)
