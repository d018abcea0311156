r"""Derivative of a measured diameter by the temperatures of the air, by one reverse pass a device.

The device that is traced forward keeps its lines of sight (the camera's pixels, a laser's sheet);
their refracted rays end on the part at :math:`X = h_1(T)`. The other device sees X along the
direction whose refracted ray ends there, :math:`h_2(b, T) = X`. To first order, the hit of a ray
that is turned moves like that of a straight line, so the line passes the point at an offset of

.. math:: d\delta = (I - b b^T) (dh_1 - dh_2)

with the changes dh of the hits at constant rays: where the hits move by dh, a point is seen along a
line that is displaced by -dh. The neglected change of the deflection with the direction is 1e-3 of
it on a part's side. The measured point X' moves by :math:`M d\delta` with the linear map M of the
intersection (`first_order_error`), and the diameter by :math:`\sum g \cdot dX'` (`size_gradient`):

.. math:: dD = \sum w \cdot (dh_1 - dh_2), \quad w = (I - b b^T) M^T g.

One reverse pass with w for the first device and one with -w for the other give the derivatives by
all temperatures (`iriftrace.hits`).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
from attrs import Factory, frozen

from iriftrace.core.arrays import FloatArray, IntArray, as_float64
from iriftrace.core.errors import InputError
from iriftrace.core.files import write_json
from iriftrace.core.plain import JsonObject
from iriftrace.io.vtk_write import write_vtk
from iriftrace.measuring.features.choice import FeatureChoice, checked_choices
from iriftrace.measuring.features.feature import Feature
from iriftrace.measuring.features.size_gradient import size_gradient
from iriftrace.measuring.options import GATE, Phase
from iriftrace.measuring.two_devices.devices import Sensor, sensor_of
from iriftrace.measuring.two_devices.first_order import first_order_error
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.measuring.two_devices.scan import Scan
from iriftrace.measuring.two_devices.two_points import lines_of_sight
from iriftrace.medium.path_data import FieldCells, excess_at
from iriftrace.part.part import Part
from iriftrace.tracing.adjoint import temperature_gradient
from iriftrace.tracing.scene import Scene, ready_scene
from iriftrace.tracing.second_options import System

SCHEMA = "iriftrace.sensitivity/1"
"""Value of ``schema`` in the JSON."""

EFFECT_COLUMN = "effect_of_1_percent"
"""Point data of the .vtu with `Sensitivity.effect_nm`."""

MOST = 0.8
"""Fraction of the effect of the air whose distance from the part is stated."""


@frozen(eq=False)
class Sensitivity:
    """Derivative of a measured diameter by the temperatures of the air.

    Attributes
    ----------
    name : str
        The feature, such as "cylinder:lateral".
    scan : Scan
        The simulated measurement.
    cold_mm, measured_mm : float
        Diameters without and with hot air.
    points : int
        Number of points that were fitted.
    cells : FieldCells
        The air, whose m points have the derivatives.
    gradient : (m,) array, mm/K
    distance : (m,) array, mm
        Of these points from the part.
    effects : dict of float, mm
        Change of the diameter to first order by the name of an input.
    """

    name: str
    scan: Scan
    cold_mm: float
    measured_mm: float
    points: int
    cells: FieldCells
    gradient: FloatArray
    distance: FloatArray
    effects: dict[str, float] = Factory(dict)

    def __repr__(self) -> str:
        return f"Sensitivity({self.name}: {self.sentence})"

    @cached_property
    def temperature(self) -> FloatArray:
        """(m,) array, K."""
        return self.cells.air.temperature(self.cells.refractivity)

    @cached_property
    def of_air(self) -> FloatArray:
        """(m,) array, mm: derivative times excess temperature, of which the size is the effect."""
        return self.gradient * (self.temperature - self.cells.air.temperature_k)

    @property
    def effect_nm(self) -> FloatArray:
        """(m,) array, nm: effect of 1 % of the excess temperature."""
        return 1e4 * self.of_air

    @cached_property
    def by_distance(self) -> tuple[FloatArray, FloatArray]:
        """Distances (m,) from the part, mm, rising, and fractions of the sizes of `of_air` there.

        Each fraction is that of all points up to the distance.
        """
        order = np.argsort(self.distance)
        total = np.cumsum(np.abs(self.of_air[order]))
        return self.distance[order], total / max(float(total[-1]), 1e-300)

    def within(self, fraction: float) -> float:
        """Distance from the part, mm, within which this fraction of the sizes of `of_air` lies."""
        distances, fractions = self.by_distance
        place = int(np.searchsorted(fractions, fraction))
        return float(distances[min(place, len(distances) - 1)])

    @property
    def sentence(self) -> str:
        """Where the air is that moves the diameter, without a full stop."""
        where = f"{self.within(MOST):.1f} mm of the part"
        return f"{100 * MOST:g} % of what moves this diameter lies within {where}"

    def as_dict(self) -> JsonObject:
        """Plain JSON values, schema `SCHEMA`."""
        return {
            "schema": SCHEMA,
            **self.scan.provenance,
            "feature": self.name,
            "points": self.points,
            "size_mm": {"cold": self.cold_mm, "measured": self.measured_mm},
            "within_mm": {f"{share:g}": self.within(share) for share in (0.5, MOST, 0.95)},
            "effects_mm": self.effects,
        }

    def save(self, path: str | Path) -> tuple[Path, Path]:
        """Write the derivatives (.vtu) and, next to them, the numbers (.json).

        Point data: ``T`` (K), ``d_size_d_T`` (um/K), the same per volume of air,
        ``d_size_d_T_per_cm3`` (um/K/cm3), ``effect_of_1_percent`` (nm), `effect_nm`, and
        ``distance`` from the part (mm).
        """
        path = Path(path)
        grid, um = self.cells.grid(), 1e3 * self.gradient
        volume = 1e-3 * _point_volumes(self.cells)
        grid.point_data["T"] = self.temperature
        grid.point_data["d_size_d_T"] = um
        grid.point_data["d_size_d_T_per_cm3"] = np.divide(
            um, volume, out=np.zeros_like(um), where=volume > 0.0
        )
        grid.point_data[EFFECT_COLUMN] = self.effect_nm
        grid.point_data["distance"] = self.distance
        write_vtk(path, grid)
        numbers = path.with_suffix(".json")
        write_json(numbers, self.as_dict())
        return path, numbers


def sensitivity(
    scene: Scene,
    feature: str | FeatureChoice,
    *,
    gate: float | None = GATE,
    system: System | None = None,
    phase: Phase | None = None,
) -> Sensitivity:
    """Differentiate a measured diameter by the temperatures at all points of the air.

    The measurement of two devices is simulated as by :func:`iriftrace.measure` through the cells of
    the field, of an ensemble through those of the member with the largest weight. Outliers are
    constants. Derivatives hold for rays that keep their faces, as for :func:`iriftrace.hits`; they
    agree with differences of measurements to 1e-2.

    The effects are those of 1 % more contrast of the air and, of an ensemble, of each other member
    in place of this one, to first order; of a member that was solved again, in place of the one
    that it varies.

    Parameters
    ----------
    scene : Scene
        With two devices, and the field's cells.
    feature : str or FeatureChoice
        One cylinder, cone, sphere or circle, such as "cylinder:lateral".
    gate, system, phase
        As of `Scan.features` and :func:`iriftrace.measure`.

    Raises
    ------
    InputError
        As `measure`; if there is no field, not exactly one diameter, or members on other meshes.
    """
    ready = ready_scene(scene)
    choices = checked_choices([feature], ready.part)
    heaviest = int(np.argmax(ready.weights.weights)) if ready.members else 0
    base = next(iter(ready.alone([heaviest])))
    traced = base if base.compiled.engine.through_cells else base.with_cells()
    scan = measure(traced, system=system, phase=phase)
    _, sensor = sensor_of(traced, None, None, system, phase)
    fitted = scan.features(traced.part, choices, gate)
    if len(fitted) != 1:
        found = ", ".join(one.name for one in fitted) or "none"
        raise InputError(
            f"{feature} is not one feature of the measured points, but a derivative is that of one "
            f"diameter ({found}); choose one with its region, such as cylinder:lateral.",
            code="feature.not_one",
            argument="feature",
        )
    (one,) = fitted
    bundles = _bundles(traced, sensor, scan, one.rows, one.fits["measured"])
    gradient = temperature_gradient(traced, bundles)
    cells: FieldCells = traced.compiled.integrator.air.cells
    cold, measured = (one.fits[name].size_mm or 0.0 for name in ("cold", "measured"))
    return Sensitivity(
        name=one.name,
        scan=scan,
        cold_mm=cold,
        measured_mm=measured,
        points=one.points,
        cells=cells,
        gradient=gradient,
        distance=_distance(cells, traced.part),
        effects=_effects(ready, heaviest, cells, gradient),
    )


def _bundles(
    scene: Scene, sensor: Sensor, scan: Scan, rows: IntArray, fit: Feature
) -> Sequence[tuple[FloatArray, FloatArray, FloatArray]]:
    """Rays of both devices to the fitted points, and the weights of their hits."""
    true, seen = scan.true[rows], scan.points[rows]
    sheet = sensor.system == "laser"
    forward, solved = reversed(sensor.devices) if sheet else sensor.devices
    lines = [lines_of_sight(scene, one.origin, true) for one in (forward, solved)]
    found = np.logical_and(*(one.found for one in lines))
    none = np.zeros_like(seen)
    by_axis = []
    for axis in np.eye(3):
        offset = np.broadcast_to(axis, seen.shape)
        pair = (offset, none) if sheet else (none, offset)
        by_axis.append(first_order_error(sensor, seen, *pair))
    by_size = size_gradient(fit, seen) * found[:, None]
    weights = np.einsum("ij,kij->ik", by_size, np.array(by_axis))
    sight = lines[1].direction
    weights -= sight * np.vecdot(weights, sight)[:, None]
    return [
        (np.broadcast_to(one.origin, seen.shape), line.direction, sign * weights)
        for one, line, sign in zip((forward, solved), lines, (1.0, -1.0), strict=True)
    ]


def _distance(cells: FieldCells, part: Part) -> FloatArray:
    """Distances (m,), mm, of the points of the air from a part; 0 at its wall."""
    return np.where(cells.wall, 0.0, part.surface.distance(cells.points))


def _point_volumes(cells: FieldCells) -> FloatArray:
    """Volume of the air (m,), mm3, by points: each cell's in equal parts to its corners."""
    sizes = cells.grid().compute_cell_sizes(length=False, area=False)
    corners = np.diff(cells.cell_offsets)
    share = np.repeat(np.abs(sizes.cell_data["Volume"]) / corners, corners)
    return as_float64(np.bincount(cells.cell_connectivity, share, len(cells.points)))


def _effects(
    scene: Scene, heaviest: int, cells: FieldCells, gradient: FloatArray
) -> dict[str, float]:
    """`Sensitivity.effects` of the contrast and of an ensemble's other members."""
    air = cells.air
    kelvin = air.temperature(cells.refractivity)
    # n - 1 is proportional to 1 / T.
    by_excess = -gradient * kelvin**2 / (air.ambient_refractivity * air.temperature_k)
    excess = cells.refractivity - cells.ambient
    found = {"contrast +1 %": 0.01 * float(by_excess @ excess)}
    place = {one.source.sha256: number for number, one in enumerate(scene.members)}
    known = {heaviest: excess}
    for number, member in enumerate(scene.members):
        variation = member.variation
        start = heaviest if variation is None else place[variation.of]
        if number == start:
            continue
        for needed in (number, start):
            if needed not in known:
                other = scene.air.states[needed].cells
                if scene.wavelength_nm is not None:
                    other = other.at_wavelength(scene.wavelength_nm)
                known[needed] = excess_at(cells, other)
        name = member.label or f"member {member.number}"
        if variation is not None:
            name += f" ({variation.text})"
        found[name] = float(by_excess @ (known[number] - known[start]))
    return found
