"""In which unit an array of a field file is: what the file states, and what the user says."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from iriftrace.errors import InputError
from iriftrace.units import parse_quantity

FloatArray = NDArray[np.float64]

SI = {"temperature": "kelvin", "density": "kg/m^3", "index": "1"}
"""Unit in which each quantity is computed with, and taken to be where nobody says otherwise."""

_IN_BRACKETS = re.compile(r".*[\s_]*[(\[{](?P<unit>[^()\[\]{}]+)[)\]}]\s*")
# As programs spell them that are not scientific libraries.
_SPELLINGS = {
    "kelvin": "K",
    "celsius": "degC",
    "degree celsius": "degC",
    "°c": "degC",
    "fahrenheit": "degF",
    "°f": "degF",
    "kg/m3": "kg/m^3",
    "g/cm3": "g/cm^3",
}


def unit_of(
    name: str,
    quantity: str,
    units: Mapping[str, str] | None,
    temperature_unit: str | None,
    path: str,
) -> str:
    """Unit of an array.

    Parameters
    ----------
    name, quantity : str
        Of the array.
    units : mapping or None
        What the file's header states for each array, "" for nothing; None where the format has no
        place for units, so that only brackets in the name can tell one, as in ``T_(degC)``.
    temperature_unit : str or None
        What the user says of temperatures.
    path : str
        For messages.

    Returns
    -------
    str
        One that `converted` knows.

    Raises
    ------
    InputError
        User and file contradict each other; the header has a place for the unit of a temperature
        but states none, or one of another kind.
    """
    if quantity == "index":
        return SI["index"]
    given = temperature_unit if quantity == "temperature" else None
    if units is None:
        found = _IN_BRACKETS.fullmatch(name)
        stated = found["unit"].strip() if found and _is_unit(found["unit"], quantity) else ""
    else:
        stated = units.get(name, "")
    if stated and not _is_unit(stated, quantity):
        if given is None:
            raise InputError(
                f"{path} gives {name!r} the unit {stated!r}, which is no unit of {quantity}; "
                f"{_remedy(quantity)}"
            )
        stated = ""
    if not stated:
        if units is not None and given is None:
            raise InputError(
                f"{path} does not say in which unit {name!r} is, and K and degC differ by a whole "
                f"room's temperature; {_remedy(quantity)}"
            )
        return given or SI[quantity]
    if given is not None and _scale(given, quantity) != _scale(stated, quantity):
        raise InputError(
            f"{path} states that {name!r} is in {stated}, but the temperature unit given is "
            f"{given}; leave the option out (--temperature-unit), or correct the file."
        )
    return stated


def converted(values: FloatArray, unit: str, target: str) -> FloatArray:
    """Values in another unit, (n,)."""
    zero, slope = _scale_to(unit, target)
    return values if (zero, slope) == (0.0, 1.0) else zero + values * slope


def _remedy(quantity: str) -> str:
    if quantity == "temperature":
        return "give the temperature unit (--temperature-unit K or degC)."
    return f"write its unit into the header, such as ({SI[quantity]})."


def _is_unit(text: str, quantity: str) -> bool:
    try:
        _scale(text, quantity)
    except InputError:
        return False
    return True


def _scale(unit: str, quantity: str) -> tuple[float, float]:
    return _scale_to(unit, SI[quantity])


def _scale_to(unit: str, target: str) -> tuple[float, float]:
    """Value of 0 and of one step of a unit in another one."""
    name = _SPELLINGS.get(unit.strip().lower(), unit.strip())
    # Two values tell a linear unit; converting a million numbers through pint would be slow.
    zero = parse_quantity(f"0 {name}", target)
    return zero, (parse_quantity(f"100 {name}", target) - zero) / 100.0
