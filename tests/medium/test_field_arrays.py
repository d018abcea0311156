"""Arrays by name, quantity and unit: temperatures against those that were written."""

import re
import warnings

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose, assert_array_equal

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.field import read_field
from iriftrace.io.reading import ReadField
from iriftrace.medium.air.refractivity import Air
from validation.inputs.field_grids import AMBIENT, box, saved, solid


@pytest.mark.parametrize("unit", ["K", "degC", "degF", "°C"])
def test_temperature_units(tmp_path, unit):
    grid = solid()
    kelvin = np.array(grid.point_data["T"])
    convert = {"K": kelvin, "degC": kelvin - 273.15, "degF": kelvin * 1.8 - 459.67}
    convert["°C"] = convert["degC"]
    grid.point_data["T"] = convert[unit]
    field = read_field(saved(grid, tmp_path / "f.vtu"), ReadField(temperature_unit=unit))
    assert_allclose(field.temperature_k, kelvin, rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("Temperature [C]", "degC"),
        ("T (degC)", "degC"),
        ("T_[°C]", "degC"),
        ("T_(degF)", "degF"),
        ("T [ K ]", "K"),
        ("T", "K"),
    ],
)
def test_a_unit_in_the_name_is_that_of_the_values(tmp_path, name, unit):
    """Hot everywhere, so that no value is too cold to be in kelvin."""
    grid = solid()
    kelvin = np.linspace(700.0, 900.0, grid.n_points)
    grid.clear_data()
    convert = {"K": kelvin, "degC": kelvin - 273.15, "degF": kelvin * 1.8 - 459.67}
    grid.point_data[name] = convert[unit]
    path = saved(grid, tmp_path / "f.vtu")
    with pytest.warns(IriftraceWarning, match=r"coolest air in .* has 700\.0 K"):
        field = read_field(path)
    assert_allclose(field.temperature_k, kelvin, rtol=1e-12)
    if name != "T":
        with pytest.raises(InputError, match=rf"states that '{re.escape(name)}' is in"):
            read_field(path, ReadField(temperature_unit="degF" if unit == "K" else "K"))


@pytest.mark.parametrize(
    ("name", "choice"),
    [
        ("T", {}),
        ("T", {"temperature_unit": "degC"}),
        ("T [-]", {}),
        ("theta", {"array": "theta", "quantity": "temperature", "temperature_unit": "K"}),
    ],
)
@pytest.mark.parametrize("overshoot", [0.0, 0.04])
def test_a_dimensionless_temperature_is_named_and_its_kelvins_are_read(
    tmp_path, name, choice, overshoot
):
    """From 0 in the room to 1 at the wall, or as a solver overshoots."""
    grid = solid()
    scaled = np.linspace(-overshoot, 1.0 + overshoot, grid.n_points)
    grid.clear_data()
    grid.point_data[name] = scaled
    path = saved(grid, tmp_path / "f.vtu")
    with pytest.raises(InputError, match=r"dimensionless .* T_room \+ \(T_wall - T_room\) times"):
        read_field(path, ReadField(**choice))
    grid.clear_data()
    grid.point_data["T"] = AMBIENT + 900.0 * np.clip(scaled, 0.0, 1.0)
    assert read_field(saved(grid, path)).temperature_k.max() == pytest.approx(AMBIENT + 900.0)


@pytest.mark.filterwarnings("ignore:.* is an average over time")
@pytest.mark.parametrize(
    ("name", "quantity"),
    [
        ("T", "temperature"),
        ("Temp", "temperature"),
        ("temperature", "temperature"),
        ("Temperature", "temperature"),
        ("T_(K)", "temperature"),
        ("T (K)", "temperature"),
        ("Temperature_[K]", "temperature"),
        ("Static_Temperature", "temperature"),
        ("static-temperature", "temperature"),
        ("TMean", "temperature"),
        ("rhoMean", "density"),
        ("n", "index"),
        ("index", "index"),
        ("refractive_index", "index"),
        ("Refractive index", "index"),
        ("refractivity", "index"),
        ("rho", "density"),
        ("Density", "density"),
        ("density_(kg/m^3)", "density"),
    ],
)
def test_arrays_are_found_by_the_names_solvers_write(tmp_path, name, quantity):
    air, grid = Air(), box(2)
    kelvin = np.array(grid.point_data["T"])
    values = {
        "temperature": kelvin,
        "index": 1.0 + air.refractivity(kelvin),
        "density": air.ambient_density * AMBIENT / kelvin,
    }
    grid.clear_data()
    grid.point_data["p"] = np.full(grid.n_points, 1e5)
    grid.point_data["U"] = np.zeros((grid.n_points, 3))
    grid.point_data["tke"] = np.zeros(grid.n_points)
    grid.point_data[name] = values[quantity]
    field = read_field(saved(grid, tmp_path / "f.vti"))
    assert (field.source.array, field.source.quantity) == (name, quantity)
    assert_allclose(field.refractivity, air.refractivity(kelvin), rtol=1e-11)
    assert_allclose(field.temperature_k, kelvin, rtol=1e-11)


def test_an_index_may_be_stored_less_one(tmp_path):
    grid = box(2)
    refractivity = Air().refractivity(np.array(grid.point_data["T"]))
    grid.point_data["x"] = refractivity
    path = saved(grid, tmp_path / "f.vti")
    field = read_field(path, ReadField(array="x", quantity="index"))
    assert_array_equal(field.refractivity, refractivity)


def test_an_index_in_single_precision_is_said_to_be_coarse(tmp_path):
    grid = box(2)
    index = 1.0 + Air().refractivity(np.array(grid.point_data["T"]))
    grid.clear_data()
    grid.point_data["n"] = index.astype(np.float32)
    with pytest.warns(IriftraceWarning, match="single precision"):
        read_field(saved(grid, tmp_path / "f.vti"))


@pytest.mark.parametrize("names", [("T", "Temperature"), ("T", "static-temperature")])
def test_arrays_that_could_all_be_meant_are_listed(tmp_path, names):
    grid = box(2)
    values = np.array(grid.point_data["T"])
    grid.clear_data()
    for name in names:
        grid.point_data[name] = values
    with pytest.raises(InputError, match=", ".join(names)):
        read_field(saved(grid, tmp_path / "f.vti"))


@pytest.mark.parametrize("name", ["T_rms", "T_degC", "T_air", "Temperature.Trnavg"])
def test_other_names_must_be_declared(tmp_path, name):
    """By the array, and what it holds; a unit is that in brackets, or is given."""
    grid = box(2)
    kelvin = np.array(grid.point_data["T"])
    grid.point_data[name] = kelvin - 273.15
    path = saved(grid, tmp_path / "f.vti")
    assert read_field(path).source.array == "T"
    del grid.point_data["T"]
    saved(grid, path)
    with pytest.raises(InputError, match=f"its arrays are {name}"):
        read_field(path)
    with pytest.raises(InputError, match="does not say what the array"):
        read_field(path, ReadField(array=name))
    field = read_field(path, ReadField(array=name, quantity="temperature", temperature_unit="degC"))
    assert_allclose(field.temperature_k, kelvin, rtol=1e-11)


def test_a_quantity_can_be_asked_for(tmp_path):
    grid = box(2)
    grid.point_data["rho"] = Air().ambient_density * AMBIENT / np.array(grid.point_data["T"])
    path = saved(grid, tmp_path / "f.vti")
    assert read_field(path).source.array == "T"
    assert read_field(path, ReadField(quantity="density")).source.array == "rho"


@pytest.mark.parametrize(("factor", "warns"), [(1.01, False), (1.05, True)])
def test_an_index_that_contradicts_the_temperature_is_reported(tmp_path, factor, warns):
    grid = box(2)
    kelvin = np.array(grid.point_data["T"])
    refractivity = Air().refractivity(kelvin)
    hottest = kelvin.argmax()
    refractivity[hottest] *= factor
    grid.point_data["n"] = 1.0 + refractivity
    path = saved(grid, tmp_path / "f.vti")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        field = read_field(path)
    assert field.source.array == "T"
    assert bool(caught) == warns
    if warns:
        text = str(caught[0].message)
        expected = f"{refractivity[hottest]:.4g}", f"{refractivity[hottest] / factor:.4g}"
        assert all(value in text for value in ("793 K", *expected))


def test_an_array_n_that_is_no_index_does_not_matter_beside_a_temperature(tmp_path):
    grid = box(2)
    grid.point_data["n"] = np.arange(grid.n_points)
    assert read_field(saved(grid, tmp_path / "f.vti")).source.array == "T"


def test_cell_data_become_means_at_points(tmp_path):
    # Two cells side by side, 1 and 3 mm wide: they count at the points between them by the inverse
    # distances of their centres, since both lie on one side of these points.
    grid = pv.RectilinearGrid([0.0, 1.0, 4.0], [0.0, 1.0], [0.0, 1.0])
    grid.cell_data["T"] = [AMBIENT, AMBIENT + 100.0]
    with pytest.warns(IriftraceWarning, match="given in the cells"):
        field = read_field(saved(grid, tmp_path / "f.vtr"))
    near, far = np.linalg.norm([(0.5, 0.5, 0.5), (1.5, 0.5, 0.5)], axis=1)
    expected = AMBIENT + np.array([0.0, 100.0 * near / (near + far), 100.0])
    place = np.searchsorted([0.0, 1.0, 4.0], field.grid.points[:, 0])
    assert_allclose(field.temperature_k, expected[place], rtol=1e-12)


@pytest.mark.parametrize("unit", ["degC", "degF"])
def test_zeros_for_missing_values_are_refused_and_freezing_air_is_not(tmp_path, unit):
    grid = box(4)
    grid.clear_data()
    values = np.linspace(68.0, 900.0, grid.n_points)
    values[7:16] = 0.0
    grid.point_data[f"T [{unit}]"] = values
    path = saved(grid, tmp_path / "f.vti")
    with pytest.raises(InputError, match=r"exactly 0 at 9 of \d+ points and 68 or more elsewhere"):
        read_field(path)
    grid.point_data[f"T [{unit}]"] = np.linspace(0.0, 200.0, grid.n_points)
    with pytest.warns(IriftraceWarning, match="coolest air"):
        read_field(saved(grid, path))
