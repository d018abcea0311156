"""The hot plate's air and the engine's rays in it against independent solutions."""

import numpy as np
import pytest

from iriftrace.core.errors import InputError
from iriftrace.medium.air.refractivity import Air
from scenes.generators.plate import PlateAir
from validation.flow.plate import expected, in_formula
from validation.oracles.hot_plate import profile, similarity

ROOM = Air()

BENDING_MRAD = {
    60.0: (0.2648, 0.2789, 0.2785, 0.2120, 0.1131),
    200.0: (0.6435, 0.7951, 0.9322, 0.8280, 0.3531),
    1100.0: (0.3023, 0.4105, 0.5823, 1.2829, 2.1706),
}
"""Computed by another program, for g = 9.80665 m/s2."""


def test_the_oracle_reproduces_ostrachs_table() -> None:
    """NACA Report 1111 (1953), from memory, Pr 0.72: F''(0) = 0.6760, H'(0) = -0.5046."""
    constant = [np.ones_like] * 3
    wall = similarity(0.72, *constant)(0.0)
    assert wall[2] == pytest.approx(0.6760, abs=1e-4)
    assert wall[4] == pytest.approx(-0.5046, abs=1e-4)


@pytest.mark.parametrize("celsius", [25.0, 60.0, 500.0, 1100.0, 1700.0])
def test_air_is_that_of_other_equations(celsius: float) -> None:
    """Physical variables against those of Howarth and Dorodnitsyn, at two heights."""
    away = np.linspace(0.0, 30.0, 61)
    for height in (20.0, 50.0):
        oracle = profile(celsius + 273.15, height, ROOM)
        inside = away[away < oracle.end_mm]
        found = PlateAir(celsius + 273.15).temperature(inside, height)
        np.testing.assert_allclose(found, oracle.kelvin(inside), atol=2e-5 * celsius)


def test_pressure_scales_the_layer() -> None:
    """Of a perfect gas nu ~ 1/p, so the layer's thickness goes as p^(-1/2)."""
    thin = PlateAir(900.0, Air(pressure_pa=110_000.0)).temperature(4.0, 50.0)
    scale = np.sqrt(110_000.0 / 101_325.0)
    assert thin == pytest.approx(PlateAir(900.0).temperature(4.0 * scale, 50.0), rel=1e-6)


@pytest.mark.parametrize("celsius", BENDING_MRAD)
def test_oracles_rays_are_those_of_another_program(celsius: float) -> None:
    np.testing.assert_allclose(expected(celsius, 50.0), BENDING_MRAD[celsius], rtol=1e-3)


@pytest.mark.usefixtures("variant")
@pytest.mark.parametrize("celsius", [60.0, 350.0, 1100.0])
def test_rays_are_bent_as_the_similarity_solution_says(celsius: float) -> None:
    np.testing.assert_allclose(in_formula(celsius), expected(celsius, 50.0), rtol=0.01)


@pytest.mark.parametrize("kelvin", [290.0, 293.5, 6000.0, float("nan")])
def test_walls_without_a_layer_are_refused(kelvin: float) -> None:
    with pytest.raises(InputError, match=r"hotter than the air"):
        PlateAir(kelvin)
