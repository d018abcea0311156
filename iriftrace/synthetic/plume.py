"""The warm air that rises from a part, as the similarity solution of a laminar line source."""

from __future__ import annotations

import numpy as np
from attrs import Attribute, field, frozen
from numpy.typing import NDArray
from scipy.special import erf

from iriftrace.errors import InputError
from iriftrace.part import Part

FloatArray = NDArray[np.float64]

DECAY = 0.6
"""Exponent with which the excess temperature on the axis of a laminar line plume falls."""

_STRENGTH = 0.8
_WIDTH_SHARE = 0.5


def _positive(_: Plume, attribute: Attribute[float], value: float) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise InputError(
            f"The plume's {attribute.name} is {value:g}, but it must be a positive number."
        )


@frozen(eq=False)
class Plume:
    r"""Excess temperature above a part as a share of the wall's, from 0 to 1.

    With the height :math:`t = (z - z_0) / R` above the part's middle in half heights R, and with
    the horizontal distances u along and v across the part's longer side:

    .. math::

        \theta = A\, s(t)\, t^{-3/5}\;
                 \tfrac12\Big[\mathrm{erf}\tfrac{u + a}{w} - \mathrm{erf}\tfrac{u - a}{w}\Big]\;
                 e^{-v^2/w^2}, \qquad w = b \left(\frac{1 + t^2}{2}\right)^{1/5}

    s rises from 0 at the middle of the part to 1 at its top (:math:`6t^5 - 15t^4 + 10t^3`). So the
    axis cools with :math:`z^{-3/5}` and the width grows with :math:`z^{2/5}`, the similarity
    solution of a laminar plume above a horizontal line source (Gebhart, Pera and Schorr, Int. J.
    Heat Mass Transfer 13 (1970) 161); ends at -a and +a are smoothed. Above a short source the ends
    take the temperature down with :math:`z^{-1}`, as above a point source (Fujii 1963). In a
    coarse simulation of a cylinder of 27 mm at 1100 degC the axis followed :math:`0.79\, t^{-3/5}`
    within 3 % from 30 to 120 mm, and the width was 5 mm throughout.

    Limits: steady, no swaying, no turbulence far above, no chimney effect of a wide part's sides.

    Parameters
    ----------
    base : (3,) array, mm, world
        The part's middle, where the plume has its virtual origin.
    along : (2,) array
        Horizontal unit vector of the source.
    half_length_mm : float
        a, half the length of the source.
    half_height_mm : float
        R, from the middle of the part to its top.
    width_mm : float
        b, the half width at the top, where the temperature has fallen to 1/e.
    strength : float
        A, excess temperature on the axis at the top as a share of the wall's.
    """

    base: FloatArray
    along: FloatArray
    half_length_mm: float = field(validator=_positive)
    half_height_mm: float = field(validator=_positive)
    width_mm: float = field(validator=_positive)
    strength: float = field(default=_STRENGTH)

    @strength.validator
    def _check_strength(self, _: Attribute[float], value: float) -> None:
        if not 0.0 <= value <= 1.0:
            raise InputError(
                f"The plume's strength is {value:g}, but its air is neither colder than the room "
                "nor hotter than the wall; give a share from 0 to 1."
            )

    def excess(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Share of the wall's excess temperature and its gradient.

        Parameters
        ----------
        points : (n, 3) array, mm, world

        Returns
        -------
        share : (n,) array
        gradient : (n, 3) array, 1/mm, world
        """
        offset = np.asarray(points, dtype=np.float64) - self.base
        height = offset[:, 2] / self.half_height_mm
        u = offset[:, :2] @ self.along
        across = np.array((-self.along[1], self.along[0]))
        v = offset[:, :2] @ across
        axis, axis_slope = _axis(height)
        width, width_slope = self._width(height)
        ends, by_u, by_width = _ends(u, self.half_length_mm, width)
        bell = np.exp(-((v / width) ** 2))
        share = self.strength * axis * ends * bell
        along_u = self.strength * axis * by_u * bell
        along_v = share * (-2.0 * v / width**2)
        widening = (by_width + ends * 2.0 * v**2 / width**3) * width_slope
        upward = self.strength * bell * (axis_slope * ends + axis * widening) / self.half_height_mm
        gradient = np.column_stack(
            (
                along_u[:, None] * self.along + along_v[:, None] * across,
                upward,
            )
        )
        return share, gradient

    def half_width(self, heights_mm: FloatArray) -> FloatArray:
        """Half width w, mm, at heights above the part's middle, mm."""
        return self._width(np.asarray(heights_mm, dtype=np.float64) / self.half_height_mm)[0]

    def _width(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Half width and its derivative by t."""
        middle = (1.0 + height**2) / 2.0
        width = self.width_mm * middle**0.2
        return width, 0.2 * width * height / middle


def plume_above(part: Part, boundary_layer_mm: float, strength: float = _STRENGTH) -> Plume:
    """The plume of a part whose boundary layer is known.

    Parameters
    ----------
    part : Part
    boundary_layer_mm : float
        Its thickness; the plume is half as wide at the part's top.
    strength : float
        See `Plume`.
    """
    centres, areas = part.face_centres[:, :2], part.face_areas
    middle = np.average(centres, axis=0, weights=areas)
    spread = np.cov((centres - middle).T, aweights=np.maximum(areas, 0.0))
    along = np.linalg.eigh(spread)[1][:, -1]
    along = along / np.linalg.norm(along)
    used = part.vertices[part.faces.ravel()]
    reach = used[:, :2] @ along
    across = used[:, :2] @ np.array((-along[1], along[0]))
    low, high = part.bounds
    base = np.empty(3)
    base[:2] = 0.5 * (reach.min() + reach.max()) * along
    base[:2] += 0.5 * (across.min() + across.max()) * np.array((-along[1], along[0]))
    base[2] = 0.5 * (low[2] + high[2])
    return Plume(
        base=base,
        along=along,
        half_length_mm=0.5 * float(np.ptp(reach)),
        half_height_mm=0.5 * float(high[2] - low[2]),
        width_mm=_WIDTH_SHARE * boundary_layer_mm,
        strength=strength,
    )


def _axis(height: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Share s(t) t^(-3/5) on the axis and its derivative by t; both 0 below the middle."""
    t = np.clip(height, 0.0, 1.0)
    rise = t**3 * (10.0 - 15.0 * t + 6.0 * t**2)
    rise_slope = 30.0 * t**2 * (1.0 - t) ** 2
    above = np.maximum(height, 1e-12)
    decay = np.where(height > 0.0, above**-DECAY, 0.0)
    slope = np.where(height > 0.0, rise_slope * decay - DECAY * rise * decay / above, 0.0)
    return rise * decay, slope


def _ends(
    u: FloatArray, half_length: float, width: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Share along the source, and its derivatives by u and by the width."""
    plus, minus = (u + half_length) / width, (u - half_length) / width
    share = 0.5 * (erf(plus) - erf(minus))
    bell_plus, bell_minus = (np.exp(-(x**2)) / np.sqrt(np.pi) for x in (plus, minus))
    by_u = (bell_plus - bell_minus) / width
    by_width = -(bell_plus * plus - bell_minus * minus) / width
    return share, by_u, by_width
