"""Temperature and its gradient at any point around a hot part, from formulas.

A boundary layer on the part and, above it, the plume of a laminar line source.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from attrs import Attribute, evolve, field, frozen
from numpy.typing import ArrayLike
from scipy.optimize import brentq
from scipy.special import erf

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.mesh.query import Surface
from iriftrace.flow.synthetic.options import STANDARD_SYNTHETIC, WALL
from iriftrace.medium.air.thermophysics import reference_temperature
from iriftrace.part.part import Part, refuse_unlikely_size
from iriftrace.part.region_choice import values_by_region
from iriftrace.part.wall_temperature import WallTemperatures, wall_temperature_gradient

DECAY = 0.6
"""Exponent with which the excess temperature on the axis of a laminar line plume falls."""

_REACH = 3.0
"""Half widths at which a plume ends: its profile has fallen to e^-9."""

_SHORTEST = 1e-4
"""Smallest half length over half width: the difference of the ends then keeps twelve digits, and
the plume differs from a round one by the square of this."""

_KNOWN_LAYER_MM = 7.7


def _positive(_: Plume, attribute: Attribute[float], value: float) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise InputError(
            f"The plume's {attribute.name} is {value:g}, but it must be a positive number.",
            code="plume.not_positive",
        )


@frozen(eq=False)
class Plume:
    r"""Excess temperature above a part as a fraction of the wall's, from 0 to 1.

    With the height :math:`t = (z - z_0) / R` above the part's middle in half heights R, and with
    the horizontal distances u along and v across the part's longer side:

    .. math::

        \theta = A\, s(t)\, t^{-3/5}\;
                 \frac{\mathrm{erf}\frac{u + a}{w} - \mathrm{erf}\frac{u - a}{w}}
                      {2\,\mathrm{erf}\frac{a}{b}}\;
                 e^{-v^2/w^2}, \qquad w = b \left(\frac{1 + t^2}{2}\right)^{1/5}

    s rises from 0 at the middle of the part to 1 at its top (:math:`6t^5 - 15t^4 + 10t^3`). So the
    axis cools with :math:`z^{-3/5}` and the width grows with :math:`z^{2/5}`, the similarity
    solution of a laminar plume above a horizontal line source (Gebhart, Pera and Schorr, Int. J.
    Heat Mass Transfer 13 (1970) 161); ends at -a and +a are smoothed. Above a short source the ends
    take the temperature down with :math:`z^{-1}`, as above a point source (Fujii 1963), and the
    plume is round. In a coarse simulation of a cylinder of 27 mm at 1100 degC the axis followed
    :math:`0.79\, t^{-3/5}` within 3 % from 30 to 120 mm, and the width was 5 mm throughout.

    Limits: steady, no swaying, no turbulence far above, no chimney effect of a wide part's sides.
    """

    base: FloatArray  # (3,), mm, world: the part's middle, the virtual origin
    along: FloatArray  # (2,), horizontal unit vector of the source
    half_length_mm: float = field(validator=_positive)  # a, of the source
    half_height_mm: float = field(validator=_positive)  # R, from the part's middle to its top
    width_mm: float = field(validator=_positive)  # b, where T falls to 1/e at the top
    strength: float = field()  # A, excess on the axis at the top as a fraction of the wall's

    @strength.validator
    def _check_strength(self, _: Attribute[float], value: float) -> None:
        if not 0.0 <= value <= 1.0:
            raise InputError(
                f"The plume's strength is {value:g}, but its air is neither colder than the room "
                "nor hotter than the wall; give a fraction from 0 to 1.",
                code="plume.strength",
                argument="plume",
            )

    def excess(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Fraction (n,) of the wall's excess temperature at points (n, 3), mm, world; gradient."""
        offset = np.asarray(points, dtype=np.float64) - self.base
        height = offset[:, 2] / self.half_height_mm
        u = offset[:, :2] @ self.along
        across = np.array((-self.along[1], self.along[0]))
        v = offset[:, :2] @ across
        axis, axis_slope = _axis(height)
        width, width_slope = self._width(height)
        whole = erf(self.half_length_mm / self.width_mm)
        ends, by_u, by_width = (share / whole for share in _ends(u, self.half_length_mm, width))
        bell = np.exp(-((v / width) ** 2))
        share = self.strength * axis * ends * bell
        along_u = self.strength * axis * by_u * bell
        along_v = share * (-2.0 * v / width**2)
        widening = (by_width + ends * 2.0 * v**2 / width**3) * width_slope
        upward = self.strength * bell * (axis_slope * ends + axis * widening) / self.half_height_mm
        sideways = along_u[:, None] * self.along + along_v[:, None] * across
        return share, np.column_stack((sideways, upward))

    def half_width(self, heights_mm: FloatArray) -> FloatArray:
        """Half width w, mm, at heights above the part's middle, mm."""
        return self._width(np.asarray(heights_mm, dtype=np.float64) / self.half_height_mm)[0]

    def bounds(self, height_mm: float) -> FloatArray:
        """Lowest and highest x and y of the plume, (2, 2), mm, at a height above the middle, mm."""
        width = _REACH * float(self.half_width(np.array(height_mm)))
        along, across = np.abs(self.along), np.abs(self.along[::-1])
        reach = (self.half_length_mm + width) * along + width * across
        return self.base[:2] + np.stack((-reach, reach))

    def _width(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Half width and its derivative by t."""
        middle = (1.0 + height**2) / 2.0
        width = self.width_mm * middle**0.2
        return width, 0.2 * width * height / middle


def plume_above(part: Part, boundary_layer_mm: float, strength: float) -> Plume:
    r"""The plume of a part whose boundary layer is known.

    With the principal second moments :math:`m_1 \ge m_2` of the part's outline seen from above, the
    source has the half length :math:`a = \sqrt{3 (m_1 - m_2)}`: that of a thin strip, and none of a
    round outline. The layer's air rises through the same cross-section for any outline:
    :math:`2 a b / \mathrm{erf}(a / b) = \sqrt{3 (m_1 + m_2)}\, \delta`, which makes b half the
    layer's thickness :math:`\delta` above a thin strip and :math:`\pi b^2` that cross-section above
    a round part.
    """
    middle, moments, axes = _outline(part)
    low, high = part.bounds[:, 2]
    half_length = float(np.sqrt(3.0 * np.ptp(moments)))
    section = np.sqrt(3.0 * moments.sum()) * boundary_layer_mm
    # The width of a round plume, which is the largest.
    widest = float(np.sqrt(section / np.sqrt(np.pi)))
    half_length = max(half_length, _SHORTEST * widest)

    def excess_section(width: float) -> float:
        return float(2.0 * half_length * width / erf(half_length / width) - section)

    return Plume(
        base=np.append(middle, 0.5 * (low + high)),
        along=axes[:, int(np.argmax(moments))],
        half_length_mm=half_length,
        half_height_mm=0.5 * float(high - low),
        width_mm=float(brentq(excess_section, 1e-6 * widest, 2.0 * widest)),
        strength=strength,
    )


def _outline(part: Part) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Middle (2,), mm, principal second moments (2,), mm^2, and axes (2, 2) seen from above."""
    weight = part.face_areas * np.abs(part.face_normals[:, 2])
    weight = weight / weight.sum()
    corners = part.vertices[part.faces][:, :, :2]
    middle = weight @ corners.mean(axis=1)
    arms = corners - middle
    total = arms.sum(axis=1)
    # Exact for each triangle.
    squares = np.einsum("f,fki,fkj->ij", weight, arms, arms)
    spread = (squares + np.einsum("f,fi,fj->ij", weight, total, total)) / 12.0
    moments, axes = np.linalg.eigh(spread)
    return middle, np.maximum(moments, 0.0), axes


def _axis(height: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Fraction s(t) t^(-3/5) on the axis and its derivative by t; both 0 below the middle."""
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
    """Fraction along the source, and its derivatives by u and by the width."""
    plus, minus = (u + half_length) / width, (u - half_length) / width
    share = 0.5 * (erf(plus) - erf(minus))
    bell_plus, bell_minus = (np.exp(-(x**2)) / np.sqrt(np.pi) for x in (plus, minus))
    by_u = (bell_plus - bell_minus) / width
    by_width = -(bell_plus * plus - bell_minus * minus) / width
    return share, by_u, by_width


def _require_hotter_wall(wall_k: float, ambient_k: float) -> None:
    if not 0.0 < ambient_k < wall_k:
        raise InputError(
            f"The ambient air has {ambient_k:g} K and the wall {wall_k:g} K, but only a wall that "
            "is hotter than the room has hot air around it; check both.",
            code="wall.not_hotter",
        )


@frozen(eq=False)
class SyntheticAir:
    r"""Hot air around a part from formulas: boundary layer and plume.

    With the distance d to the part and the boundary layer's thickness :math:`\delta`:

    .. math::

        T = T_a + (T_w - T_a)\,\big[1 - (1 - \theta_b)(1 - \theta_p)\big], \qquad
        \theta_b = \max(0, 1 - d/\delta)^2

    :math:`\theta_b` is the profile of the integral method for laminar free convection (Squire 1938;
    Eckert and Drake, Analysis of Heat and Mass Transfer, 1972, section 11); :math:`\theta_p` is
    that of `Plume`. The product merges both smoothly, keeps the wall's temperature at the wall,
    and is nowhere hotter than the wall or colder than the room.

    Limits: the layer is as thick below the part as at its sides, and thin layers of a real flow
    that meet in a notch merge more smoothly: where two points of a concave part are equally near,
    the temperature is continuous but its gradient jumps. This is not a simulation: orders of
    magnitude and shapes are right, numbers are not.

    Parameters
    ----------
    part : Part
        Closed.
    wall_k, ambient_k : float, K
    boundary_layer_mm : float
        Where the boundary layer ends.
    plume : Plume or None
        None for still air.
    regions : dict
        Temperatures, K, of regions of the part that differ from `wall_k`. :math:`T_w` is then that
        of the nearest wall, with a transition over `transition_mm`
        (`iriftrace.part.wall_temperature.wall_temperature`).
    transition_mm : float or None
        By default the boundary layer's thickness.
    """

    part: Part
    wall_k: float = field(default=WALL, converter=float)
    ambient_k: float = field(default=STANDARD_SYNTHETIC.ambient, converter=float)
    boundary_layer_mm: float = field(default=_KNOWN_LAYER_MM, converter=float)
    plume: Plume | None = None
    regions: dict[str, float] = field(factory=dict)
    transition_mm: float | None = None
    surface: Surface = field(init=False, repr=False)

    @ambient_k.validator
    def _check_ambient(self, _: Attribute[float], value: float) -> None:
        _require_hotter_wall(self.wall_k, value)

    @boundary_layer_mm.validator
    def _check_layer(self, _: Attribute[float], value: float) -> None:
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(
                f"A boundary layer of {value:g} mm has no air in it; give a positive thickness.",
                code="air.boundary_layer",
                argument="boundary_layer",
            )

    @surface.default
    def _surface_of_part(self) -> Surface:
        return self.part.closed_surface

    def __attrs_post_init__(self) -> None:
        """Refuse regions that the part does not have, and walls that are colder than the room."""
        self.wall.check(self.part, self.ambient_k)

    @property
    def wall(self) -> WallTemperatures:
        """Temperatures of the wall."""
        width = self.transition_mm
        if width is None:
            width = self.boundary_layer_mm if self.regions else 0.0
        return WallTemperatures(self.wall_k, self.regions, width)

    @property
    def origin(self) -> str:
        """Description of the field's origin in results."""
        others = "".join(f", {name} {kelvin:g} K" for name, kelvin in self.regions.items())
        plume = "no plume" if self.plume is None else f"plume of strength {self.plume.strength:g}"
        return (
            "synthetic: boundary layer and plume from formulas, not a simulation (wall "
            f"{self.wall_k:g} K{others}, ambient {self.ambient_k:g} K, boundary layer "
            f"{self.boundary_layer_mm:.3g} mm, {plume})"
        )

    def at(self, points: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Temperature and its gradient.

        Parameters
        ----------
        points : (n, 3) array_like, mm, world
            Outside the part or on it.

        Returns
        -------
        temperature : (n,) array, K
        gradient : (n, 3) array, K/mm, world
        """
        places = np.asarray(points, dtype=np.float64).reshape(-1, 3)
        distance, away = self.surface.distance_gradient(places)
        left = np.maximum(1.0 - distance / self.boundary_layer_mm, 0.0)
        layer, layer_slope = left**2, -2.0 * left / self.boundary_layer_mm
        share, slope = layer, layer_slope[:, None] * away
        if self.plume is not None:
            plume, plume_gradient = self.plume.excess(places)
            share = 1.0 - (1.0 - layer) * (1.0 - plume)
            slope = (1.0 - plume)[:, None] * slope + (1.0 - layer)[:, None] * plume_gradient
        wall, along_wall = wall_temperature_gradient(self.wall, self.part, places)
        excess = wall - self.ambient_k
        gradient = excess[:, None] * slope + share[:, None] * along_wall
        return self.ambient_k + excess * share, gradient


def synthetic_air(
    part: Part,
    *,
    wall_k: float = WALL,
    ambient_k: float = STANDARD_SYNTHETIC.ambient,
    boundary_layer_mm: float | None = None,
    plume: float = STANDARD_SYNTHETIC.plume,
    regions: Mapping[str, float] | None = None,
    transition_mm: float | None = None,
) -> SyntheticAir:
    """The synthetic air of a part; values that are not given follow from its size.

    Parameters
    ----------
    part : Part
    wall_k, ambient_k : float, K
    boundary_layer_mm : float, optional
        By default `laminar_boundary_layer_mm`.
    plume : float
        Strength of the plume, 0 to 1; 0 for none.
    regions : mapping, optional
        Temperatures, K, of regions, by name or pattern (`values_by_region`).
    transition_mm : float, optional
        As in `SyntheticAir`.

    Raises
    ------
    InputError
        The part's unit is wrong (`iriftrace.part.part.refuse_unlikely_size`), or a value is.
    """
    refuse_unlikely_size(part)
    layer = boundary_layer_mm
    if layer is None:
        layer = laminar_boundary_layer_mm(part, wall_k, ambient_k)
    still = SyntheticAir(
        part,
        wall_k,
        ambient_k,
        layer,
        regions=values_by_region(part, regions or {}),
        transition_mm=transition_mm,
    )
    return still if plume == 0.0 else evolve(still, plume=plume_above(part, layer, plume))


def laminar_boundary_layer_mm(part: Part, wall_k: float, ambient_k: float) -> float:
    r"""Thickness of the boundary layer by laminar similarity.

    :math:`\delta \propto D\,\mathrm{Ra}^{-1/4}`, hence :math:`(D\,\nu\alpha / \Delta T)^{1/4}` with
    :math:`\nu\alpha \propto T_r^{3.4}` at Sparrow and Gregg's reference temperature
    :math:`T_r = T_w - 0.38\,\Delta T`, and D four times the part's volume over its area; scaled
    from the 7.7 mm next to a cylinder of 27 mm at 1100 degC in a room of 20 degC, of which
    :math:`T_r` is 962.75 K (simulation).
    """
    _require_hotter_wall(wall_k, ambient_k)
    size = 4.0 * part.volume / part.area
    growth = (size / 27.0 * 1080.0 / (wall_k - ambient_k)) ** 0.25
    warmth = reference_temperature(wall_k, ambient_k) / 962.75
    return float(_KNOWN_LAYER_MM * growth * warmth**0.85)
