"""Which arrays of a solver's file hold the velocity of the air, and in what unit."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from attrs import frozen

from iriftrace.errors import InputError
from iriftrace.units import parse_quantity

SI = "m/s"

NO_VELOCITIES = "the file has no velocities"

VELOCITY, TEMPERATURE = "U", "T"
"""As OpenFOAM's solvers call them."""

MOMENTUM_MEAN = "rhoUMean"
"""As OpenFOAM's ``fieldAverage`` calls the mean of density times velocity."""

VELOCITY_OVER_TEMPERATURE = "U/T"
"""Of the cells of an OpenFOAM case, m/(s K): at one pressure what density times velocity is in
proportion to. Made of the values in the cells, since a product of values that were averaged onto
points is not the average of the product."""

# Names without unit, scope and case, with one underscore between words.
_USUAL = ("u", "velocity", "velocity_field", "vel")
_MEAN = re.compile(r"umean|u_mean|mean_(?:of_)?(?:u|velocity)|(?:velocity|vel)_(?:mean|average)")
_LOOSE = re.compile(r"(?:air|gas|fluid|flow)_velocity|velocity_(?:vector|field_.*)")
# Components: (u, v, w), velocity_x, "Velocity field, x-component", "x-velocity", Ux, vel_x.
_COMPONENT = re.compile(
    r"(?:(?:velocity|vel|u|v)(?:_field)?_?(?P<after>[xyz])(?:_component)?"
    r"|(?P<before>[xyz])_(?:velocity|vel)"
    r"|velocity_(?P<letter>[uvw])|(?P<alone>[uvw]))"
)
_BRACKETS = re.compile(r"[(\[{](?P<unit>[^()\[\]{}]*)[)\]}]")


@frozen
class VelocityArrays:
    """Where the velocity is.

    Attributes
    ----------
    names : tuple of str
        One array of vectors, or three of numbers along x, y and z.
    factor : float
        m/s in one of its unit.
    unit : str
        As the file states it; m/s where it states none.
    """

    names: tuple[str, ...]
    factor: float
    unit: str = SI


def velocity_arrays(
    grid: Any, units: Mapping[str, str] | None, *, averaged: bool = False
) -> tuple[VelocityArrays | None, str]:
    """Find the velocity among the arrays of a grid.

    A vector array with a usual name (``U``, ``Velocity field``) wins over three components
    (COMSOL's ``u``, ``v``, ``w``; ``Velocity field, x-component``), these over a vector whose name
    only resembles it. Numbers whose unit is no velocity (displacements are called u, v, w too) are
    none; where the file states no unit it is m/s.

    Parameters
    ----------
    grid : pyvista.DataSet
    units : mapping or None
        What the file's header states for each array, as `readers.contents.Contents.units`.
    averaged : bool
        Prefer a time average (``UMean``), since the temperature is one too.

    Returns
    -------
    VelocityArrays or None, str
        None where there is none, and then why, in words.
    """
    vectors, numbers = _names(grid, 2), _names(grid, 1)
    by_name = {_plain(name): name for name in vectors}
    usual = [by_name[name] for name in by_name if name in _USUAL]
    means = [name for plain, name in by_name.items() if _MEAN.fullmatch(plain)]
    loose = [name for plain, name in by_name.items() if _LOOSE.fullmatch(plain)]
    components = _components(numbers)
    for single in (means, usual) if averaged else (usual, means):
        if len(single) == 1:
            components.insert(0, (single[0],))
            break
    components += [(name,) for name in loose]
    refused = ""
    for names in components:
        factors = {_factor(name, units) for name in names}
        if len(factors) == 1 and None not in factors:
            unit = _stated_unit(names[0], units) or SI
            return VelocityArrays(names, factors.pop() or 1.0, unit), ""
        refused = f"the unit of {', '.join(names)} is no velocity"
    return None, refused or _what_lacks(grid, numbers, units) or NO_VELOCITIES


def moves(name: str) -> bool:
    """Whether a vector array tells how the air moves, by its name."""
    return name in (MOMENTUM_MEAN, VELOCITY_OVER_TEMPERATURE) or _names_vector(name)


def _names_vector(name: str) -> bool:
    """Whether an array is called as the vector of the velocity or its average is."""
    plain = _plain(name)
    return plain in _USUAL or any(pattern.fullmatch(plain) for pattern in (_MEAN, _LOOSE))


def is_mean(name: str) -> bool:
    """Whether an array's name says that it is an average over time."""
    return re.search(r"mean|averag", name, re.IGNORECASE) is not None


def _names(grid: Any, dimension: int) -> list[str]:
    """Arrays of numbers (1) or of vectors with three components (2), point data first."""
    found = [
        name
        for data in (grid.point_data, grid.cell_data)
        for name in data
        if data[name].ndim == dimension and data[name].dtype.kind in "fi"
        if dimension == 1 or data[name].shape[1] == 3
    ]
    return list(dict.fromkeys(found))


def _components(names: Iterable[str]) -> list[tuple[str, ...]]:
    """Sets of three arrays that differ in the axis only."""
    families = _families(names).values()
    return [tuple(f[axis] for axis in range(3)) for f in families if len(f) == 3]


def _families(names: Iterable[str]) -> dict[tuple[str, str, str], dict[int, str]]:
    """Arrays by axis, of each plain name without its axis: what is before, axes, what is after."""
    families: dict[tuple[str, str, str], dict[int, str]] = {}
    for name in names:
        found = _COMPONENT.fullmatch(_plain(name))
        if not found:
            continue
        (group, letter) = next((g, text) for g, text in found.groupdict().items() if text)
        axes = "xyz" if letter in "xyz" else "uvw"
        start, end = found.span(group)
        family = (found.string[:start], axes, found.string[end:])
        families.setdefault(family, {}).setdefault(axes.index(letter), name)
    return families


def _what_lacks(grid: Any, numbers: Iterable[str], units: Mapping[str, str] | None) -> str:
    """Why arrays with the names of velocities are none; "" where no array has such a name."""
    incomplete = {
        family: names
        for family, names in _families(numbers).items()
        if len(names) < 3 and all(_factor(name, units) is not None for name in names.values())
    }
    for family, names in incomplete.items():
        if len(names) == 2:
            return _missing(family, names)
    for data in (grid.point_data, grid.cell_data):
        for name in data:
            width = 1 if data[name].ndim == 1 else data[name].shape[1]
            if width != 3 and _names_vector(name) and _factor(name, units) is not None:
                return f"{name} has {width} component{'s' * (width > 1)}, 3 are needed"
    for family, names in incomplete.items():
        # A single v or w may be anything.
        if family != ("", "uvw", ""):
            return _missing(family, names)
    return ""


def _missing(family: tuple[str, str, str], names: Mapping[int, str]) -> str:
    """Which components there are and which not, by the names that they have or would have."""
    before, axes, after = family
    axis, like = next(iter(names.items()))
    missing = []
    for other in sorted({0, 1, 2} - names.keys()):
        wanted = f"{before}{axes[other]}{after}"
        spelt = (
            f"{like[: at.start()]}{letter}{like[at.end() :]}"
            for at in re.finditer(axes[axis], like, re.IGNORECASE)
            for letter in [axes[other].upper() if at[0].isupper() else axes[other]]
        )
        missing.append(next((name for name in spelt if _plain(name) == wanted), wanted))
    there = [names[at] for at in sorted(names)]
    return f"{_are(there)} there, {_are(missing)} missing"


def _are(names: list[str]) -> str:
    return f"{' and '.join(names)} {'is' if len(names) == 1 else 'are'}"


def _factor(name: str, units: Mapping[str, str] | None) -> float | None:
    """m/s in one of an array's unit; None where that is no velocity."""
    unit = _stated_unit(name, units)
    if not unit:
        return 1.0
    try:
        return parse_quantity(f"1 {unit}", SI)
    except InputError:
        return None


def _stated_unit(name: str, units: Mapping[str, str] | None) -> str:
    """Unit of an array as the file states it; "" where it states none."""
    if units is not None:
        return units.get(name, "")
    found = _BRACKETS.search(name)
    return found["unit"].strip() if found else ""


def _plain(name: str) -> str:
    """Lower case without unit and COMSOL's scope: ``comp1.Velocity (m/s)`` becomes velocity."""
    bare = _BRACKETS.sub("", name).rpartition(".")[2]
    return re.sub(r"[^a-z0-9]+", "_", bare.lower()).strip("_")
