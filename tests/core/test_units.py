"""Numbers with units: conversion, offsets, and what is refused."""

import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from iriftrace.core.errors import InputError
from iriftrace.core.units import counted, length_factor, parse_quantity, stated_length_unit


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
