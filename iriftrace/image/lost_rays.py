"""Rays whose end is not known, with all that is needed to trace them again.

The model is the particle restart file of OpenMC (Romano et al., Annals of Nuclear Energy 82 (2015)
90), which holds the one particle that was lost and not the run around it.
"""

from __future__ import annotations

import platform
from collections.abc import Iterable, Mapping
from importlib.metadata import version
from typing import Any

import numpy as np
from attrs import evolve, frozen

from iriftrace.core.arrays import FloatArray, Triple
from iriftrace.core.plain import structured
from iriftrace.image.aov_image import AovImage, Status

SCHEMA = "iriftrace.rays/1"

MOST = 20
"""Number of rays that a file holds."""


@frozen
class LostRay:
    """One ray, in double precision.

    Attributes
    ----------
    number : int
        From 1.
    device : str
        ``"camera"`` or ``"second"``.
    pixel : (2,) tuple, px
        Where it starts in the device's picture; pixel centres at whole numbers.
    origin_mm, direction : (3,) tuples, mm and unit vector, world
    status : int
        Code of :class:`iriftrace.image.aov_image.Status`: 5 or 6.
    member : int or None
        Number of the ensemble's member in which it was lost; None for one field, and where only
        the mean over the members is known.
    """

    number: int
    device: str
    pixel: tuple[float, float]
    origin_mm: Triple
    direction: Triple
    status: int
    member: int | None = None


@frozen
class TracedScene:
    """The scene's file, and the values of its parameters."""

    path: str | None
    sha256: str | None
    variables: dict[str, str]


@frozen
class LostRays:
    """The first rays that a result lost, and how it was traced.

    Attributes
    ----------
    lost : int
        Number of all rays that were lost.
    rays : tuple of LostRay
        The first `MOST` of them.
    engine, bending, variant : str
    wavelength_nm : float or None, nm
    scene : TracedScene
    versions : dict of str
        Of the programs by name.
    """

    lost: int
    rays: tuple[LostRay, ...]
    engine: str
    bending: str
    variant: str
    wavelength_nm: float | None
    scene: TracedScene
    versions: dict[str, str]
    schema: str = SCHEMA

    @classmethod
    def of(cls, rays: Iterable[LostRay], lost: int, provenance: Mapping[str, Any]) -> LostRays:
        """The first of some rays, numbered from 1, of a result with this provenance."""
        first = list(rays)[:MOST]
        return cls(
            lost=lost,
            rays=tuple(evolve(ray, number=n) for n, ray in enumerate(first, start=1)),
            scene=structured(provenance["scene"], TracedScene),
            versions={
                "iriftrace": provenance["version"],
                "python": platform.python_version(),
                **{name: version(name) for name in ("mitsuba", "drjit", "numpy")},
            },
            **{k: provenance[k] for k in ("engine", "bending", "variant", "wavelength_nm")},
        )


def as_rays(
    device: str, pixel: FloatArray, origin: FloatArray, direction: FloatArray, status: Iterable[int]
) -> list[LostRay]:
    """Rays that are not yet numbered, from (n, 2) places, px, (n, 3) vectors and n status codes."""
    rows = zip(pixel.tolist(), origin.tolist(), direction.tolist(), status, strict=True)
    return [
        LostRay(0, device, tuple(place), tuple(start), tuple(along), int(code))
        for place, start, along, code in rows
    ]


def lost_rays_of(image: AovImage) -> LostRays | None:
    """The first lost rays of a picture, row by row; None if none was lost."""
    status = image.status
    rows, columns = np.nonzero(np.isin(status, [code for code in Status if code.lost]))
    if len(rows) == 0:
        return None
    first = slice(MOST)
    pixel = np.column_stack((columns[first], rows[first])).astype(np.float64)
    codes = status[rows[first], columns[first]].tolist()
    rays = as_rays("camera", pixel, *image.camera.rays(pixel), codes)
    return LostRays.of(rays, len(rows), image.header)
