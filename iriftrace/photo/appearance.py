"""Appearance of a surface: how much it emits and reflects, and what is printed on it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from attrs import field, frozen
from numpy.typing import ArrayLike
from scipy.constants import c, h, k

from iriftrace.core.arrays import FloatArray, as_float64
from iriftrace.core.errors import InputError
from iriftrace.core.mesh.transform import checked_matrix
from iriftrace.photo.options import EMISSIVITY
from iriftrace.photo.prints import Print


def planck(wavelength_nm: float, kelvin: ArrayLike) -> FloatArray:
    """Spectral radiance of a black body, W/(m^2 sr nm), at temperatures (n,), K (Planck 1901)."""
    wavelength = 1e-9 * wavelength_nm
    exponent = h * c / (wavelength * k * np.asarray(kelvin, dtype=np.float64))
    return as_float64(1e-9 * 2.0 * h * c**2 / wavelength**5 / np.expm1(exponent))


def _as_emissivity(value: object) -> object:
    return value if callable(value) else float(value)  # type: ignore[arg-type]


@frozen(eq=False)
class Appearance:
    """How an opaque, diffuse surface looks: what it does not reflect, it emits (Kirchhoff).

    Attributes
    ----------
    emissivity : float or callable
        0 to 1; or a function from cosines of the emission angle (n,) to emissivities (n,).
    temperature : float (K), str, sequence of str or None
        ``"1100 degC"``; with ``"NAME=450 degC"`` for regions; ``"field"`` for that of the field's
        wall. None for a surface that does not glow.
    printed : Dots, Checkerboard, Bitmap or None
        Printed along the z axis of its frame on faces that look along +z.
    ink_emissivity : float
    to_world : (4, 4) array
        The print's frame to the world's.
    """

    emissivity: float | Callable[[FloatArray], FloatArray] = field(
        default=EMISSIVITY, converter=_as_emissivity
    )
    temperature: str | float | Sequence[str] | None = None
    printed: Print | None = None
    ink_emissivity: float = 0.95
    to_world: FloatArray = field(factory=lambda: np.eye(4), converter=checked_matrix)

    def __attrs_post_init__(self) -> None:
        for value in (self.emissivity, self.ink_emissivity):
            if not callable(value) and not 0.0 <= value <= 1.0:
                raise InputError(
                    f"An emissivity of {value:g} is impossible; give one between 0 and 1.",
                    code="photo.emissivity",
                    argument="emissivity",
                )

    def emissivities(
        self, points: FloatArray, normals: FloatArray, cosine: FloatArray, footprint: FloatArray
    ) -> FloatArray:
        """Emissivities (n,) at points (n, 3), mm, with unit normals, seen at cosines (n,).

        Edges of the print are blurred over the footprint (2, n, 3), mm: how far the point moves
        over a sample of the picture, to the right and down.
        """
        own = self.emissivity
        value = np.array(own(cosine)) if callable(own) else np.full(len(points), own)
        if self.printed is None:
            return value
        # Not by BLAS, whose threads wait for cores that the tracer's own threads still hold.
        rows = np.flatnonzero(np.einsum("ij,j->i", normals, self.to_world[:3, 2]) > 0.0)
        to_print = np.linalg.inv(self.to_world[:3, :3])[:2]
        places = np.einsum("ij,kj->ki", to_print, points[rows] - self.to_world[:3, 3])
        blur = np.abs(np.einsum("ij,skj->ski", to_print, footprint[:, rows])).sum(axis=0)
        value[rows] += self.printed.ink(places, blur) * (self.ink_emissivity - value[rows])
        return value
