"""Temperatures of the air measured with thermocouples."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from attrs import evolve, frozen

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, warn, without_warnings
from iriftrace.core.files import FileOrigin, check_readable, sha256_of
from iriftrace.core.units import PLAUSIBLE_K, ZERO_CELSIUS_K, length_factor, parse_quantity
from iriftrace.io.states import Column
from iriftrace.io.table import Table, read_table

_KELVIN_STEPS = {"K", "degC", "°C", "C"}
_OTHER_NAMES = {"Temperature": "T", "temperature": "T"}

_UNCERTAINTIES = ("u", "unc", "sigma", "std", "err", "tol")
"""Beginnings of names of uncertainties."""


@frozen(eq=False)
class AirTemperatures:
    """Temperatures of the air at n points.

    Attributes
    ----------
    places : (n, 3) array, mm, world
    kelvins : (n,) array, K
    deviations : (n,) array, K
        Standard uncertainty of each temperature.
    origin : FileOrigin
        The file, its path as it was given.
    """

    places: FloatArray
    kelvins: FloatArray
    deviations: FloatArray
    origin: FileOrigin


def is_air_temperatures(path: Path) -> bool:
    """True if the header of a file names the columns of `read_air_temperatures`."""
    try:
        with without_warnings():
            return any(column.name == "T" for column in _columns(read_table(path)))
    except InputError:
        return False


def _columns(table: Table) -> list[Column]:
    """Columns of a table, with the temperature as T."""
    found = table.columns
    return [evolve(column, name=_OTHER_NAMES.get(column.name, column.name)) for column in found]


def read_air_temperatures(path: str | Path) -> AirTemperatures:
    """Read temperatures of the air measured with thermocouples.

    Parameters
    ----------
    path : path
        A table whose header names x, y, z and T, with units as in ``T (degC)``, else mm and K. The
        optional column U is the expanded uncertainty (k = 2) of T in its unit. Without U the
        tolerance of a type K thermocouple of class 2 is used as the half width of a rectangular
        distribution: 2.5 K or 0.75 % of the temperature in degC (IEC 60584-1).

    Warns
    -----
    IriftraceWarning
        T has no unit, or a column that may be its uncertainty has another name than U.

    Raises
    ------
    InputError
        The file is missing or damaged, a column is missing, an uncertainty is not positive or in
        another unit than T, the air is colder than 200 K or hotter than 3000 K, or a place has
        several temperatures.
    """
    file = Path(path)
    check_readable(file)
    table = read_table(file)
    found = _columns(table)
    names, columns = [column.name for column in found], {c.name: c.unit or "" for c in found}
    if names.count("T") != 1:
        raise InputError(
            f"{file} has {'several columns' if 'T' in names else 'no column'} T; give places and "
            "temperatures of the air under a header x, y, z, T, and U if it is known.",
            code="air.columns",
        )
    axes = table.coordinates
    values = table.numbers([*axes, *(k for k, name in enumerate(names) if name in ("T", "U"))])
    if not np.isfinite(values).all():
        raise InputError(
            f"{file} has values that are not finite; give a number for each column.",
            code="air.not_finite",
        )
    by_name = dict(zip((name for name in names if name in ("T", "U")), values.T[3:], strict=True))
    unit = columns["T"] or "K"
    zero, ten = (parse_quantity(f"{value} {unit}", "K") for value in (0, 10))
    step = 0.1 * (ten - zero)
    kelvins = zero + step * by_name["T"]
    if "U" in by_name:
        if columns["U"] not in ("", unit) and {columns["U"], unit} - _KELVIN_STEPS:
            raise InputError(
                f"{file} has U in {columns['U']} and T in {unit}; give both in the same unit.",
                code="units.two",
            )
        deviations = 0.5 * step * by_name["U"]
    else:
        deviations = np.maximum(2.5, 0.0075 * np.abs(kelvins - ZERO_CELSIUS_K)) / np.sqrt(3.0)
    if not deviations.min() > 0.0:
        raise InputError(
            f"{file} has uncertainties U of 0 K or less; correct them.", code="air.uncertainty"
        )
    low, high = PLAUSIBLE_K
    strange = kelvins[(kelvins < low) | (kelvins > high)]  # an open thermocouple's, too
    if len(strange):
        raise InputError(
            f"{file} has air of {strange[0]:.4g} K, as T is read in {unit}; write the unit of T "
            "into the header, as in T (degC), and leave out thermocouples that are open.",
            code="air.implausible",
        )
    if not columns["T"]:
        low, high = (kelvins.min() - ZERO_CELSIUS_K, kelvins.max() - ZERO_CELSIUS_K)
        warn(
            f"{file} does not state the unit of T, which is read in K ({low:.0f} to {high:.0f} "
            "degC); write it into the header, as in T (K) or T (degC)."
        )
    others = [n for n in columns if n != "U" and n.casefold().startswith(_UNCERTAINTIES)]
    if others and "U" not in columns:
        warn(
            f"{file} has the column {others[0]}, which is not read; if it is the uncertainty of T, "
            "call it U and give the expanded one (k = 2)."
        )
    places = length_factor(table.length_unit(axes) or "mm") * values[:, :3]
    if len(np.unique(places, axis=0)) < len(places):
        raise InputError(
            f"{file} has several temperatures at one place, as of several times; give one for "
            "each.",
            code="table.two_values",
        )
    return AirTemperatures(places, kelvins, deviations, FileOrigin(str(file), sha256_of(file)))
