"""The synthetic air: temperature and its gradient at any point outside a part."""

from __future__ import annotations

import numpy as np
from attrs import Attribute, field, frozen
from numpy.typing import ArrayLike, NDArray

from iriftrace.convection import reference_temperature
from iriftrace.errors import InputError
from iriftrace.part import Part
from iriftrace.synthetic.plume import Plume, plume_above
from iriftrace.wall_distance import WallDistance

FloatArray = NDArray[np.float64]

_KNOWN_LAYER_MM = 7.7
_KNOWN_SIZE_MM = 27.0
_KNOWN_EXCESS_K = 1080.0
_KNOWN_REFERENCE_K = 962.75


def _require_hotter_wall(wall_k: float, ambient_k: float) -> None:
    if not 0.0 < ambient_k < wall_k:
        raise InputError(
            f"The ambient air has {ambient_k:g} K and the wall {wall_k:g} K, but only a wall that "
            "is hotter than the room has hot air around it; check both."
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

    Limits: the layer is as thick below the part as beside it, and thin layers of a real flow that
    meet in a notch merge more smoothly: where two points of a concave part are equally near, the
    temperature is continuous but its gradient jumps. No simulation: orders of magnitude and shapes
    are right, numbers are not.

    Parameters
    ----------
    part : Part
        Closed.
    wall_k, ambient_k : float, K
    boundary_layer_mm : float
        Where the boundary layer ends.
    plume : Plume or None
        None for still air.
    """

    part: Part
    wall_k: float = field(default=1373.15, converter=float)
    ambient_k: float = field(default=293.15, converter=float)
    boundary_layer_mm: float = field(default=_KNOWN_LAYER_MM, converter=float)
    plume: Plume | None = None
    _distance: WallDistance = field(init=False, repr=False)

    @wall_k.validator
    def _check_wall(self, _: Attribute[float], value: float) -> None:
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"A wall temperature of {value:g} K does not exist; give it in K.")

    @ambient_k.validator
    def _check_ambient(self, _: Attribute[float], value: float) -> None:
        _require_hotter_wall(self.wall_k, value)

    @boundary_layer_mm.validator
    def _check_layer(self, _: Attribute[float], value: float) -> None:
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(
                f"A boundary layer of {value:g} mm has no air in it; give a positive thickness."
            )

    @_distance.default
    def _make_distance(self) -> WallDistance:
        return WallDistance(self.part)

    @property
    def distance(self) -> WallDistance:
        """The part, asked for distances."""
        return self._distance

    @property
    def origin(self) -> str:
        """What results say of this field."""
        plume = "no plume" if self.plume is None else f"plume of strength {self.plume.strength:g}"
        return (
            "synthetic: boundary layer and plume from formulas, not a simulation (wall "
            f"{self.wall_k:g} K, ambient {self.ambient_k:g} K, boundary layer "
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
        distance, away = self._distance.nearest(places)
        left = np.maximum(1.0 - distance / self.boundary_layer_mm, 0.0)
        layer, layer_slope = left**2, -2.0 * left / self.boundary_layer_mm
        excess = self.wall_k - self.ambient_k
        if self.plume is None:
            return self.ambient_k + excess * layer, excess * layer_slope[:, None] * away
        plume, plume_gradient = self.plume.excess(places)
        share = 1.0 - (1.0 - layer) * (1.0 - plume)
        gradient = ((1.0 - plume) * layer_slope)[:, None] * away
        gradient += (1.0 - layer)[:, None] * plume_gradient
        return self.ambient_k + excess * share, excess * gradient


def synthetic_air(
    part: Part,
    *,
    wall_k: float = 1373.15,
    ambient_k: float = 293.15,
    boundary_layer_mm: float | None = None,
    plume: float = 0.8,
) -> SyntheticAir:
    """The synthetic air of a part, with what is not given chosen after its size.

    Parameters
    ----------
    part : Part
    wall_k, ambient_k : float, K
    boundary_layer_mm : float, optional
        By default `laminar_boundary_layer_mm`.
    plume : float
        Strength of the plume, 0 to 1; 0 for none.
    """
    layer = boundary_layer_mm
    if layer is None:
        layer = laminar_boundary_layer_mm(part, wall_k, ambient_k)
    still = SyntheticAir(part, wall_k, ambient_k, layer)
    if plume == 0.0:
        return still
    return SyntheticAir(part, wall_k, ambient_k, layer, plume_above(part, layer, plume))


def laminar_boundary_layer_mm(part: Part, wall_k: float, ambient_k: float) -> float:
    r"""Thickness of the boundary layer by laminar similarity.

    :math:`\delta \propto D\,\mathrm{Ra}^{-1/4}`, hence :math:`(D\,\nu\alpha / \Delta T)^{1/4}` with
    :math:`\nu\alpha \propto T_r^{3.4}` at Sparrow and Gregg's reference temperature
    :math:`T_r = T_w - 0.38\,\Delta T`, and D four times the part's volume over its area; scaled
    from the 7.7 mm beside a cylinder of 27 mm at 1100 degC in a room of 20 degC (simulation).
    """
    _require_hotter_wall(wall_k, ambient_k)
    size = 4.0 * part.volume / part.area
    excess = wall_k - ambient_k
    reference = reference_temperature(wall_k, ambient_k)
    return float(
        _KNOWN_LAYER_MM
        * (size / _KNOWN_SIZE_MM * _KNOWN_EXCESS_K / excess) ** 0.25
        * (reference / _KNOWN_REFERENCE_K) ** 0.85
    )
