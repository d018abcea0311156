"""The image sensor: from radiance to the grey values of a picture, after EMVA 1288."""

from __future__ import annotations

import numpy as np
from attrs import field, fields, frozen
from attrs.converters import optional as if_given
from numpy.typing import NDArray
from scipy.constants import c, h

from iriftrace.core.arrays import FloatArray, as_float64
from iriftrace.core.errors import InputError
from iriftrace.core.units import Duration, FNumber, Wavelength

WHITE = 65535
"""Largest grey value of 16 bits, DN."""

BRIGHTEST = 0.999
"""Quantile of a picture's pixels by which the exposure is chosen; reflexes may be brighter."""

FILLED = 0.8
"""Fraction of the full well that these pixels fill then."""


@frozen
class ImageSensor:
    """Lens, filter and image sensor; linear model of EMVA 1288, release 4.0, without nonuniformity.

    Grey value = gain (electrons + dark noise) + offset, rounded to 16 bits. The number of electrons
    follows Poisson's distribution and ends at the full well.

    Parameters
    ----------
    exposure
        Exposure time, "5 ms"; by default that at which the brightest pixels fill 80 % of the full
        well.
    f_number
        Of the lens, "f/8", which images without vignetting and blur.
    bandwidth
        Width of the filter in front of it, around the scene's wavelength.
    quantum_efficiency
        Electrons per photon.
    full_well
        Saturation capacity, electrons.
    dark_noise
        Standard deviation of a pixel in the dark, read noise included, electrons.
    dark_current
        Electrons per second.
    gain
        Overall system gain K, DN per electron.
    offset
        Grey value in the dark, DN.
    """

    exposure: Duration | None = field(default=None, converter=if_given(Duration))
    f_number: FNumber = field(default=FNumber(8.0), converter=FNumber)
    bandwidth: Wavelength = field(default=Wavelength(10.0), converter=Wavelength)
    quantum_efficiency: float = 0.6
    full_well: float = 12_000.0
    dark_noise: float = 4.0
    dark_current: float = 10.0
    gain: float = 5.0
    offset: float = 200.0

    def __attrs_post_init__(self) -> None:
        may_be_0 = ("dark_noise", "dark_current", "offset")
        for name in (one.name for one in fields(type(self))):
            value = getattr(self, name)
            least = 0.0 if name in may_be_0 else np.nextafter(0.0, 1.0)
            if value is not None and not (least <= value < np.inf):
                raise InputError(
                    f"{name} of the image sensor is {value:g}, with which no picture forms; give "
                    "a positive number.",
                    code="photo.image_sensor",
                    argument=name,
                )

    def electrons(self, radiance: FloatArray, area_mm2: float, wavelength_nm: float) -> FloatArray:
        """Photoelectrons per second in pixels of an area, from their radiance, W/(m^2 sr nm)."""
        irradiance = radiance * self.bandwidth * np.pi / (4.0 * self.f_number**2)
        photons = irradiance * 1e-6 * area_mm2 * 1e-9 * wavelength_nm / (h * c)
        return as_float64(self.quantum_efficiency * photons)

    def exposure_for(self, rates: list[FloatArray]) -> float:
        """The exposure time, s, of pictures with these electrons per second, the same for all."""
        if self.exposure is not None:
            return self.exposure
        brightest = max(float(np.quantile(rate, BRIGHTEST)) for rate in rates)
        if not brightest > 0.0:
            raise InputError(
                "Nothing in the picture is bright, so no exposure time suits it; give the part a "
                "temperature or light, or the exposure.",
                code="photo.dark",
                argument="exposure",
            )
        return FILLED * self.full_well / brightest

    def grey_values(
        self, electrons: FloatArray, exposure: float, generator: np.random.Generator | None
    ) -> NDArray[np.uint16]:
        """Grey values, DN, of expected photoelectrons; without noise if there is no generator."""
        collected = electrons + self.dark_current * exposure
        if generator is None:
            read = np.minimum(collected, self.full_well)
        else:
            # NumPy draws no larger numbers, and the full well is far below.
            counted = generator.poisson(np.minimum(collected, 1e18))
            read = np.minimum(counted, self.full_well)
            read = read + generator.normal(0.0, self.dark_noise, read.shape)
        values = np.rint(self.gain * read + self.offset)
        return np.clip(values, 0, WHITE).astype(np.uint16)


USUAL_SENSOR = ImageSensor()
