"""Temperature of the wall: one for all or one for each region, with or without transition."""

from __future__ import annotations

import numpy as np
from attrs import field, frozen
from numpy.typing import ArrayLike

from iriftrace.cfd.openfoam.measured_wall import MeasuredWall
from iriftrace.core.arrays import FloatArray, as_float64
from iriftrace.core.errors import InputError
from iriftrace.geometry.query import Surface
from iriftrace.part.part import Part
from iriftrace.part.region_choice import placed_regions

HOTTEST = 3000.0
"""K; above this, air is no longer the mixture whose properties are used."""

_COOLER_THAN_AIR = 50.0
"""K; a wall that is cooler than the air by more is most likely given in degC instead of K."""

_TOUCHING_MM = 1e-3

# tanh reaches 0.8, which is 90 % of the transition, at this argument.
_NINETY_PERCENT = float(np.arctanh(0.8))


@frozen
class WallTemperatures:
    """Requested temperatures of the wall, K.

    `transition` is the width in mm over which one temperature changes to another (10 % to 90 %);
    0 is sharp. If they are `measured`, the default is the highest of them.
    """

    default: float  # of regions that are not named
    regions: dict[str, float] = field(factory=dict)
    transition: float = 0.0
    measured: MeasuredWall | None = None

    def check(self, part: Part, ambient_k: float) -> None:
        """Refuse temperatures that are not possible and unknown regions, with an InputError."""
        self.check_regions(part)
        lowest = np.inf if self.measured is None else float(self.measured.kelvins.min())
        if self.measured is not None and lowest < ambient_k - _COOLER_THAN_AIR:
            raise InputError(
                f"the wall temperatures in {self.measured.path} go down to {lowest:g} K in air of "
                f"{ambient_k:g} K; check their unit (--wall-temperature-unit degC) and --ambient."
            )
        for kelvin in (self.default, *self.regions.values()):
            if not ambient_k < kelvin <= HOTTEST:
                raise InputError(
                    f"a wall of {kelvin:g} K in air of {ambient_k:g} K cannot be simulated here: "
                    f"the wall must be hotter than the air and at most {HOTTEST:g} K; check "
                    "number and unit."
                )
        if self.transition and len(self.of_regions(part)) < 2:
            raise InputError(
                "a transition needs two temperatures to lie between; give one region another "
                "temperature (--region-temperature), or leave the transition out."
            )

    def check_regions(self, part: Part) -> None:
        """Refuse unknown regions and a negative width, with an InputError."""
        if not 0.0 <= self.transition < np.inf:
            raise InputError(
                f"a transition of {self.transition:g} mm is impossible; give 0 or more."
            )
        unknown = [name for name in self.regions if name not in part.region_names]
        if unknown:
            raise InputError(
                f'{part.path} has no region "{unknown[0]}"; its regions are '
                f"{', '.join(placed_regions(part))}."
            )

    def of_regions(self, part: Part) -> dict[float, list[int]]:
        """Numbers of the regions that have the same temperature."""
        shared: dict[float, list[int]] = {}
        for number, name in enumerate(part.region_names):
            shared.setdefault(self.regions.get(name, self.default), []).append(number)
        return shared

    def varies(self, part: Part) -> bool:
        """True if the part's wall has more than one temperature."""
        return self.measured is not None or len(self.of_regions(part)) > 1

    @property
    def hottest(self) -> float:
        """Highest temperature, K."""
        return max((self.default, *self.regions.values()))


def measured_wall(measured: MeasuredWall) -> WallTemperatures:
    """Wall with the temperatures of a file."""
    return WallTemperatures(float(measured.kelvins.max()), measured=measured)


def wall_temperature(wall: WallTemperatures, part: Part, points: ArrayLike) -> FloatArray:
    """Temperature, (n,) array, K, at points (n, 3), mm, world, on the wall of a part that it fits.

    With a transition of width w and two temperatures T1, T2 whose regions are d1 and d2 away,
    T = T1 + (T2 - T1) (1 + tanh((d1 - d2) / (0.455 w))) / 2; in general the mean of all
    temperatures with the weights exp(-2 d / (0.455 w)).
    """
    places = np.asarray(points, dtype=np.float64)
    if wall.measured is not None:
        return wall.measured.at(places)
    kelvins, groups = _groups(wall, part)
    if len(kelvins) == 1:
        return np.full(len(places), kelvins[0])
    distances = np.stack([group.distance(places) for group in groups])
    if wall.transition == 0.0:
        # On an edge between two, the first one: also after the points were rounded to float32.
        return as_float64(
            kelvins[(distances < distances.min(axis=0) + _TOUCHING_MM).argmax(axis=0)]
        )
    return _mixed(wall, kelvins, distances)[0]


def wall_temperature_gradient(
    wall: WallTemperatures, part: Part, points: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """`wall_temperature` and its gradient (n, 3), K/mm, at points (n, 3) on or next to the wall.

    Raises InputError for regions of different temperature without a transition.
    """
    kelvins, groups = _groups(wall, part)
    if len(kelvins) == 1:
        return np.full(len(points), kelvins[0]), np.zeros((len(points), 3))
    if wall.transition == 0.0:
        raise InputError(
            "the temperature between regions has no gradient without a transition; give its width "
            "(--transition)."
        )
    found = [group.distance_gradient(points) for group in groups]
    mean, weights = _mixed(wall, kelvins, np.stack([distance for distance, _ in found]))
    slopes = weights * (kelvins[:, None] - mean) * (-2.0 / _length(wall))
    gradient = np.einsum("kn,kni->ni", slopes, np.stack([away for _, away in found]))
    return mean, np.asarray(gradient)


def _groups(wall: WallTemperatures, part: Part) -> tuple[FloatArray, list[Surface]]:
    """The temperatures, and the faces with each of them."""
    shared = wall.of_regions(part)
    faces = [part.faces[np.isin(part.region_of_face, numbers)] for numbers in shared.values()]
    return np.array(list(shared)), [Surface(part.vertices, some) for some in faces]


def _length(wall: WallTemperatures) -> float:
    return wall.transition / 2.0 / _NINETY_PERCENT


def _mixed(
    wall: WallTemperatures, kelvins: FloatArray, distances: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean temperature (n,) at distances (k, n) from k groups of faces, and their weights."""
    weights = np.exp(-2.0 * (distances - distances.min(axis=0)) / _length(wall))
    weights /= weights.sum(axis=0)
    return np.asarray(kelvins @ weights), weights
