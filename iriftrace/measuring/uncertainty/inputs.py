"""Standard uncertainties of the inputs of a correction, as a user states them."""

from __future__ import annotations

import math

from attrs import Attribute, field, frozen

from iriftrace.core.errors import InputError
from iriftrace.core.units import named_quantities


def _name(attribute: Attribute[float | None]) -> str:
    """The input as it is named in `Inputs.of`."""
    return next(name for name, (field_name, _) in NAMES.items() if field_name == attribute.name)


def _uncertainty(_: object, attribute: Attribute[float | None], value: float | None) -> None:
    if value is not None and not 0.0 <= value < math.inf:
        raise InputError(
            f"The uncertainty of {_name(attribute)} is {value:g}; give 0 or a positive number.",
            code="uncertainty.negative",
            argument="uncertainty",
        )


def _fraction(_: object, attribute: Attribute[float | None], value: float | None) -> None:
    if value is not None and not 0.0 <= value < 1.0:
        raise InputError(
            f"The uncertainty of {_name(attribute)} is {value:g}, but it is a fraction; give one "
            "from 0 to 1, such as 0.05 (5 %).",
            code="uncertainty.no_fraction",
            argument="uncertainty",
        )


def _number(_: object, __: Attribute[float | None], value: float | None) -> None:
    if value is not None and not 1.0 <= value < math.inf:
        raise InputError(
            f"The number of independent states is {value:g}, but a measurement sees at least one; "
            "give 1 or more.",
            code="uncertainty.few_states",
            argument="uncertainty",
        )


@frozen(kw_only=True)
class Inputs:
    """Standard uncertainties of what a correction rests on; None where one is not stated.

    Attributes
    ----------
    air : float or None
        Of the air's contrast in refractive index, n - n of the ambient air, as a fraction. It
        adds to what members say; without them it stands for all that is not known of the air.
    mesh : float or None
        Of the effect of the air by the mesh and model of the flow solution, as a fraction.
    numerics : float or None
        Of the effect of the air by the tracing in the field's mesh, as a fraction (`known_air`).
    wall_k, ambient_k : float or None, K
        Of the temperatures of the part's wall and of the ambient air.
    pressure_pa : float or None, Pa
        Of the air pressure.
    humidity : float or None
        Of the relative humidity, 0 to 1.
    states : float or None
        Number of independent states of unsteady air that the measurement averages; no uncertainty,
        but it divides the variance by the air's unsteadiness. 1 by default.
    position_mm : float or None, mm
        Of the projection centre of each device along each axis, in the scene (`two_devices.poses`).
    rotation_rad : float or None, rad
        Of each device about each axis through its projection centre.
    sensor_mm : float or None, mm
        Of one measured point along the normal; independent of the other points. By default by the
        scatter of the points about each feature; not known of simulated ones, which have no noise.
    expansion : float or None
        Of the part's thermal expansion, as a fraction.
    part_temperature_k : float or None, K
        Of the temperature by which the part grew.
    other_mm : float or None, mm
        Of a length by all else that does not come from the air, such as the sensor's scale or a
        warm window; not of angles.
    """

    air: float | None = field(default=None, validator=_fraction)
    mesh: float | None = field(default=None, validator=_fraction)
    numerics: float | None = field(default=None, validator=_fraction)
    wall_k: float | None = field(default=None, validator=_uncertainty)
    ambient_k: float | None = field(default=None, validator=_uncertainty)
    pressure_pa: float | None = field(default=None, validator=_uncertainty)
    humidity: float | None = field(default=None, validator=_fraction)
    states: float | None = field(default=None, validator=_number)
    position_mm: float | None = field(default=None, validator=_uncertainty)
    rotation_rad: float | None = field(default=None, validator=_uncertainty)
    sensor_mm: float | None = field(default=None, validator=_uncertainty)
    expansion: float | None = field(default=None, validator=_fraction)
    part_temperature_k: float | None = field(default=None, validator=_uncertainty)
    other_mm: float | None = field(default=None, validator=_uncertainty)

    @classmethod
    def of(cls, text: str) -> Inputs:
        """Inputs of ``"wall 10 K, ambient 2 K, pressure 2 hPa, sensor 8 um, air 5 %"``.

        Raises InputError for an unknown name, a number without its unit, or one given twice.
        """
        units = {name: unit for name, (_, unit) in NAMES.items()}
        try:
            found = named_quantities(text, units)
        except ValueError as error:
            raise InputError(
                f"Among the uncertainties {error}.",
                code="uncertainty.not_read",
                argument="uncertainty",
            ) from None
        return cls(**{NAMES[name][0]: value for name, value in found.items()})

    @property
    def relative(self) -> float:
        """Relative standard uncertainty of the air's effect by all that scales it as a whole."""
        return math.hypot(self.air or 0.0, self.mesh or 0.0, self.numerics or 0.0)

    @property
    def of_pose(self) -> bool:
        """True if the pose of the devices is uncertain."""
        return bool(self.position_mm or self.rotation_rad)

    def stated(self) -> dict[str, float]:
        """The values that are stated, by the names of `of`."""
        values = {name: getattr(self, attribute) for name, (attribute, _) in NAMES.items()}
        return {name: value for name, value in values.items() if value is not None}


NAMES = {
    "air": ("air", "dimensionless"),
    "mesh": ("mesh", "dimensionless"),
    "numerics": ("numerics", "dimensionless"),
    "wall": ("wall_k", "K"),
    "ambient": ("ambient_k", "K"),
    "pressure": ("pressure_pa", "pascal"),
    "humidity": ("humidity", "dimensionless"),
    "states": ("states", "dimensionless"),
    "position": ("position_mm", "mm"),
    "rotation": ("rotation_rad", "radian"),
    "sensor": ("sensor_mm", "mm"),
    "expansion": ("expansion", "dimensionless"),
    "part": ("part_temperature_k", "K"),
    "other": ("other_mm", "mm"),
}
"""Attribute and unit of each input by its name in `Inputs.of`."""

NOTHING_STATED = Inputs()
"""No uncertainty is stated."""
