"""Arrays in solvers' files: which one holds temperature, density or index, and in what unit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import FloatArray, as_float64
from iriftrace.core.errors import InputError, warn
from iriftrace.core.units import ZERO_CELSIUS_K, parse_quantity
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.cell_means import point_means

if TYPE_CHECKING:
    import pyvista as pv

QUANTITIES = ("temperature", "index", "density")
"""Physical quantities from which n - 1 is computed, in the order in which they are searched."""

_NAMES = {
    "temperature": ("t", "temp", "temperature", "static_temperature", "temperatur"),
    "index": ("n", "index", "refractive_index", "refractivity"),
    "density": ("rho", "density"),
}
"""Names as OpenFOAM, COMSOL (also in German), Fluent, CFD-Post and STAR-CCM+ write them, in lower
case, without a unit in brackets and with _ for - and blanks."""

_AVERAGES = {"tmean": "temperature", "rhomean": "density"}
"""Names of averages over time of OpenFOAM's ``fieldAverage``, in lower case."""

_LEAST_BESIDE_ZERO = 5.0  # degC or degF: the outer air of a field in freezing air is cooler
_COLDEST_K = 150.0  # room temperature in degC, read as kelvin, lies below
_HOTTEST_K = 6000.0  # above, all molecules of air are dissociated
_LARGEST_REFRACTIVITY = 0.01  # air at 30 bar; n itself is near 1
_DIMENSIONLESS = (-0.05, 1.05)
"""Range of (T - T_room) / (T_wall - T_room), which is 0 to 1, with the overshoot of solvers."""

SI = {"temperature": "kelvin", "density": "kg/m^3", "index": "1"}
"""Unit used for each quantity, and assumed where neither file nor user states one."""

_IN_BRACKETS = re.compile(r".*[\s_]*[(\[{](?P<unit>[^()\[\]{}]+)[)\]}]\s*")


@frozen(eq=False)
class UsedArray:
    """The array of a file that is used, and the physical quantity it holds."""

    name: str
    quantity: str


def choose_array(grid: pv.DataSet, array: str | None, quantity: str | None, path: str) -> UsedArray:
    """Find the array to use.

    A given name is used as it is. Otherwise temperature is searched first, then index, then
    density, or only `quantity` when it is given, by their usual names; then averages over time, of
    which that of the density is the better one. A warning names an average next to the array.
    Raises InputError if no array is found, several are equally likely, or the quantity is not
    known.
    """
    if quantity is not None and quantity not in QUANTITIES:
        raise InputError(
            f"{quantity!r} is not a quantity; use one of {', '.join(QUANTITIES)}.",
            code="field.unknown_quantity",
            argument="quantity",
        )
    names = _scalar_names(grid)
    listed = ", ".join(names) or "none"
    if array is not None:
        if array not in names:
            raise InputError(
                f"{path} has no array {array!r} with one number per point; it has {listed}.",
                code="field.no_array",
                argument="array",
            )
        found = quantity or quantity_of(array)
        if found is None:
            raise InputError(
                f"The name {array!r} does not say what the array in {path} holds; state it as "
                f"`quantity`: {', '.join(QUANTITIES)}.",
                code="field.no_quantity",
                argument="quantity",
            )
        return UsedArray(array, found)
    averages = [name for name in names if is_average(name)]
    averages.sort(key=lambda name: quantity_of(name) != "density")
    for candidate in (quantity,) if quantity else QUANTITIES:
        likely = [name for name in names if _is_usual(name, candidate)]
        if len(likely) > 1:
            raise InputError(
                f"{path} has several arrays that could be the {candidate}: {', '.join(likely)}; "
                "name the one to use as `array`.",
                code="field.several_arrays",
                argument="array",
            )
        if likely:
            if averages:
                _warn_of_averages(likely[0], averages, path)
            return UsedArray(likely[0], candidate)
    for name in averages:
        if quantity in (None, quantity_of(name)):
            return UsedArray(name, quantity_of(name) or "")
    raise InputError(
        f"{path} has no array named as {quantity or 'a temperature, index or density'} usually "
        f"is; its arrays are {listed}; name one as `array`, and what it "
        "holds as `quantity`.",
        code="field.no_array",
        argument="array",
    )


def other_index(grid: pv.UnstructuredGrid) -> str | None:
    """Name of the only index array with a usual name, or None."""
    exact = [name for name in _scalar_names(grid) if _is_usual(name, "index")]
    return exact[0] if len(exact) == 1 else None


def quantity_of(name: str) -> str | None:
    """The quantity that an array's name states, or None."""
    usual = (quantity for quantity in QUANTITIES if _is_usual(name, quantity))
    return next(usual, _AVERAGES.get(_plain(name)))


def is_average(name: str) -> bool:
    """True for the name of a temperature's or density's average over time."""
    return _plain(name) in _AVERAGES


def point_values(grid: pv.UnstructuredGrid, name: str, path: str) -> FloatArray:
    """An array at the points, (n,); cell data are averaged onto the points (`point_means`)."""
    if name in grid.point_data:
        return finite_values(grid.point_data, name, path)
    values = finite_values(grid.cell_data, name, path)
    warn(
        f"{name!r} in {path} is given in the cells; its mean at the points misses the values at "
        "the wall, so export point data when the solver can."
    )
    return point_means(grid, values)


def finite_values(data: pv.DataSetAttributes, name: str, path: str) -> FloatArray:
    """An array of finite numbers; raises InputError otherwise."""
    values = as_float64(data[name])
    wrong = np.count_nonzero(~np.isfinite(values))
    if wrong:
        raise InputError(
            f"The array {name!r} in {path} is not a finite number at {wrong} of {len(values)} "
            "places, and light would stop there; export it without gaps.",
            code="field.not_finite",
        )
    return values


def _is_usual(name: str, quantity: str) -> bool:
    """True for a usual name, with or without COMSOL's scope (``comp1.T``)."""
    plain = _plain(name)
    return plain.rpartition(".")[2] in _NAMES[quantity]


def _warn_of_averages(name: str, averages: list[str], path: str) -> None:
    warn(
        f"{path} has {name!r}, which is used, of one moment, and its average over time; for air "
        f"that is not steady use {averages[0]!r}.",
        argument="array",
    )


def _plain(name: str) -> str:
    """A name in lower case, without a unit in brackets: ``T_(K)`` and ``T [K]`` become ``t``."""
    bare = re.sub(r"[(\[{].*?[)\]}]", "", name)
    return re.sub(r"[\s_-]+", "_", bare).strip("_").lower()


def _scalar_names(grid: pv.DataSet) -> list[str]:
    """Names of the arrays with one number per point or cell, each once, point data first."""
    return list(
        dict.fromkeys(
            name
            for data in (grid.point_data, grid.cell_data)
            for name in data
            if data[name].ndim == 1 and data[name].dtype.kind in "fiu" and name[:3] != "vtk"
        )
    )


def stated_unit(choice: UsedArray, units: Mapping[str, str] | None) -> str:
    """Unit of an array by the file's `units`, or by brackets in its name; "" for none."""
    if units is not None:
        return units.get(choice.name, "")
    found = _IN_BRACKETS.fullmatch(choice.name)
    return found["unit"].strip() if found and _is_unit(found["unit"], choice.quantity) else ""


def _unit_of(
    choice: UsedArray, units: Mapping[str, str] | None, temperature_unit: str | None, path: str
) -> str:
    """Unit of an array with a temperature or density."""
    name, quantity = choice.name, choice.quantity
    given = temperature_unit if quantity == "temperature" else None
    stated = stated_unit(choice, units)
    if stated and not _is_unit(stated, quantity):
        if given is None:
            raise InputError(
                f"{path} gives {name!r} the unit {stated!r}, which is not a unit of {quantity}; "
                f"{_remedy(quantity)}",
                code="field.unknown_unit",
                argument="temperature_unit" if quantity == "temperature" else None,
            )
        stated = ""
    if not stated:
        if units is not None and given is None:
            raise InputError(
                f"{path} does not say in which unit {name!r} is, and K and degC differ by a whole "
                f"room's temperature; {_remedy(quantity)}",
                code="field.no_unit",
                argument="temperature_unit" if quantity == "temperature" else None,
            )
        return given or SI[quantity]
    if given is not None and _scale(given, quantity) != _scale(stated, quantity):
        raise InputError(
            f"{path} states that {name!r} is in {stated}, but the temperature unit given is "
            f"{given}; leave it out, or correct the file.",
            code="field.two_units",
            argument="temperature_unit",
        )
    return stated


def _remedy(quantity: str) -> str:
    if quantity == "temperature":
        return "give the temperature unit, K or degC."
    return f"write its unit into the header, such as ({SI[quantity]})."


def _is_unit(text: str, quantity: str) -> bool:
    try:
        _scale(text, quantity)
    except InputError:
        return False
    return True


def _scale(unit: str, quantity: str) -> tuple[float, float]:
    """Offset and factor that convert a unit to the quantity's SI unit."""
    name = unit.strip().replace("m3", "m^3")
    # Two values determine a linear unit; converting a million numbers with pint would be slow.
    zero = parse_quantity(f"0 {name}", SI[quantity])
    return zero, (parse_quantity(f"100 {name}", SI[quantity]) - zero) / 100.0


def to_si(
    values: FloatArray,
    choice: UsedArray,
    units: Mapping[str, str] | None,
    temperature_unit: str | None,
    path: str,
) -> FloatArray:
    """Temperatures, (n,), K, or densities of the values of an array; as in `to_refractivity`."""
    if choice.quantity == "temperature":
        _refuse_dimensionless(values, choice.name, path)
    zero, slope = _scale(_unit_of(choice, units, temperature_unit, path), choice.quantity)
    some = values[values != 0.0]
    if zero and 0 < len(some) < len(values) and some.min() > _LEAST_BESIDE_ZERO:
        raise InputError(
            f"The array {choice.name!r} in {path} is exactly 0 at {len(values) - len(some)} of "
            f"{len(values)} points and {some.min():.4g} or more elsewhere, as programs fill in "
            "missing values; export these as NaN.",
            code="field.zeros_in_gaps",
        )
    return zero + values * slope


def warn_of_unit(
    kelvins: FloatArray,
    choice: UsedArray,
    units: Mapping[str, str] | None,
    temperature_unit: str | None,
    path: str,
    argument: str,
) -> None:
    """Warn of temperatures, (n,), K, whose unit neither the file nor the user states.

    `argument` is the name of the caller's `temperature_unit`.
    """
    if choice.quantity == "temperature" and not (stated_unit(choice, units) or temperature_unit):
        warn(
            f"{path} does not state the unit of {choice.name!r}, which is read in K: "
            f"{kelvins.min() - ZERO_CELSIUS_K:.0f} to {kelvins.max() - ZERO_CELSIUS_K:.0f} degC; "
            "state it.",
            argument=argument,
        )


def _refuse_dimensionless(values: FloatArray, name: str, path: str) -> None:
    """Refuse temperatures from 0 to 1, which no unit of temperature makes those of hot air."""
    low, high = values.min(), values.max()
    if _DIMENSIONLESS[0] <= low < high <= _DIMENSIONLESS[1]:
        raise InputError(
            f"The array {name!r} in {path} runs from {low:.4g} to {high:.4g}, as a dimensionless "
            "temperature (T - T_room) / (T_wall - T_room) does, from which no index follows; write "
            "kelvins, T_room + (T_wall - T_room) times these values.",
            code="field.dimensionless",
        )


def to_refractivity(
    values: FloatArray,
    choice: UsedArray,
    units: Mapping[str, str] | None,
    temperature_unit: str | None,
    air: Air,
    path: str,
) -> FloatArray:
    """Refractivity n - 1, (n,), of the (n,) values of an array, in ambient air.

    `units` is what the file's header states for each array, "" for nothing. It is None for formats
    that do not store units; then only brackets in the name state one, as in ``T_(degC)``.
    `temperature_unit` is the unit of temperatures given by the user.

    Raises InputError if user and file contradict each other, if a format that stores units states
    none for a temperature or one of another quantity, or if values are not possible (such as
    temperatures from 0 to 1, which are dimensionless) or zeros fill gaps.
    """
    if choice.quantity == "index":
        return _from_index(values, choice.name, path)
    values = to_si(values, choice, units, temperature_unit, path)
    lowest, density = values.min(), choice.quantity == "density"
    if lowest <= 0.0:
        raise InputError(
            f"The array {choice.name!r} in {path} holds a {choice.quantity} of {lowest:g} "
            f"{'kg/m3' if density else 'K'}; it must be positive everywhere, so check the array "
            "and its unit, and whether it is a difference from the ambient air.",
            code="field.not_positive",
        )
    if density:
        return air.refractivity_of_density(values)
    if lowest < _COLDEST_K:
        raise InputError(
            f"The array {choice.name!r} in {path} goes down to {lowest:g} K, colder than any "
            "air around a hot part; if it is in degC, give this unit, or call the array "
            f"'{choice.name} [degF]' if it is in Fahrenheit.",
            code="field.too_cold",
            argument="temperature_unit",
        )
    if values.max() > _HOTTEST_K:
        raise InputError(
            f"The array {choice.name!r} in {path} goes up to {values.max():g} K, hotter than any "
            "air around a hot part; check its unit, and export missing values as NaN.",
            code="field.too_hot",
        )
    return air.refractivity(values)


def refractivity_of_index(values: FloatArray) -> FloatArray | None:
    """Values of n (all near 1) or of n - 1 (all near 0) as n - 1; None when they are neither."""
    low, high = values.min(), values.max()
    if low > 0.0 and high < _LARGEST_REFRACTIVITY:
        return values
    if low > 1.0 and high < 1.0 + _LARGEST_REFRACTIVITY:
        return values - 1.0
    return None


def _from_index(values: FloatArray, name: str, path: str) -> FloatArray:
    refractivity = refractivity_of_index(values)
    if refractivity is None:
        raise InputError(
            f"The array {name!r} in {path} runs from {values.min():.7g} to {values.max():.7g}, "
            "which is neither an index n of air (1.00002 to 1.001) nor n-1; name the right array "
            "or quantity.",
            code="field.no_index",
        )
    if refractivity is not values and np.array_equal(values, values.astype(np.float32)):
        warn(
            f"The array {name!r} in {path} holds n in single precision, which leaves steps of "
            "1.2e-7 and a coarse gradient; export n-1, the temperature or double precision."
        )
    return refractivity
