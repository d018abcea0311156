"""Numbers with units: conversion, offsets, and what is refused."""

import math
import pickle
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.core.number_lists import Interval, Lengths, Numbers, Pair, Size, Vector
from iriftrace.core.units import (
    Angle,
    Duration,
    Expansion,
    FNumber,
    Length,
    LengthWithUnit,
    Pressure,
    Speed,
    Temperature,
    Wavelength,
    counted,
    length_factor,
    parse_quantity,
    stated_length_unit,
)
from iriftrace.flow.simulate.options import DraughtOptions
from iriftrace.part.growth import Growth
from iriftrace.part.hot_temperature import HotTemperatures
from iriftrace.tracing.camera_options import CameraOptions


@pytest.mark.parametrize(
    ("text", "unit", "expected"),
    [
        ("20 degC", "kelvin", 293.15),
        ("20°C", "kelvin", 293.15),
        ("20 C", "kelvin", 293.15),
        ("-40 degF", "kelvin", 233.15),
        ("293.15 K", "kelvin", 293.15),
        (293.15, "kelvin", 293.15),
        ("1 atm", "pascal", 101325.0),
        ("1013.25 hPa", "pascal", 101325.0),
        ("0.633 um", "nm", 633.0),
        ("0.633 µm", "nm", 633.0),
        ("2.7369e-3 mm", "um", 2.7369),
        ("1 inch", "mm", 25.4),
        ("50 %", "dimensionless", 0.5),
        ("14e-6/K", "1/kelvin", 14e-6),
        ("14e-6 K**-1", "1/kelvin", 14e-6),
        ("14 um/m/K", "1/kelvin", 14e-6),
        ("14 um/m/C", "1/kelvin", 14e-6),
        ("7.8e-6 in/in/F", "1/kelvin", 7.8e-6 * 1.8),
        ("1.2 kg/m^3", "g/cm^3", 1.2e-3),
    ],
)
def test_quantities_are_converted(text, unit, expected):
    assert parse_quantity(text, unit) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "unit", "message"),
    [
        ("20 mm", "kelvin", "cannot be converted to kelvin"),
        ("20 degC", "mm", "cannot be converted to mm"),
        ("20 bananas", "mm", "unknown unit"),
        ("warm", "kelvin", "not a number"),
        ("", "kelvin", "not a number"),
        ("mm", "mm", "not a number"),
        ("1 mm)", "mm", "not a number"),
        ("1 mm; 2 mm", "mm", "not a number"),
        ("14e-6 1/K", "1/kelvin", "not a number with a unit"),
        ("nan", "mm", "not a finite number"),
        ("1e400 mm", "mm", "not a finite number"),
        ("1050", "kelvin", "without a unit, 1050 K or 1050 degC"),
        (" 0 ", "kelvin", "without a unit, 0 K or 0 degC"),
        ("inf", "kelvin", "not a finite number"),
    ],
)
def test_wrong_quantities_are_refused(text, unit, message):
    with pytest.raises(InputError, match=message):
        parse_quantity(text, unit)


@given(st.floats(-1e6, 1e6))
def test_bare_numbers_pass_unchanged(number):
    assert parse_quantity(repr(number), "mm") == number
    assert parse_quantity(number, "kelvin") == number


@pytest.mark.parametrize("unit", ["um", "mm", "cm", "m", "inch", "in"])
def test_length_factors_are_those_of_pint(unit):
    assert length_factor(unit) == pytest.approx(parse_quantity(f"1 {unit}", "mm"), rel=1e-15)


def test_unknown_length_units_are_refused():
    with pytest.raises(InputError, match="'ft' is not a length unit"):
        length_factor("ft")


def test_pint_is_loaded_only_for_units():
    # It takes a noticeable part of a second, and every command imports this module.
    code = (
        "import sys, iriftrace.core.units as units\n"
        "units.parse_quantity('3', 'mm')\n"
        "assert 'pint' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(
    ("remark", "unit"),
    [
        ("# Unit: mm", "mm"),
        ("comment length_unit = m", "m"),
        ("solid part UNITS=in     ", "inch"),
        ("# File units = meters", "m"),
        ("# LengthUnit=m", "m"),
        ("# length unit: [cm]", "cm"),
        ("# coordinates in m", ""),
        ("# all lengths in m", ""),
        ("# Einheit: m", ""),
        ("# units: x in m", ""),
        ("community: in", ""),
        ("# unit vectors, in m", ""),
    ],
)
def test_remarks_state_length_units(remark, unit):
    assert stated_length_unit(remark) == unit


def test_spellings_of_units_are_known():
    assert length_factor("µm") == length_factor("um") == 1e-3
    assert length_factor("Metres") == 1e3


def test_counts_agree_with_their_nouns():
    assert [counted(n, "pose") for n in (0, 1, 1224)] == ["0 poses", "1 pose", "1,224 poses"]


def test_the_remedy_of_a_refusal_is_read():
    with pytest.raises(InputError, match="write it like '20 /kelvin'"):
        parse_quantity("14e-6 per K", "1/kelvin")
    assert parse_quantity("20 /kelvin", "1/kelvin") == 20.0


@pytest.mark.parametrize(
    ("kind", "text", "value", "shown"),
    [
        (Length, "1 inch", 25.4, "25.4 mm"),
        (Length, "35", 35.0, "35 mm"),
        (LengthWithUnit, "20 um", 0.02, "0.02 mm"),
        (Wavelength, "0.45 um", 450.0, "450 nm"),
        (Temperature, "20 degC", 293.15, "20 degC"),
        (Pressure, "1003 hPa", 100300.0, "100300 Pa"),
        (Duration, "2 min", 120.0, "120 s"),
        (Angle, "0.25 turn", 90.0, "90 deg"),
        (Speed, "36 km/h", 10.0, "10 m/s"),
        (Expansion, "14 um/m/K", 14e-6, "1.4e-05 /K"),
        (Size, "6.7 mm,0.56 cm", (6.7, 5.6), "6.7 mm,5.6 mm"),
        (Lengths, "80,10 cm", (80.0, 100.0), "80 mm,100 mm"),
        (Pair, "2448,2048", (2448.0, 2048.0), "2448,2048"),
        (Vector, "150,-100,40", (150.0, -100.0, 40.0), "150,-100,40"),
        (Numbers, "1e-4,2e-4", (1e-4, 2e-4), "0.0001,0.0002"),
        (Interval, "50:inf", (50.0, math.inf), "50:inf"),
    ],
)
def test_a_kind_reads_text_and_numbers_and_shows_itself_as_users_write_it(kind, text, value, shown):
    read = kind(text)
    assert read == pytest.approx(value, rel=1e-14)
    assert kind(value) == pytest.approx(value, rel=1e-14)
    assert str(read) == shown
    assert kind(shown) == pytest.approx(value, rel=1e-5)
    again = pickle.loads(pickle.dumps(read))
    assert again == read
    assert type(again) is kind


def test_a_quantity_counts_as_its_number():
    # Numbers are written with repr and format; only str has the unit.
    assert repr(Length(0.1)) == "0.1"
    assert f"{Length(0.1):.2f}" == "0.10"
    assert (f"{FNumber('f/2.8')}", str(FNumber("f/2.8"))) == ("2.8", "f/2.8")
    assert Vector(np.array([1.0, 2.0, 3.0])) == (1.0, 2.0, 3.0)
    assert np.array(Length(3)).dtype == np.float64


@pytest.mark.parametrize(
    ("kind", "value", "code"),
    [
        (Temperature, "-300 degC", "units.below_zero"),
        (Temperature, -1.0, "units.below_zero"),
        (LengthWithUnit, "20", "units.no_unit"),
        (Size, "6.7 mm", "units.no_numbers"),
        (Lengths, "1 cm,10 mm", "units.twice"),
        (Pair, "1,2,3", "units.no_numbers"),
        (Vector, (1.0, math.nan, 2.0), "units.no_numbers"),
        (Vector, "1,inf,2", "units.not_finite"),
        (Numbers, "", "units.no_numbers"),
        (Interval, "50,250", "units.no_numbers"),
        (Interval, "nan:3", "units.no_numbers"),
    ],
)
def test_wrong_values_of_a_kind_are_refused(kind, value, code):
    with pytest.raises(InputError) as error:
        kind(value)
    assert error.value.code == code


def test_messages_name_the_units_of_values():
    """In as many digits as were given."""
    hot, wall = HotTemperatures.of("1050 degC"), Temperature("1100 degC")
    with pytest.warns(IriftraceWarning, match="at 1050 degC, but its wall has 1100 degC; leave"):
        hot.wall(wall, None)
    with pytest.raises(InputError, match=r"draught of 0\.2 m/s has no direction"):
        DraughtOptions(draught="0.2 m/s")
    with pytest.raises(InputError, match=r"pixel is 0\.00274 mm, which"):
        CameraOptions(pixel_size="2.74 um").camera(None, None, None)
    with pytest.raises(InputError, match=r"of 0\.3 per kelvin from 293\.15 K to 1323\.15 K is"):
        Growth(0.1 + 0.2, 293.15, 1323.15)


def test_a_bare_text_is_not_a_temperature():
    with pytest.raises(InputError, match="20 K or 20 degC"):
        Temperature("20")
    assert Temperature(20.0) == 20.0
