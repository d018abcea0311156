"""Options about the air around the part."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from attrs import frozen
from cyclopts import Group, Parameter

from iriftrace.cli.options import quantity

if TYPE_CHECKING:
    from iriftrace.air import Air

AIR = Group("Air", sort_key=1)


@Parameter(name="*", group=AIR)
@frozen
class AirOptions:
    """The air around the part.

    Parameters
    ----------
    wavelength
        Wavelength of the light.
    ambient
        Temperature of the ambient air.
    pressure
        Air pressure.
    humidity
        Relative humidity, 0 to 1.
    co2
        Carbon dioxide in ppm.
    air_model
        Formula for the ambient air; hot air is scaled by its density.
    """

    wavelength: str = "633 nm"
    ambient: str = "20 degC"
    pressure: str = "101325 Pa"
    humidity: float = 0.0
    co2: float = 450.0
    air_model: Literal["ciddor", "edlen"] = "ciddor"

    def air(self) -> Air:
        """The air these options describe."""
        from iriftrace.air import Air

        return Air(
            wavelength_nm=quantity(self.wavelength, "nm", "--wavelength"),
            temperature_k=quantity(self.ambient, "kelvin", "--ambient"),
            pressure_pa=quantity(self.pressure, "pascal", "--pressure"),
            relative_humidity=self.humidity,
            co2_ppm=self.co2,
            model=self.air_model,
        )
