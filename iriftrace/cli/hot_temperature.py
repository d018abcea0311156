"""The option ``--hot-temperature``: one for the part, others for regions, or those of a field."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from attrs import field, frozen

from iriftrace.cli.options import quantity, region_temperatures
from iriftrace.core.errors import InputError

if TYPE_CHECKING:
    from iriftrace.part.part import Part
    from iriftrace.part.uneven_growth import Temperatures

FIELD = "field"
"""The word for the temperatures of the field's wall."""

OPTION = "--hot-temperature"


@frozen
class HotTemperatures:
    """Temperature of the part and of regions, K; or, if `of_field`, those of a field's wall."""

    default: float | None = None
    regions: dict[str, float] = field(factory=dict)
    of_field: bool = False

    @classmethod
    def of_words(cls, words: Sequence[str] | None) -> HotTemperatures:
        """Read the user's words: a temperature, NAME=TEMPERATURE, or "field"."""
        given = list(words or ())
        if FIELD in given:
            if len(given) > 1:
                raise InputError(
                    f'{OPTION} is "field" and also a temperature; give the one or the other.'
                )
            return cls(of_field=True)
        alone = [word for word in given if "=" not in word]
        regions = region_temperatures([word for word in given if "=" in word], OPTION)
        if len(alone) > 1 or (regions and not alone):
            raise InputError(
                f"{OPTION} gives {len(alone)} temperatures for the whole part; give one, and "
                "NAME=TEMPERATURE for regions with another one."
            )
        return cls(quantity(alone[0], "kelvin", OPTION) if alone else None, regions)

    @property
    def single(self) -> float | None:
        """The one temperature of the whole part, K; None if there are several or none."""
        return None if self.regions else self.default

    @property
    def uneven(self) -> bool:
        """True if the part may not have the same temperature everywhere."""
        return self.of_field or bool(self.regions)

    def at_walls(
        self, part: Part, field_wall: Callable[[Part], Temperatures] | None
    ) -> Temperatures:
        """Temperatures of the walls nearest to points; for a field those of `field_wall`."""
        from iriftrace.cfd.openfoam.wall import WallTemperatures, wall_temperature
        from iriftrace.part.region_choice import values_by_region

        if self.of_field or self.default is None:
            if field_wall is None:
                raise InputError(
                    f'{OPTION} is "field", but this command reads the part without a field; give a '
                    "temperature, and NAME=TEMPERATURE for regions with another one."
                )
            return field_wall(part)
        wall = WallTemperatures(self.default, values_by_region(part, self.regions))
        return lambda points: wall_temperature(wall, part, points)
