"""Options about air, part, field and shells, and the objects that they define."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from attrs import asdict, frozen
from cyclopts import Group, Parameter

from iriftrace.cli.console import say, working
from iriftrace.cli.options import (
    Expansion,
    HotTemperatures,
    Length,
    Numbers,
    Pressure,
    Temperature,
    Wavelength,
    Whole,
    celsius,
    quantity,
)
from iriftrace.core.errors import InputError
from iriftrace.core.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from iriftrace.medium.air.refractivity import Air
    from iriftrace.medium.index_field import IndexField
    from iriftrace.medium.shells.stack import ShellStack
    from iriftrace.part.part import Part
    from iriftrace.part.uneven_growth import Temperatures


@Parameter(name="*", group=Group("Air", sort_key=1))
@frozen
class AirOptions:
    """The air around the part.

    Parameters
    ----------
    wavelength
        Wavelength of the light.
    ambient
        Temperature of the ambient air.
    pressure
        Air pressure.
    humidity
        Relative humidity, 0 to 1.
    co2
        Carbon dioxide in ppm.
    air_model
        Formula for the ambient air; hot air is scaled by its density.
    """

    wavelength: Wavelength = 633.0
    ambient: Temperature = 20.0 + ZERO_CELSIUS_K
    pressure: Pressure = 101325.0
    humidity: float = 0.0
    co2: float = 450.0
    air_model: Literal["ciddor", "edlen"] = "ciddor"

    def air(self) -> Air:
        """The air that these options describe."""
        from iriftrace.medium.air.refractivity import Air

        return Air(
            wavelength_nm=self.wavelength,
            temperature_k=self.ambient,
            pressure_pa=self.pressure,
            relative_humidity=self.humidity,
            co2_ppm=self.co2,
            model=self.air_model,
        )


@Parameter(name="*", group=Group("Part", sort_key=4))
@frozen
class PartOptions:
    """Reading of the part's file.

    Parameters
    ----------
    length_unit
        Unit of the part's coordinates; by default the unit that the file states (glTF: m), else mm.
    part_transform
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
    """

    length_unit: str | None = None
    part_transform: str | None = None
    expansion: Expansion | None = None
    reference_temperature: Temperature = 20.0 + ZERO_CELSIUS_K
    hot_temperature: list[str] | None = None
    region_angle: float = 30.0

    def read(self, path: Path, field_wall: Callable[[Part], Temperatures] | None = None) -> Part:
        """Read the part; `field_wall` returns the temperatures of the field's wall, if needed."""
        from iriftrace.core.mesh.transform import parse_transform
        from iriftrace.io.part_files import read_part
        from iriftrace.part.uneven_growth import grown_unevenly

        hot = self.hot
        if self.expansion is None and self.hot_temperature:
            raise InputError(
                "--hot-temperature is given, by which the part expands only with --expansion; give "
                "that, such as 14e-6/K, or leave --hot-temperature out for a part drawn hot."
            )
        matrix = None if self.part_transform is None else parse_transform(self.part_transform)
        part = read_part(
            path,
            length_unit=self.length_unit,
            transform=matrix,
            expansion=None if hot.uneven else self.expansion,
            reference_temperature_k=self.reference_temperature,
            hot_temperature_k=hot.default,
            region_angle_deg=self.region_angle,
        )
        sides = " x ".join(f"{side:.4g}" for side in part.bounds[1] - part.bounds[0])
        upright = matrix is not None or path.suffix.lower() not in (".glb", ".gltf")
        up = "" if upright else "; up is y in glTF, but z here (--part-transform 'rotate x 90')"
        hot_k = None if part.growth is None else part.growth.hot_k
        size = "" if hot_k is None else f" at {celsius(hot_k)}"
        say(f"Part {path}: {sides} mm{size}, read in {part.length_unit}{up}.")
        if self.expansion is None or not hot.uneven:
            return part
        return grown_unevenly(
            part,
            self.expansion,
            self.reference_temperature,
            hot.at_walls(part, field_wall),
            (0.0, 0.0, 0.0) if matrix is None else matrix[:3, 3],
        )

    @property
    def hot(self) -> HotTemperatures:
        """The values of --hot-temperature."""
        return HotTemperatures.of_words(self.hot_temperature)

    def words(self) -> list[str]:
        """The options that differ from their defaults, as typed."""
        written: dict[str, Callable[[Any], str]] = {
            "expansion": lambda value: f"{value!r}/K",
            "reference_temperature": celsius,
        }
        values = asdict(self, filter=lambda option, value: value != option.default)
        return [
            word
            for name, value in values.items()
            for each in (value if isinstance(value, list) else [value])
            for word in (f"--{name.replace('_', '-')}", written.get(name, str)(each))
        ]


@Parameter(name="*", group=Group("Field", sort_key=2))
@frozen
class FieldOptions:
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
    field_length_unit
        Unit of the field's coordinates; by default the one the file states (OpenFOAM: m), else mm.
    field_transform
        Field to world: 16 numbers, a file with them, or "rotate x 90, scale 0.001".
    isosurfaces
        The file holds ready-made iso-surfaces instead of volume cells; of the options for shells,
        only min-size and triangles then apply.
    field_time
        Kind of the field in time; stated in every result.
    field_symmetry
        Symmetry imposed on the field, such as "mirrored at x = 0"; stated in every result.
    """

    air: AirOptions = AirOptions()
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
        part: Part | None = None,
        member: int | None = None,
        *,
        flow: bool = False,
    ) -> IndexField:
        """Read the volume field; the part is cut out of a field of scattered points.

        From a file with several states, read the one with the number `member`, else that of --time;
        with its velocities, if `flow`.
        """
        from iriftrace.io.field import read_field
        from iriftrace.io.members import member_at

        if member is None and self.time is not None:
            member = member_at(path, self.time).index
        return read_field(
            path,
            array=self.array,
            quantity=self.quantity,
            temperature_unit=self.temperature_unit,
            length_unit=self.field_length_unit,
            air=self.air.air(),
            transform=self.transform(),
            member=member,
            part=part,
            flow=flow,
        )

    def read_wall(self, path: Path, part: Part, member: int | None = None) -> Temperatures:
        """Temperatures of the wall of the field."""
        return self.read(path, part, member).wall_temperature_k

    def transform(self) -> NDArray[np.float64] | None:
        """Field to world, (4, 4) array."""
        from iriftrace.core.mesh.transform import parse_transform

        return None if self.field_transform is None else parse_transform(self.field_transform)

    @property
    def steady(self) -> bool | None:
        """True or False if the user states that the field is steady or not; else None."""
        return None if self.field_time is None else self.field_time == "steady"

    def notes(self) -> dict[str, str]:
        """Remarks about the field for all results."""
        stated = {"time": self.field_time, "symmetry": self.field_symmetry}
        return {key: value for key, value in stated.items() if value is not None}


Rule = Literal["rim", "midpoint", "graded", "outer"]


@Parameter(name="*", group=Group("Shells", sort_key=3))
@frozen
class ShellOptions:
    """Contouring of the field, once it is read.

    Parameters
    ----------
    layers
        Number of shells.
    index_range
        End points OUTSIDE:INSIDE of the index steps, as n - 1 (2.718e-4:5.8e-5) or as temperatures
        ("20 degC:1100 degC"); by default ambient air and the hottest air of the field.
    levels
        List of n - 1 for the shells, separated by commas, instead of layers and rule.
    rule
        Steps of the index and where a shell lies in them: "rim" is equal steps and one thin one
        outside; "midpoint" steps are equal, as in Kern et al. (2025); "graded" ones are finer at
        the wall and in the outer tail, for few shells across a plume; "outer" is of first order,
        for studies.
    min_size
        Pieces of a shell smaller than this are dropped.
    triangles
        Reduce the shells to about this many triangles in all; by default all are kept.
    """

    field: FieldOptions = FieldOptions()
    layers: Whole = 13
    index_range: str | None = None
    levels: Numbers | None = None
    rule: Annotated[Rule, Parameter(name=["--rule", "--index-rule"])] = "rim"
    min_size: Length = 1.0
    triangles: Whole | None = None

    def build(self, field: IndexField) -> ShellStack:
        """Contour the field."""
        from iriftrace.medium.shells.contour import contour_shells

        stack = contour_shells(
            field,
            self.layers,
            index_range=self._range(field.air),
            levels=self.levels,
            rule=self.rule,
            min_size_mm=self.min_size,
        )
        return self._reduced(stack)

    def stack(
        self, path: Path, part: Part | None, member: int | None = None
    ) -> tuple[ShellStack, IndexField | None]:
        """Shells of a volume field, or ready-made ones."""
        reading = self.field
        if reading.isosurfaces:
            from iriftrace.io.iso_surfaces import import_shells

            if reading.time is not None:
                raise InputError(
                    f'--time is "{reading.time}", but a file of iso-surfaces is read as a whole; '
                    "export the surfaces of one time."
                )
            with working("Reading iso-surfaces"):
                stack = import_shells(
                    path,
                    array=reading.array,
                    quantity=reading.quantity,
                    temperature_unit=reading.temperature_unit,
                    air=reading.air.air(),
                    length_unit=reading.field_length_unit or "mm",
                    transform=reading.transform(),
                    min_size_mm=self.min_size,
                )
            return self._reduced(stack), None
        with working("Reading the field"):
            volume = reading.read(path, part, member)
        with working("Contouring the shells"):
            return self.build(volume), volume

    def _reduced(self, stack: ShellStack) -> ShellStack:
        from iriftrace.medium.shells.decimate import decimate

        return stack if self.triangles is None else decimate(stack, self.triangles)

    def _range(self, air: Air) -> tuple[float, float] | None:
        if self.index_range is None:
            return None
        ends = self.index_range.split(":")
        if len(ends) != 2:
            raise InputError(
                f'--index-range is "{self.index_range}"; give OUTSIDE:INSIDE, as n - 1 or as '
                "temperatures with unit."
            )
        return _refractivity(ends[0], air), _refractivity(ends[1], air)


def _refractivity(end: str, air: Air) -> float:
    """One end of --index-range: a bare number is n - 1, anything else a temperature."""
    try:
        value = float(end)
    except ValueError:
        return float(air.refractivity(quantity(end, "kelvin", "--index-range")))
    # n - 1 of air is far below this, a temperature in degC or n itself above.
    if not 0.0 <= value < 0.01:
        raise InputError(
            f'--index-range has the end "{end}", which is not n - 1 of air (5.8e-5 at 1100 degC, '
            '2.718e-4 in the room); a temperature needs its unit, such as "20 degC".'
        )
    return value
