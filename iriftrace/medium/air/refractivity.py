"""Refractive index of air: Ciddor and Edlen near room temperature, density scaling for hot air."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Literal

import numpy as np
from attrs import astuple, evolve, field, frozen
from numpy.typing import ArrayLike

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.units import ZERO_CELSIUS_K, Pressure, Temperature, Wavelength

AirModel = Callable[[float, ArrayLike, ArrayLike, ArrayLike, float], FloatArray]

GAS_CONSTANT = 8.314472  # J/(mol K), the value of Ciddor's time
_WATER_MOLAR_MASS = 0.018015  # kg/mol

WAVELENGTH_RANGE = (300.0, 1700.0)  # nm
TEMPERATURE_RANGE = (233.15, 373.15)  # K, -40 to 100 degC
PRESSURE_RANGE = (60e3, 120e3)  # Pa
CO2_RANGE = (0.0, 2000.0)  # ppm
_AMBIENT = "give it in K or with its unit, and of the air far from the part, which is not heated"


def ciddor(
    wavelength_nm: float,
    temperature_k: ArrayLike,
    pressure_pa: ArrayLike,
    relative_humidity: ArrayLike = 0.0,
    co2_ppm: float = 450.0,
) -> FloatArray:
    """Refractivity n - 1 of moist air after Ciddor, of the shape to which the arguments broadcast.

    P. E. Ciddor, "Refractive index of air: new equations for the visible and near infrared",
    Applied Optics 35 (1996) 1566, in the step order of NIST's engineering metrology toolbox. Holds
    for vacuum wavelengths of 300 to 1700 nm, 233.15 to 373.15 K (-40 to 100 degC), 60 to 120 kPa, a
    relative humidity of 0 to 1, over ice below 0 degC, and 0 to 2000 ppm (micromol/mol) of carbon
    dioxide; raises InputError for an argument outside these ranges.
    """
    _check_ranges(wavelength_nm, temperature_k, pressure_pa, relative_humidity, co2_ppm)
    temperature, pressure = np.asarray(temperature_k, float), np.asarray(pressure_pa, float)
    s = (1e3 / wavelength_nm) ** 2  # um^-2
    standard_air = 1e-8 * (5792105.0 / (238.0185 - s) + 167917.0 / (57.362 - s))
    dry_air = standard_air * (1.0 + 0.534e-6 * (co2_ppm - 450.0))
    vapour = 1.022e-8 * (295.235 + s * (2.6422 + s * (-0.032380 + s * 0.004028)))

    water = water_fraction(temperature, pressure, relative_humidity)
    molar_volume = (
        _compressibility(temperature, pressure, water) * GAS_CONSTANT * temperature / pressure
    )
    dry_density = (1.0 - water) * dry_air_molar_mass(co2_ppm) / molar_volume
    vapour_density = water * _WATER_MOLAR_MASS / molar_volume
    # Reference states of Ciddor's appendix B: dry air at 15 degC and 101325 Pa, and the density
    # of pure vapour at 20 degC and 1333 Pa.
    dry_reference = 101325.0 * dry_air_molar_mass(co2_ppm) / (0.9995922115 * GAS_CONSTANT * 288.15)
    moist_air: FloatArray = dry_density / dry_reference * dry_air
    moist_air += vapour_density / 0.00985938 * vapour
    return moist_air


def edlen(
    wavelength_nm: float,
    temperature_k: ArrayLike,
    pressure_pa: ArrayLike,
    relative_humidity: ArrayLike = 0.0,
    co2_ppm: float = 450.0,
) -> FloatArray:
    """Refractivity of moist air after Edlen, as modified by Birch and Downs.

    K. P. Birch and M. J. Downs, Metrologia 30 (1993) 155 and 31 (1994) 315, in the form of NIST's
    engineering metrology toolbox, which holds for 450 ppm of carbon dioxide. Other contents scale
    the refractivity of dry air as in Ciddor's equation. Parameters, result and errors are those
    of `ciddor`; away from room temperature `ciddor` is the better one.
    """
    _check_ranges(wavelength_nm, temperature_k, pressure_pa, relative_humidity, co2_ppm)
    temperature, pressure = np.asarray(temperature_k, float), np.asarray(pressure_pa, float)
    celsius = temperature - ZERO_CELSIUS_K
    s = (1e3 / wavelength_nm) ** 2  # um^-2
    standard = 1e-8 * (8342.54 + 2406147.0 / (130.0 - s) + 15998.0 / (38.9 - s))
    density = (1.0 + 1e-8 * (0.601 - 0.00972 * celsius) * pressure) / (1.0 + 0.003661 * celsius)
    dry = pressure * standard * density / 96095.43
    vapour = np.asarray(relative_humidity, float) * saturation_pressure(temperature)
    moist = 1e-10 * (292.75 / temperature) * (3.7345 - 0.0401 * s) * vapour
    refractivity: FloatArray = dry * (1.0 + 0.534e-6 * (co2_ppm - 450.0)) - moist
    return refractivity


def saturation_pressure(temperature_k: ArrayLike) -> FloatArray:
    """Saturation pressure of water vapour in Pa, over ice below 0 degC.

    Equations of IAPWS (1997 over water, 1993 over ice) as in NIST's engineering metrology toolbox.
    """
    temperature = np.asarray(temperature_k, float)
    omega = temperature - 2.38555575678e-1 / (temperature - 6.50175348448e2)
    a = omega**2 + 1.16705214528e3 * omega - 7.24213167032e5
    b = -1.70738469401e1 * omega**2 + 1.20208247025e4 * omega - 3.23255503223e6
    c = 1.49151086135e1 * omega**2 - 4.82326573616e3 * omega + 4.05113405421e5
    water = 1e6 * (2.0 * c / (-b + np.sqrt(b**2 - 4.0 * a * c))) ** 4
    theta = temperature / 273.16
    ice = 611.657 * np.exp(-13.928169 * (1.0 - theta**-1.5) + 34.7078238 * (1.0 - theta**-1.25))
    return np.where(temperature < ZERO_CELSIUS_K, ice, water)


def water_fraction(
    temperature_k: ArrayLike, pressure_pa: ArrayLike, relative_humidity: ArrayLike
) -> FloatArray:
    """Molar fraction of water vapour, with Ciddor's enhancement factor (appendix A)."""
    celsius = np.asarray(temperature_k, float) - ZERO_CELSIUS_K
    pressure = np.asarray(pressure_pa, float)
    enhancement = 1.00062 + 3.14e-8 * pressure + 5.60e-7 * celsius**2
    vapour = np.asarray(relative_humidity, float) * saturation_pressure(temperature_k)
    fraction: FloatArray = enhancement * vapour / pressure
    return fraction


def dry_air_molar_mass(co2_ppm: float) -> float:
    """Molar mass of dry air in kg/mol (Ciddor 1996, appendix A)."""
    return 0.0289635 + 1.2011e-8 * (co2_ppm - 400.0)


MODELS: dict[str, AirModel] = {"ciddor": ciddor, "edlen": edlen}


@frozen
class Air:
    """Air around a hot part: its state far away, and how hotter air differs from it.

    Hot air is far outside the range of Ciddor's and Edlen's equations. At constant pressure and
    composition n - 1 is proportional to the density (Gladstone and Dale) and the density to 1/T
    (ideal gas), so hot air is the ambient air scaled by T_ambient/T.

    Parameters
    ----------
    wavelength_nm
        Wavelength of the light.
    temperature_k
        Temperature of the ambient air.
    pressure_pa
        Air pressure.
    relative_humidity
        Relative humidity, 0 to 1.
    co2_ppm
        Carbon dioxide in ppm.
    model
        Formula for the ambient air; hot air is scaled by its density.
    """

    wavelength_nm: Wavelength = field(default=Wavelength(633.0), converter=Wavelength)
    temperature_k: Temperature = field(default=Temperature("20 degC"), converter=Temperature)
    pressure_pa: Pressure = field(default=Pressure(101325.0), converter=Pressure)
    relative_humidity: float = field(default=0.0, converter=float)
    co2_ppm: float = field(default=450.0, converter=float)
    model: Literal["ciddor", "edlen"] = "ciddor"

    def __attrs_post_init__(self) -> None:
        """Refuse states outside the range of the equations at once."""
        if self.model not in MODELS:
            raise InputError(
                f"There is no model of air named {self.model!r}; use one of {', '.join(MODELS)}.",
                code="air.unknown_model",
                argument="air_model",
            )
        _check_ranges(*astuple(self)[:5])

    @cached_property
    def ambient_refractivity(self) -> float:
        """Refractivity n - 1 of the ambient air."""
        return float(MODELS[self.model](*astuple(self)[:5]))

    @cached_property
    def ambient_density(self) -> float:
        """Density of the ambient air in kg/m3, as an ideal gas."""
        water = float(water_fraction(self.temperature_k, self.pressure_pa, self.relative_humidity))
        mass = (1.0 - water) * dry_air_molar_mass(self.co2_ppm) + water * _WATER_MOLAR_MASS
        return self.pressure_pa * mass / (GAS_CONSTANT * self.temperature_k)

    def refractivity(self, temperature_k: ArrayLike) -> FloatArray:
        """Refractivity n - 1 of this air at other temperatures (K) and the ambient pressure."""
        temperature = _positive(temperature_k, "temperature", "K")
        return self.ambient_refractivity * self.temperature_k / temperature

    def refractivity_of_density(self, density_kg_m3: ArrayLike) -> FloatArray:
        """Refractivity n - 1 of this air at other densities (kg/m3)."""
        density = _positive(density_kg_m3, "density", "kg/m3")
        return self.ambient_refractivity * density / self.ambient_density

    def temperature(self, refractivity: ArrayLike) -> FloatArray:
        """Temperature in K at which this air has a refractivity; inverse of `refractivity`."""
        value = _positive(refractivity, "refractivity n-1", "")
        return self.temperature_k * self.ambient_refractivity / value


def _compressibility(
    temperature: FloatArray, pressure: FloatArray, water: FloatArray
) -> FloatArray:
    """Compressibility Z of moist air (Ciddor 1996, equation 12, after the BIPM of 1991)."""
    celsius = temperature - ZERO_CELSIUS_K
    first = 1.58123e-6 - 2.9331e-8 * celsius + 1.1043e-10 * celsius**2
    first = first + (5.707e-6 - 2.051e-8 * celsius) * water
    first = first + (1.9898e-4 - 2.376e-6 * celsius) * water**2
    second = 1.83e-11 - 0.765e-8 * water**2
    ratio = pressure / temperature
    return 1.0 - ratio * first + ratio**2 * second


def _check_ranges(
    wavelength_nm: ArrayLike,
    temperature_k: ArrayLike,
    pressure_pa: ArrayLike,
    relative_humidity: ArrayLike,
    co2_ppm: ArrayLike,
) -> None:
    for name, argument, value, (low, high), unit, hint in (
        ("wavelength", "wavelength", wavelength_nm, WAVELENGTH_RANGE, " nm", "give it in nm"),
        ("ambient temperature", "ambient", temperature_k, TEMPERATURE_RANGE, " K", _AMBIENT),
        ("pressure", "pressure", pressure_pa, PRESSURE_RANGE, " Pa", "give it with its unit"),
        ("relative humidity", "humidity", relative_humidity, (0.0, 1.0), "", "50 % is 0.5"),
        ("CO2 content", "co2", co2_ppm, CO2_RANGE, " ppm", "give it in ppm"),
    ):
        array = np.asarray(value, float)
        slack = 1e-9 * high  # -40 degC in floating point is a little colder than 233.15 K
        wrong = array[~((array >= low - slack) & (array <= high + slack))]
        if wrong.size:
            raise InputError(
                f"The {name} {wrong.flat[0]:g}{unit} is outside {low:g} to {high:g}{unit}, where "
                f"the equations for the index of air hold; {hint}.",
                code="air.out_of_range",
                argument=argument,
            )


def _positive(value: ArrayLike, name: str, unit: str) -> FloatArray:
    array = np.asarray(value, float)
    wrong = array[~(np.isfinite(array) & (array > 0.0))]
    if wrong.size:
        raise InputError(
            f"A {name} of {wrong.flat[0]:g} {unit}".rstrip()
            + " does not exist in air; it must be positive and finite.",
            code="air.not_positive",
        )
    return array


def dispersion(air: Air | None, wavelength_nm: float) -> float:
    """By how much n - 1 of an air is larger at another wavelength; InputError if not known."""
    if air is None:
        raise InputError(
            f"The scene does not state its air, so n - 1 at {wavelength_nm:g} nm is not known; "
            "make the scene for this wavelength.",
            code="air.not_stated",
        )
    there = evolve(air, wavelength_nm=wavelength_nm)
    return there.ambient_refractivity / air.ambient_refractivity
