"""Temperature of the wall: one for all, one for each region, or those that were measured."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property

import numpy as np
from attrs import evolve, field, frozen
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from iriftrace.core.arrays import FloatArray, IntArray, as_float64
from iriftrace.core.errors import InputError
from iriftrace.core.files import FileOrigin
from iriftrace.core.mesh.query import Surface
from iriftrace.core.plain import JsonObject
from iriftrace.core.units import Temperature
from iriftrace.part.part import Part
from iriftrace.part.region_choice import placed_regions

HOTTEST = 3000.0
"""K; above this, air is no longer the mixture whose properties are used."""

_COOLER_THAN_AIR = 50.0
"""K; a wall that is cooler than the air by more is most likely given in degC instead of K."""

_TOUCHING_MM = 1e-3

# A face is far from the points if its distance is several times the spacing of the points.
_FAR_SPACINGS = 3.0

# tanh reaches 0.8, which is 90 % of the transition, at this argument.
_NINETY_PERCENT = float(np.arctanh(0.8))


@frozen(eq=False)
class MeasuredWall:
    """Temperatures at points, or on the triangles between them."""

    origin: FileOrigin  # its path as it was given
    points: FloatArray  # (n, 3), mm, world
    kelvins: FloatArray  # (n,), K
    faces: IntArray | None = None  # (m, 3) corners of triangles; None for points alone
    above_k: float | None = None  # lower ones were left out

    def at(self, places: FloatArray) -> FloatArray:
        """Temperatures (k,), K, at points (k, 3), mm: those of the nearest point or triangle."""
        if self.faces is None:
            return as_float64(self.kelvins[self._tree.query(places)[1]])
        surface = Surface(self.points, self.faces)
        foot, face = surface.nearest(places)
        corners = self.faces[face]
        a, b, c = (self.points[corners[:, number]] for number in range(3))
        across = np.cross(b - a, c - a)
        square = np.einsum("ij,ij->i", across, across)
        v = np.einsum("ij,ij->i", np.cross(foot - a, c - a), across) / square
        w = np.einsum("ij,ij->i", np.cross(b - a, foot - a), across) / square
        weights = np.stack((1.0 - v - w, v, w), axis=1)
        return as_float64(np.einsum("ij,ij->i", weights, self.kelvins[corners]))

    def record(self) -> JsonObject:
        """File, and what was left out of it."""
        left_out = {} if self.above_k is None else {"above_k": self.above_k}
        return {"file": self.origin.path, "sha256": self.origin.sha256, **left_out}

    def far_faces(self, part: Part, cell_mm: float) -> str:
        """Warning about faces of the part far from any point, or ""; InputError if all are."""
        if self.faces is None:
            distance = self._tree.query(part.face_centres)[0]
            spacing = float(np.median(self._tree.query(self.points, k=2)[0][:, 1]))
        else:
            distance, spacing = Surface(self.points, self.faces).distance(part.face_centres), 0.0
        far = distance > max(_FAR_SPACINGS * spacing, 2.0 * cell_mm)
        if far.all():
            raise InputError(
                f"the temperatures in {self.origin.path} lie {distance.min():.3g} mm or more from "
                "the part, so they are not those of its wall; check that both have the same "
                "coordinates, in the same unit.",
                code="wall.too_far",
                argument="wall_length_unit",
            )
        far_off = part.face_areas[far].sum() / part.area
        if not far.any():
            return ""
        return (
            f"{far_off:.0%} of the part's surface is far from any temperature in "
            f"{self.origin.path}, up to {distance.max():.3g} mm, and gets that of the nearest one."
        )

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.points)


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
                f"the wall temperatures in {self.measured.origin.path} go down to {lowest:g} K in "
                f"air of {ambient_k:g} K; check the temperature of the air and the "
                "unit of the wall's.",
                code="wall.colder_than_air",
                argument="wall_temperature_unit",
            )
        for kelvin in (self.default, *self.regions.values()):
            if not ambient_k < kelvin <= HOTTEST:
                raise InputError(
                    f"a wall of {kelvin:g} K in air of {ambient_k:g} K cannot be simulated here: "
                    f"the wall must be hotter than the air and at most {HOTTEST:g} K; check "
                    "number and unit.",
                    code="wall.unlikely_temperature",
                )
        if self.transition and len(self.of_regions(part)) < 2:
            raise InputError(
                "a transition needs two temperatures to lie between; give one region another "
                "temperature, or leave the transition out.",
                code="wall.one_temperature",
                argument="region_temperature",
            )

    def check_regions(self, part: Part) -> None:
        """Refuse unknown regions and a negative width, with an InputError."""
        if not 0.0 <= self.transition < np.inf:
            raise InputError(
                f"a transition of {self.transition:g} mm is impossible; give 0 or more.",
                code="wall.transition_below_zero",
                argument="transition",
            )
        unknown = [name for name in self.regions if name not in part.region_names]
        if unknown:
            raise InputError(
                f'{part.path} has no region "{unknown[0]}"; its regions are '
                f"{', '.join(placed_regions(part))}.",
                code="region.unknown_name",
                argument="region_temperature",
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

    def hotter(self, by_k: float) -> WallTemperatures:
        """The wall with all of its temperatures higher, K."""
        regions = {name: kelvin + by_k for name, kelvin in self.regions.items()}
        measured = self.measured
        if measured is not None:
            measured = evolve(measured, kelvins=measured.kelvins + by_k)
        return evolve(self, default=self.default + by_k, regions=regions, measured=measured)

    @property
    def hottest(self) -> float:
        """Highest temperature, K."""
        return max((self.default, *self.regions.values()))


def region_temperatures(texts: Iterable[str], argument: str) -> dict[str, float]:
    """Temperatures, K, of regions or patterns, from NAME=TEMPERATURE of an argument."""
    found: dict[str, float] = {}
    for text in texts:
        name, equals, value = text.rpartition("=")
        if not (name and equals and value):
            raise InputError(
                f'"{text}" is not NAME=TEMPERATURE; write it like "head +x=450 degC".',
                code="wall.no_region_temperature",
                argument=argument,
            )
        if name in found:
            raise InputError(
                f'"{name}" is given two temperatures; give one.',
                code="wall.region_twice",
                argument=argument,
            )
        found[name] = float(Temperature(value))
    return found


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
            "the temperature between regions has no gradient without a transition; give its width.",
            code="wall.no_transition",
            argument="transition",
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
