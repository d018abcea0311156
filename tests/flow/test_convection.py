"""The Nusselt number to be expected of a horizontal cylinder."""

import numpy as np
import pytest

from iriftrace.core.errors import InputError
from iriftrace.flow.check.nusselt import local_nusselt, nusselt_horizontal_cylinder, sector_ratios
from iriftrace.medium.air import thermophysics as air


def test_air_is_that_of_the_tables() -> None:
    """300 and 1000 K, 101325 Pa: Incropera, table A.4."""
    kelvin = np.array((300.0, 1000.0))
    assert air.density(kelvin, 101325.0) == pytest.approx((1.1614, 0.3482), rel=0.02)
    assert air.heat_capacity(kelvin) == pytest.approx((1007.0, 1141.0), rel=0.01)
    for found, expected, limits in (
        (air.viscosity(kelvin), (184.6e-7, 424.4e-7), (0.01, 0.03)),
        (air.conductivity(kelvin), (26.3e-3, 66.7e-3), (0.03, 0.05)),
    ):
        assert (np.abs(found / expected - 1.0) < limits).all()
    below, above = air.heat_capacity([999.999, 1000.001])
    assert below == pytest.approx(above, rel=1e-3), "where the polynomials meet"
    density = air.density(kelvin, 95000.0)
    assert air.temperature_of_density(density, 95000.0) == pytest.approx(kelvin, rel=1e-12)


def test_the_papers_cylinder_by_hand() -> None:
    """27 mm, 1100 degC in 20 degC: T_ref = 962.75 K, with table values of air there.

    nu = 40.9e-6 / 0.3617 = 1.131e-4 m2/s, Pr = 0.72, beta = 1/293.15:
    Ra = 9.81 * 1080 / 293.15 * 0.027^3 / nu^2 * Pr = 4.0e4; Nu = 0.36 + 0.387 Ra^(1/4) = 5.9.
    """
    expected = nusselt_horizontal_cylinder(27.0, 1373.15, 293.15)
    assert expected.reference_k == pytest.approx(962.75)
    assert expected.rayleigh == pytest.approx(4.0e4, rel=0.03)
    assert expected.nusselt == pytest.approx(5.9, rel=0.02)
    conductivity = 64.8e-3
    assert expected.heat_flux == pytest.approx(5.9 * conductivity * 1080.0 / 0.027, rel=0.05)


def test_small_differences_need_no_reference() -> None:
    """For a few kelvin Churchill's and Chu's own equation with any temperature in between."""
    expected = nusselt_horizontal_cylinder(50.0, 303.15, 293.15)
    nu, prandtl = 15.6e-6, 0.707
    rayleigh = 9.81 * 10.0 / 293.15 * 0.05**3 / nu**2 * prandtl
    nusselt = 0.36 + 0.518 * rayleigh**0.25 / (1 + (0.559 / prandtl) ** (9 / 16)) ** (4 / 9)
    assert expected.nusselt == pytest.approx(nusselt, rel=0.02)


@pytest.mark.parametrize(
    ("rayleigh", "saitoh"),
    [
        (1e3, (3.813, 3.772, 3.640, 3.374, 2.866, 1.975, 1.218)),
        (1e4, (5.995, 5.935, 5.750, 5.410, 4.764, 3.308, 1.534)),
    ],
)
def test_local_numbers_are_those_of_saitoh(rayleigh: float, saitoh: tuple[float, ...]) -> None:
    """1993, from memory, from the bottom in steps of 30 degrees."""
    found = local_nusselt(np.arange(0, 181, 30), rayleigh)
    np.testing.assert_allclose(found, saitoh, rtol=0.01)


def test_local_numbers_between_those_that_are_known() -> None:
    """At 2.5e4 the same solver gives these, from the bottom in steps of 45 degrees."""
    found = local_nusselt([0.0, 45.0, 90.0, 135.0, 180.0], 2.5e4)
    np.testing.assert_allclose(found, (7.216, 7.049, 6.523, 5.179, 1.697), rtol=0.01)
    # Means over 30 degrees of that solution at all of its 61 angles.
    assert sector_ratios(2.5e4) == pytest.approx((1.0, 0.903, 0.288), abs=0.005)
    with pytest.raises(InputError, match="from 1000 to 100000"):
        local_nusselt(0.0, 2e5)


@pytest.mark.parametrize(
    ("diameter", "wall", "ambient"),
    [(27.0, 293.15, 293.15), (0.0, 1373.15, 293.15), (27.0, 1373.15, -1.0), (1e5, 1373.15, 293.15)],
)
def test_what_the_rule_does_not_cover_is_refused(
    diameter: float, wall: float, ambient: float
) -> None:
    with pytest.raises(InputError):
        nusselt_horizontal_cylinder(diameter, wall, ambient)
