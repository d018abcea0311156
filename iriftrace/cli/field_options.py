"""Options about the field's file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from attrs import frozen
from cyclopts import Group, Parameter

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from iriftrace.air import Air
    from iriftrace.field import IndexField
    from iriftrace.part import Part

FIELD = Group("Field", sort_key=2)


@Parameter(name="*", group=FIELD)
@frozen
class FieldOptions:
    """How to read the field's file.

    Parameters
    ----------
    array
        Name of the array, where it is not obvious.
    quantity
        What the array holds.
    time
        Which state of a field with several: latest, first, a time such as 2.5, or its name such as
        "t=2.5, P=100".
    temperature_unit
        Unit of a temperature array; by default what the file states, else K.
    field_length_unit
        Unit of the field's coordinates; by default what the file states (OpenFOAM: m), else mm.
    field_transform
        Field to world: 16 numbers, a file with them, or "rotate x 90, scale 0.001".
    isosurfaces
        The file holds ready-made iso-surfaces instead of volume cells; of the options for shells,
        only min-size, smooth, subdivide and triangles then apply.
    field_time
        What the field is in time; stated in every result.
    field_symmetry
        Symmetry imposed on the field, such as "mirrored at x = 0"; stated in every result.
    """

    array: str | None = None
    quantity: Literal["temperature", "density", "index"] | None = None
    time: str | None = None
    temperature_unit: Literal["K", "degC"] | None = None
    field_length_unit: str | None = None
    field_transform: str | None = None
    isosurfaces: bool = False
    field_time: Literal["steady", "mean", "snapshot"] | None = None
    field_symmetry: str | None = None

    def read(
        self,
        path: Path,
        air: Air,
        part: Part | None = None,
        member: int | None = None,
        *,
        flow: bool = False,
    ) -> IndexField:
        """Read the volume field; the part is cut out of one that is scattered points.

        Of a file with several states the one with the number `member`, else that of --time; with
        its velocities, if `flow`.
        """
        from iriftrace.field import read_field
        from iriftrace.readers.members import member_at

        return read_field(
            path,
            array=self.array,
            quantity=self.quantity,
            temperature_unit=self.temperature_unit,
            length_unit=self.field_length_unit,
            air=air,
            transform=self.transform(),
            member=member
            if member is not None or self.time is None
            else member_at(path, self.time).index,
            part=part,
            flow=flow,
        )

    def transform(self) -> NDArray[np.float64] | None:
        """Field to world, (4, 4) array."""
        from iriftrace.transform import parse_transform

        return None if self.field_transform is None else parse_transform(self.field_transform)

    @property
    def steady(self) -> bool | None:
        """Whether the user says that the field is steady; None where the user does not say."""
        return None if self.field_time is None else self.field_time == "steady"

    def notes(self) -> dict[str, str]:
        """What results state about the field."""
        stated = {"time": self.field_time, "symmetry": self.field_symmetry}
        return {key: value for key, value in stated.items() if value is not None}
