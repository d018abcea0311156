"""Declarations about the files of fields and parts, for Python and for commands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from attrs import field, frozen
from attrs.converters import optional

from iriftrace.core.arrays import FloatArray
from iriftrace.core.units import Expansion, Length, Temperature
from iriftrace.part.hot_temperature import HotTemperatures


@frozen(eq=False)
class ReadField:
    """Reading of the field's file, in air.

    Parameters
    ----------
    array
        Name of the array, if it is not obvious.
    quantity
        Quantity in the array.
    time
        State of a field with several: latest, first, a time such as 2.5, or its name such as
        "t=2.5, P=100".
    temperature_unit
        Unit of a temperature array; by default the unit that the file states, else K.
    length_unit
        Unit of the field's coordinates; by default the one the file states (OpenFOAM: m), else mm.
    transform
        Field to world: 16 numbers, a file with them, or "rotate x 90, scale 0.001".
    isosurfaces
        The file holds ready-made iso-surfaces instead of volume cells; of the options for shells,
        only min-size and triangles then apply.
    kind
        Kind of the field in time; stated in every result.
    symmetry
        Symmetry imposed on the field, such as "mirrored at x = 0"; stated in every result.
    """

    array: str | None = None
    quantity: Literal["temperature", "density", "index"] | None = None
    time: str | None = None
    temperature_unit: Literal["K", "degC"] | None = None
    length_unit: str | None = None
    transform: str | FloatArray | None = None
    isosurfaces: bool = False
    kind: Literal["steady", "mean", "snapshot"] | None = None
    symmetry: str | None = None

    @property
    def matrix(self) -> FloatArray | None:
        """Field to world, (4, 4) array, mm."""
        return _matrix(self.transform)

    @property
    def steady(self) -> bool | None:
        """True or False if the field is declared as steady or not; else None."""
        return None if self.kind is None else self.kind == "steady"

    @property
    def notes(self) -> dict[str, str]:
        """Remarks about the field for all results."""
        stated = {"time": self.kind, "symmetry": self.symmetry}
        return {key: value for key, value in stated.items() if value is not None}


@frozen(eq=False)
class ReadPart:
    """Reading of the part's file.

    Parameters
    ----------
    length_unit
        Unit of the part's coordinates; by default the unit that the file states (glTF: m), else mm.
    transform
        Part to world: 16 numbers, a file with them, or "rotate x 90, scale 0.001".
    expansion
        Linear thermal expansion of a part drawn cold, such as "14e-6/K".
    reference_temperature
        Temperature at which the part was drawn.
    hot_temperature
        Temperature of the hot part, "1050 degC", needed with expansion; repeatable for regions with
        another one, NAME=TEMPERATURE or a pattern, "plane -x*=900 degC"; or "field", those of the
        field's wall. If they differ, the part expands as a free elastic body. Each place inside has
        the temperature of the nearest wall, which is an approximation.
    region_angle
        Faces that meet at a smaller angle (degrees) belong to one region.
    chord_error
        Largest distance of triangles from the surfaces of a STEP file.
    """

    length_unit: str | None = None
    transform: str | FloatArray | None = None
    expansion: Expansion | None = field(default=None, converter=optional(Expansion))
    reference_temperature: Temperature = field(
        default=Temperature("20 degC"), converter=Temperature
    )
    hot_temperature: str | float | Sequence[str] | None = None
    region_angle: float = 30.0
    chord_error: Length = field(default=Length("0.002 mm"), converter=Length)

    @property
    def matrix(self) -> FloatArray | None:
        """Part to world, (4, 4) array, mm."""
        return _matrix(self.transform)

    @property
    def hot(self) -> HotTemperatures:
        """The temperatures of the hot part."""
        return HotTemperatures.of(self.hot_temperature)


def _matrix(transform: str | FloatArray | None) -> FloatArray | None:
    from iriftrace.core.mesh.transform import checked_matrix, parse_transform

    if transform is None:
        return None
    return parse_transform(transform) if isinstance(transform, str) else checked_matrix(transform)


FIELD_AS_STATED = ReadField()
"""A field as its file states it."""

AS_DRAWN = ReadPart()
"""A part as its file states it, neither moved nor expanded."""
