"""Temperatures by which a part expands: one, some regions with another one, or the field's wall."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from attrs import field, frozen

from iriftrace.core.errors import InputError, warn
from iriftrace.core.units import Temperature

if TYPE_CHECKING:
    from iriftrace.part.part import Part
    from iriftrace.part.uneven_growth import Temperatures

FIELD = "field"
"""The word for the temperatures of the field's wall."""


@frozen
class HotTemperatures:
    """Temperature of the part and of regions, K; or, if `of_field`, those of a field's wall."""

    default: Temperature | None = None
    regions: dict[str, float] = field(factory=dict)
    of_field: bool = False

    @classmethod
    def of(cls, given: str | float | Sequence[str] | None) -> HotTemperatures:
        """Read a number in K, or words: a temperature, NAME=TEMPERATURE, or "field"."""
        from iriftrace.part.wall_temperature import region_temperatures

        if given is None or isinstance(given, float | int):
            return cls(None if given is None else Temperature(given))
        words = [given] if isinstance(given, str) else list(given)
        if FIELD in words:
            if len(words) > 1:
                raise InputError(
                    'the hot temperature is "field" and also a temperature; give the one or the '
                    "other.",
                    code="part.two_temperatures",
                    argument="hot_temperature",
                )
            return cls(of_field=True)
        alone = [word for word in words if "=" not in word]
        regions = region_temperatures([word for word in words if "=" in word], "hot_temperature")
        if len(alone) > 1 or (regions and not alone):
            raise InputError(
                f"{len(alone)} hot temperatures are given for the whole part; give one, and "
                "NAME=TEMPERATURE for regions with another one.",
                code="part.two_temperatures",
                argument="hot_temperature",
            )
        return cls(Temperature(alone[0]) if alone else None, regions)

    @property
    def single(self) -> Temperature | None:
        """The one temperature of the whole part, K; None if there are several or none."""
        return None if self.regions else self.default

    @property
    def uneven(self) -> bool:
        """True if the part may not have the same temperature everywhere."""
        return self.of_field or bool(self.regions)

    def wall(
        self, wall: Temperature | None, regions: list[str] | None
    ) -> tuple[Temperature | None, list[str] | None]:
        """Temperature of the wall, and NAME=TEMPERATURE of regions: by default these.

        Warns of a wall with other temperatures than those by which the part expands.
        """
        from iriftrace.part.wall_temperature import region_temperatures

        if self.default is None:
            return wall, regions
        given = region_temperatures(regions or (), "region_temperature")
        if wall is None:
            wall, given = self.default, self.regions | given
        off = [
            self.regions.get(name, self.default) - given.get(name, wall)
            for name in self.regions | given
        ]
        if max(map(abs, (self.default - wall, *off))) > 1.0:
            hot, its = (
                ", ".join(temperature_words(*both))
                for both in ((self.default, self.regions), (wall, given))
            )
            warn(
                f"The part expands to its size at {hot}, but its wall has {its}; leave one of them "
                "out.",
                argument="hot_temperature",
            )
        return wall, [f"{name}={kelvin!r} K" for name, kelvin in given.items()] or None

    def at_walls(
        self, part: Part, field_wall: Callable[[Part], Temperatures] | None
    ) -> Temperatures:
        """Temperatures of the walls nearest to points; for a field those of `field_wall`."""
        from iriftrace.part.region_choice import values_by_region
        from iriftrace.part.wall_temperature import WallTemperatures, wall_temperature

        if self.of_field or self.default is None:
            if field_wall is None:
                raise InputError(
                    'the hot temperature is "field", but the part is read without a field; give a '
                    "temperature, and NAME=TEMPERATURE for regions with another one.",
                    code="part.no_field",
                    argument="hot_temperature",
                )
            return field_wall(part)
        wall = WallTemperatures(self.default, values_by_region(part, self.regions))
        return lambda points: wall_temperature(wall, part, points)


def temperature_words(default: float, regions: Mapping[str, float]) -> list[str]:
    """Temperatures, K, as users write them: that of the part, and NAME=TEMPERATURE of regions."""
    own = (f"{name}={Temperature(kelvin)!s}" for name, kelvin in regions.items())
    return [str(Temperature(default)), *own]
