"""Options about the part's file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from attrs import frozen
from cyclopts import Group, Parameter

from iriftrace.cli.options import optional_quantity, quantity

if TYPE_CHECKING:
    from iriftrace.part import Part

PART = Group("Part", sort_key=4)


@Parameter(name="*", group=PART)
@frozen
class PartOptions:
    """How to read the part's file.

    Parameters
    ----------
    length_unit
        Unit of the part's coordinates.
    part_transform
        Part to world: 16 numbers, a file with them, or "rotate x 90, scale 0.001".
    expansion
        Linear thermal expansion of a part drawn cold, such as "14e-6/K".
    reference_temperature
        Temperature at which the part was drawn.
    hot_temperature
        Temperature of the hot part; needed with expansion.
    region_angle
        Faces that meet at a smaller angle (degrees) belong to one region.
    """

    length_unit: str = "mm"
    part_transform: str | None = None
    expansion: str | None = None
    reference_temperature: str = "20 degC"
    hot_temperature: str | None = None
    region_angle: float = 30.0

    def read(self, path: Path) -> Part:
        """Read the part."""
        from iriftrace.part import read_part
        from iriftrace.transform import parse_transform

        reference = quantity(self.reference_temperature, "kelvin", "--reference-temperature")
        return read_part(
            path,
            length_unit=self.length_unit,
            transform=None if self.part_transform is None else parse_transform(self.part_transform),
            expansion=optional_quantity(self.expansion, "1/kelvin", "--expansion"),
            reference_temperature_k=reference,
            hot_temperature_k=self.hot_temperature_k(),
            region_angle_deg=self.region_angle,
        )

    def hot_temperature_k(self) -> float | None:
        """Temperature of the hot part, K, where it is known."""
        return optional_quantity(self.hot_temperature, "kelvin", "--hot-temperature")
