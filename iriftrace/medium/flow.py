"""Velocity of the air in a solver's file, and the heat that it carries: for a heat balance."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np
from attrs import frozen
from numpy.typing import ArrayLike

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.units import parse_quantity
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.air.thermophysics import (
    density,
    heat_content,
    heat_content_slope,
    temperature_of_density,
)
from iriftrace.medium.cell_means import point_means

if TYPE_CHECKING:
    import pyvista as pv

SI = "m/s"

VELOCITY, TEMPERATURE = "U", "T"
"""Names used by OpenFOAM's solvers."""

MOMENTUM_MEAN = "rhoUMean"
"""Name that OpenFOAM's ``fieldAverage`` gives the mean of density times velocity."""

VELOCITY_OVER_TEMPERATURE = "U/T"
"""In the cells of an OpenFOAM case, m/(s K): proportional to density times velocity at constant
pressure. It is computed from the values in the cells, because the product of values that were
averaged onto points is not the average of the product."""

ENTHALPY_FLUX = "enthalpy_flux"
"""Vector array, W/m2: density times velocity times (enthalpy - that of ambient air), or its time
average. Fluctuations carry heat, so it differs from the product of the averages."""

HEAT_STORAGE = "heat_storage"
"""Array, W/m3: rate of change of density times (enthalpy - that of ambient air)."""

NO_VELOCITIES = "the file has no velocities"

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


@frozen(eq=False)
class AirFlow:
    """Velocity of the air at the n points of a field."""

    velocity: FloatArray | None  # (n, 3), m/s, world
    # (n, 3), W/m2, world: `ENTHALPY_FLUX`, where the file has it or it follows from the cells of
    # an OpenFOAM case.
    enthalpy_flux: FloatArray | None = None
    storage: FloatArray | None = None  # (n,), W/m3: `HEAT_STORAGE`, where the file has it
    # Name and unit of the velocity's arrays, as read from the file.
    name: str = ""
    unit: str = SI
    flux_name: str = ""  # array of `enthalpy_flux`; "" if there is none or velocities gave it
    missing: str = ""  # why the velocity is missing


def flow_in(
    grid: pv.UnstructuredGrid,
    array: str,
    units: Mapping[str, str] | None,
    transform: ArrayLike | None,
    air: Air,
) -> AirFlow:
    """Velocity of the air in a file's linear volume cells.

    If `array` is an average of the temperature, the average of the velocity is used. Vectors are
    rotated and mirrored by the (4, 4) transform from file to world and keep their length. `units`
    are those of `readers.states.Contents`.
    """
    found, missing = velocity_arrays(grid, units, averaged=is_mean(array))
    if found is None:
        return AirFlow(None, missing=missing)
    turn = _rotation(transform)
    if turn is None:
        return AirFlow(
            None, missing="the field's transform distorts, and directions of velocities with it"
        )
    velocity = np.column_stack([_at_points(grid, name) for name in found.names])
    names = ", ".join(found.names)
    gaps = np.count_nonzero(~np.isfinite(velocity).all(axis=1))
    if gaps:
        are, them = ("is", "it") if len(found.names) == 1 else ("are", "them")
        return AirFlow(
            None,
            missing=f"{names} {are} not finite at {gaps:,} of {len(velocity):,} points; export "
            f"{them} without gaps",
        )
    flux, stated = None, ENTHALPY_FLUX in grid.point_data
    if stated:
        flux = _at_points(grid, ENTHALPY_FLUX)
    elif VELOCITY_OVER_TEMPERATURE in grid.point_data and (array, names) == (TEMPERATURE, VELOCITY):
        flux = state_heat(grid, air.temperature_k, air.pressure_pa)
    return AirFlow(
        velocity=found.factor * velocity @ turn.T,
        enthalpy_flux=None if flux is None else flux @ turn.T,
        storage=_at_points(grid, HEAT_STORAGE) if HEAT_STORAGE in grid.point_data else None,
        name=names,
        unit=found.unit,
        flux_name=ENTHALPY_FLUX if stated else "",
    )


def carried_heat(
    density_kg_m3: FloatArray,
    velocity: FloatArray,
    momentum: FloatArray,
    ambient_k: float,
    pressure_pa: float,
) -> FloatArray:
    """Average of f(rho) U with f = rho (h - h_ambient), (n, 3), W/m2.

    Computed from the averages of density <rho> (n,), kg/m3, velocity <U> (n, 3), m/s, and momentum
    <rho U> (n, 3), kg/(m2 s). At constant pressure f is linear in rho except for the change of the
    heat capacity (`heat_content_slope`), so to second order of the fluctuations it is::

        f(<rho>) <U> + f'(<rho>) (<rho U> - <rho> <U>)

    The neglected term is f''/2 times the average of (rho - <rho>)^2 U. It is 0.3 % of the flux
    where air of 650 K and 0.2 m/s alternates with air of 850 K and 0.9 m/s; the product of the
    averages is 6 % too small there.
    """
    kelvin = temperature_of_density(density_kg_m3, pressure_pa)
    together = momentum - density_kg_m3[:, None] * velocity
    content = heat_content(kelvin, ambient_k, pressure_pa)[:, None]
    flux: FloatArray = content * velocity
    return flux + heat_content_slope(kelvin, ambient_k)[:, None] * together


def state_heat(grid: pv.UnstructuredGrid, ambient_k: float, pressure_pa: float) -> FloatArray:
    """Heat that the air of one state of an OpenFOAM case carries at its points, (n, 3), W/m2."""
    rho = density(grid.point_data[TEMPERATURE], pressure_pa)
    momentum = density(1.0, pressure_pa) * _at_points(grid, VELOCITY_OVER_TEMPERATURE)
    return carried_heat(rho, _at_points(grid, VELOCITY), momentum, ambient_k, pressure_pa)


def _at_points(grid: pv.UnstructuredGrid, name: str) -> FloatArray:
    if name in grid.point_data:
        return np.asarray(grid.point_data[name], dtype=np.float64)
    return point_means(grid, np.asarray(grid.cell_data[name], dtype=np.float64))


def _rotation(transform: ArrayLike | None) -> FloatArray | None:
    """Rotation and mirroring (3, 3) in a transform; None if the transform also distorts."""
    if transform is None:
        return np.eye(3)
    linear = np.asarray(transform, dtype=np.float64)[:3, :3]
    turn: FloatArray = linear / np.cbrt(abs(np.linalg.det(linear)))
    return turn if np.allclose(turn @ turn.T, np.eye(3), atol=1e-6) else None


@frozen
class VelocityArrays:
    """Arrays that hold the velocity."""

    names: tuple[str, ...]  # one array of vectors, or three of numbers along x, y and z
    factor: float  # m/s per unit of the array
    unit: str  # as the file states it; m/s where it states none


def velocity_arrays(
    grid: pv.UnstructuredGrid, units: Mapping[str, str] | None, *, averaged: bool = False
) -> tuple[VelocityArrays | None, str]:
    """Find the velocity among the arrays of a grid.

    A vector array with a usual name (``U``, ``Velocity field``) takes precedence over three
    components (COMSOL's ``u``, ``v``, ``w``; ``Velocity field, x-component``), and these over a
    vector whose name only resembles a usual one. Arrays whose unit is not a velocity are ignored
    (displacements are called u, v, w too); where the file states no unit it is m/s. With
    `averaged` a time average (``UMean``) is preferred, because the temperature is an average too.
    If no velocity is found, the returned text says why.
    """
    shapes: dict[str, tuple[int, ...]] = {}
    for data in (grid.point_data, grid.cell_data):
        for name in data:
            if data[name].dtype.kind in "fi":
                shapes.setdefault(name, data[name].shape[1:])
    by_name = {_plain(name): name for name, shape in shapes.items() if shape == (3,)}
    usual = [name for plain, name in by_name.items() if plain in _USUAL]
    means = [name for plain, name in by_name.items() if _MEAN.fullmatch(plain)]
    loose = [name for plain, name in by_name.items() if _LOOSE.fullmatch(plain)]
    families = _families(name for name, shape in shapes.items() if shape == ())
    components = [tuple(f[axis] for axis in range(3)) for f in families.values() if len(f) == 3]
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
        refused = f"the unit of {', '.join(names)} is not a velocity"
    if refused:
        return None, refused
    for family, found in families.items():
        # A single v or w can be anything.
        telling = len(found) == 2 or (len(found) == 1 and family != ("", "uvw", ""))
        if telling and all(_factor(name, units) is not None for name in found.values()):
            there = " and ".join(found[axis] for axis in sorted(found))
            return None, f"it has only {there} of 3 components"
    for name, shape in shapes.items():
        if shape != (3,) and _is_velocity(name) and _factor(name, units) is not None:
            width = shape[0] if shape else 1
            return None, f"{name} has {width} component{'s' * (width > 1)}, 3 are needed"
    return None, NO_VELOCITIES


def is_motion(name: str) -> bool:
    """True for a vector array with the name of a velocity."""
    return name in (MOMENTUM_MEAN, VELOCITY_OVER_TEMPERATURE) or _is_velocity(name)


def _is_velocity(name: str) -> bool:
    plain = _plain(name)
    return plain in _USUAL or any(pattern.fullmatch(plain) for pattern in (_MEAN, _LOOSE))


def is_mean(name: str) -> bool:
    """True for a name that states an average over time."""
    return re.search(r"mean|averag", name, re.IGNORECASE) is not None


def _families(names: Iterable[str]) -> dict[tuple[str, str, str], dict[int, str]]:
    """Components by axis for each plain name without its axis: text before, axes, text after."""
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


def _factor(name: str, units: Mapping[str, str] | None) -> float | None:
    """Factor that converts an array's unit to m/s; None if the unit is not a velocity."""
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
    """Name in lower case without unit and COMSOL's scope: ``comp1.Velocity (m/s)`` -> velocity."""
    bare = _BRACKETS.sub("", name).rpartition(".")[2]
    return re.sub(r"[^a-z0-9]+", "_", bare.lower()).strip("_")
