"""Refractive index of air against published values and the laws that hot air follows."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from iriftrace.core.errors import InputError
from iriftrace.core.plain import plain, structured
from iriftrace.medium.air.refractivity import Air, ciddor, edlen, saturation_pressure

# 633 nm unless stated, 450 ppm CO2: degC, kPa, %RH, nm, (n - 1) 1e8, how far off.
CIDDOR = [
    # Ciddor (1996), table 1, recomputed at 30 digits; the table is rounded to 0.1 and an
    # independent coding of the formula reproduced it to 0.04.
    *((20, 80, 0, 633, 21458.0, 0.06), (20, 100, 0, 633, 26824.4, 0.06)),
    (10, 100, 0, 633, 27774.7, 0.06),
    # Ciddor (1996), table 3.
    *((20, 80, 75, 633, 21394.0, 5.0), (40, 120, 75, 633, 29941.8, 5.0)),
    (50, 80, 100, 633, 19058.4, 5.0),
    # NIST's equations as the earth-refraction project tests them.
    *((20, 101.325, 0, 633, 27180.0, 2.0), (20, 60, 0, 633, 16092.4, 2.0)),
    *((50, 100, 0, 633, 24328.5, 2.0), (-40, 100, 0, 633, 33758.0, 2.0)),
    *((40, 120, 75, 633, 29941.8, 2.0), (40, 110, 100, 1700, 27024.7, 2.0)),
    *((20, 101.325, 0, 1700, 26847.9, 2.0), (20, 101.325, 0, 300, 28658.1, 2.0)),
    (-40, 120, 0, 300, 42723.3, 2.0),
]
# Documentation of the ref_index package (NIST's equations), 633 nm, 101325 Pa: degC, %RH, n, n.
BOTH = [
    (20, 20, 1.0002716285, 1.0002716292),
    (20, 80, 1.0002711183, 1.0002711198),
    (60, 80, 1.0002340242, 1.0002339749),
]
# Density scaling from 271.8e-6 at 20 degC: degC, (n - 1) 1e6 at 30 digits.
HOT = [
    (100, 213.528),
    (200, 168.399),
    (400, 118.366),
    (600, 91.254),
    (800, 74.247),
    (1000, 62.583),
    (1100, 58.026),
    (1200, 54.087),
]


@pytest.mark.parametrize(
    ("celsius", "kilopascal", "percent", "wavelength", "expected", "off"), CIDDOR
)
def test_ciddor_gives_published_values(celsius, kilopascal, percent, wavelength, expected, off):
    found = ciddor(wavelength, celsius + 273.15, kilopascal * 1e3, percent / 100)
    assert found * 1e8 == pytest.approx(expected, abs=off)


@pytest.mark.parametrize(("celsius", "percent", "by_ciddor", "by_edlen"), BOTH)
def test_ciddor_and_edlen_equal_another_package(celsius, percent, by_ciddor, by_edlen):
    state = (633.0, celsius + 273.15, 101325.0, percent / 100)
    # Given to 1e-10; both sides round, and the package writes degrees with one digit.
    assert 1.0 + ciddor(*state) == pytest.approx(by_ciddor, abs=2e-10)
    assert 1.0 + edlen(*state) == pytest.approx(by_edlen, abs=2e-10)


@pytest.mark.parametrize("wavelength", [400.0, 633.0, 1500.0])
def test_standard_air_follows_ciddors_dispersion(wavelength):
    s = (1e3 / wavelength) ** 2
    expected = 0.05792105 / (238.0185 - s) + 0.00167917 / (57.362 - s)
    # The dispersion formula is standard air itself; what is left is the rounding of the two
    # compressibilities (that of the formula's state is tabulated to 10 digits).
    assert ciddor(wavelength, 288.15, 101325.0) == pytest.approx(expected, rel=1e-8)


def test_carbon_dioxide_raises_the_refractivity_as_ciddor_says():
    # 1.5e-8 per 100 ppm at 633 nm: the factor 0.534e-6 per ppm; the molar masses cancel, since
    # the density of standard air is taken at the same content.
    for model in (ciddor, edlen):
        change = model(633.0, 288.15, 101325.0, 0.0, 1450.0) / model(633.0, 288.15, 101325.0)
        assert change == pytest.approx(1.0 + 1000 * 0.534e-6, rel=1e-9)


@pytest.mark.parametrize(
    ("celsius", "pascal"), [(0.01, 611.657), (20.0, 2339.2), (100.0, 101418.0), (-20.0, 103.24)]
)
def test_saturation_pressure_equals_steam_and_ice_tables(celsius, pascal):
    # IAPWS steam tables and the 1993 equation for ice, rounded to five digits.
    assert saturation_pressure(celsius + 273.15) == pytest.approx(pascal, rel=2e-4)


def test_models_take_arrays_of_states():
    temperature = np.array([[263.15], [293.15]])
    humidity = np.array([0.0, 0.5, 1.0])
    for model in (ciddor, edlen):
        table = model(633.0, temperature, 101325.0, humidity)
        assert table.shape == (2, 3)
        assert table[1, 2] == model(633.0, 293.15, 101325.0, 1.0)


@pytest.mark.parametrize(("celsius", "expected"), HOT)
def test_hot_air_is_scaled_by_density(celsius, expected):
    air = Air()
    # The reference takes 271.8e-6 at 20 degC for the scale; Ciddor's own value is 271.79983e-6.
    found = air.refractivity(celsius + 273.15) * 271.8e-6 / air.ambient_refractivity
    assert found * 1e6 == pytest.approx(expected, abs=6e-4)


def test_default_air_is_that_of_the_reference_cases():
    assert Air().ambient_refractivity == pytest.approx(2.718e-4, abs=5e-10)
    # Kg/m3 of dry air with 450 ppm CO2 at 20 degC as an ideal gas.
    assert Air().ambient_density == pytest.approx(1.2041, abs=1e-4)


def test_gladstone_dale_constant_of_air():
    air = Air()
    assert air.refractivity_of_density(1.0) == pytest.approx(2.257e-4, abs=5e-8)
    assert air.refractivity_of_density(air.ambient_density) == pytest.approx(
        air.ambient_refractivity, rel=1e-15
    )


def test_density_and_temperature_give_the_same_index_in_an_ideal_gas():
    air = Air(temperature_k=300.0, pressure_pa=98e3, relative_humidity=0.6)
    temperature = np.array([300.0, 600.0, 1400.0])
    density = air.ambient_density * 300.0 / temperature
    assert_allclose(air.refractivity_of_density(density), air.refractivity(temperature), rtol=1e-14)


def test_moist_air_is_lighter_than_dry_air():
    # Water has 18 g/mol instead of 29: 1 % lighter at 20 degC and 100 %, a fraction 2.3 %.
    ratio = Air(relative_humidity=1.0).ambient_density / Air().ambient_density
    assert ratio == pytest.approx(1.0 - 0.0232 * (1.0 - 18.015 / 28.964), abs=1e-4)


@given(st.floats(200.0, 3000.0), st.floats(60e3, 120e3), st.floats(300.0, 1700.0))
def test_temperature_is_the_inverse_of_refractivity(temperature, pressure, wavelength):
    air = Air(wavelength_nm=wavelength, pressure_pa=pressure)
    assert air.temperature(air.refractivity(temperature)) == pytest.approx(temperature, rel=1e-13)


def test_air_can_be_written_to_json_and_back():
    air = Air(wavelength_nm=450, temperature_k=295.0, relative_humidity=0.4, model="edlen")
    assert structured(json.loads(json.dumps(plain(air))), Air) == air
    assert air.ambient_refractivity == edlen(450.0, 295.0, 101325.0, 0.4)


@pytest.mark.parametrize(
    ("state", "message"),
    [
        ({"wavelength_nm": 0.633}, r"wavelength 0\.633 nm"),
        ({"temperature_k": 20.0}, "ambient temperature 20 K"),
        ({"temperature_k": 1373.15}, "far from the part"),
        ({"pressure_pa": 1013.25}, "pressure 1013.25 Pa"),
        ({"relative_humidity": 50.0}, "50 % is 0.5"),
        ({"co2_ppm": -1.0}, "CO2"),
        ({"temperature_k": float("nan")}, "nan is not a finite number"),
        ({"model": "sellmeier"}, "ciddor, edlen"),
    ],
)
def test_states_outside_the_equations_are_refused(state, message):
    with pytest.raises(InputError, match=message):
        Air(**state)


def test_models_refuse_one_bad_state_among_many():
    with pytest.raises(InputError, match=r"400 K"):
        ciddor(633.0, [293.15, 400.0], 101325.0)


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_air_that_cannot_exist_is_refused(value):
    for convert in (Air().refractivity, Air().refractivity_of_density, Air().temperature):
        with pytest.raises(InputError, match="positive and finite"):
            convert([1.0, value])
