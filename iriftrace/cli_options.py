"""Groups of command-line options and what they stand for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from attrs import frozen
from cyclopts import Group, Parameter, Token

from iriftrace.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from iriftrace.air import Air
    from iriftrace.camera import Camera
    from iriftrace.field import IndexField
    from iriftrace.part import Part
    from iriftrace.shell_stack import ShellStack

AIR = Group("Air", sort_key=1)
FIELD = Group("Field", sort_key=2)
SHELLS = Group("Shells", sort_key=3)
PART = Group("Part", sort_key=4)
CAMERA = Group("Camera", sort_key=5)

LARGEST_REFRACTIVITY = 0.01
"""n - 1 of air is far below, a temperature in degC or n itself above."""


def numbers(text: str, count: int, option: str, separator: str = ",") -> list[float]:
    """Numbers of a compound option; InputError when there are more or fewer, or one is NaN."""
    try:
        values = [float(piece) for piece in text.split(separator)]
    except ValueError:
        values = []
    if len(values) != count or any(math.isnan(value) for value in values):
        raise InputError(
            f'{option} is "{text}", but {count} numbers separated by "{separator}" are needed.'
        )
    return values


def finite_numbers(text: str, count: int, option: str) -> list[float]:
    """Numbers of a compound option, none of which may be infinite."""
    values = numbers(text, count, option)
    if any(math.isinf(value) for value in values):
        raise InputError(f'{option} is "{text}", but its numbers must be finite.')
    return values


def quantity(text: str, unit: str, option: str) -> float:
    """A number with or without a unit; the error names the option."""
    from iriftrace.units import parse_quantity

    try:
        value = parse_quantity(text, unit)
    except InputError as error:
        raise InputError(f"{option}: {error}") from error
    if unit == "kelvin" and value < 0.0:
        raise InputError(f"{option}: {text!r} is below absolute zero; check number and unit.")
    return value


def _whole(_type: Any, tokens: Sequence[Token]) -> int:
    """A whole number; the default conversion would cut 2.5 to 2."""
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError(f'"{tokens[0].value}" is not a whole number.') from None


Whole = Annotated[int, Parameter(converter=_whole)]


@Parameter(name="*", group=AIR)
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

    wavelength: str = "633 nm"
    ambient: str = "20 degC"
    pressure: str = "101325 Pa"
    humidity: float = 0.0
    co2: float = 450.0
    air_model: Literal["ciddor", "edlen"] = "ciddor"

    def air(self) -> Air:
        """The air these options describe."""
        from iriftrace.air import Air

        return Air(
            wavelength_nm=quantity(self.wavelength, "nm", "--wavelength"),
            temperature_k=quantity(self.ambient, "kelvin", "--ambient"),
            pressure_pa=quantity(self.pressure, "pascal", "--pressure"),
            relative_humidity=self.humidity,
            co2_ppm=self.co2,
            model=self.air_model,
        )


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
    temperature_unit
        Unit of a temperature array.
    field_length_unit
        Unit of the field's coordinates.
    field_transform
        Field to world: 16 numbers, a file with them, or "rotate x 90, scale 0.001".
    isosurfaces
        The file holds ready-made iso-surfaces instead of volume cells; of the options for shells,
        only min-size, smooth and subdivide then apply.
    field_time
        What the field is in time; stated in every result.
    field_symmetry
        Symmetry imposed on the field, such as "mirrored at x = 0"; stated in every result.
    """

    array: str | None = None
    quantity: Literal["temperature", "density", "index"] | None = None
    temperature_unit: Literal["K", "degC"] = "K"
    field_length_unit: str = "mm"
    field_transform: str | None = None
    isosurfaces: bool = False
    field_time: Literal["steady", "mean", "snapshot"] | None = None
    field_symmetry: str | None = None

    def read(self, path: Path, air: Air) -> IndexField:
        """Read the volume field."""
        from iriftrace.field import read_field

        return read_field(
            path,
            array=self.array,
            quantity=self.quantity,
            temperature_unit=self.temperature_unit,
            length_unit=self.field_length_unit,
            air=air,
            transform=self.transform(),
        )

    def transform(self) -> NDArray[np.float64] | None:
        """Field to world, (4, 4) array."""
        from iriftrace.transform import parse_transform

        return None if self.field_transform is None else parse_transform(self.field_transform)

    def notes(self) -> dict[str, str]:
        """What results state about the field."""
        stated = {"time": self.field_time, "symmetry": self.field_symmetry}
        return {key: value for key, value in stated.items() if value is not None}


@Parameter(name="*", group=SHELLS)
@frozen
class ShellOptions:
    """How the field becomes shells.

    Parameters
    ----------
    layers
        Number of shells.
    index_range
        End points OUTSIDE:INSIDE of the index steps, as n - 1 (2.718e-4:5.8e-5) or as temperatures
        ("20 degC:1100 degC"); by default ambient air and the hottest air of the field.
    levels
        Own list of n - 1 for the shells, separated by commas, instead of layers and rule.
    rule
        Where a shell lies between the layers it separates; "outer" is of first order, for studies.
    min_size
        Pieces of a shell smaller than this are dropped.
    smooth
        Taubin smoothing steps.
    subdivide
        Times every triangle is split into four.
    """

    layers: Whole = 13
    index_range: str | None = None
    levels: str | None = None
    rule: Literal["midpoint", "outer"] = "midpoint"
    min_size: str = "1 mm"
    smooth: Whole = 0
    subdivide: Whole = 0

    def build(self, field: IndexField) -> ShellStack:
        """Contour the field."""
        from iriftrace.shells import contour_shells

        levels = None
        if self.levels is not None:
            count = self.levels.count(",") + 1
            levels = numbers(self.levels, count, "--levels")
        stack = contour_shells(
            field,
            self.layers,
            index_range=self._range(field.air),
            levels=levels,
            rule=self.rule,
            min_size_mm=self.min_size_mm(),
        )
        return self.edited(stack)

    def min_size_mm(self) -> float:
        """Size below which pieces are dropped, mm."""
        return quantity(self.min_size, "mm", "--min-size")

    def edited(self, stack: ShellStack) -> ShellStack:
        """Smooth and subdivide as asked."""
        from iriftrace.shell_edit import smooth_taubin, subdivide_midpoint

        if self.smooth:
            stack = smooth_taubin(stack, self.smooth)
        if self.subdivide:
            stack = subdivide_midpoint(stack, self.subdivide)
        return stack

    def _range(self, air: Air) -> tuple[float, float] | None:
        if self.index_range is None:
            return None
        ends = self.index_range.split(":")
        if len(ends) != 2:
            raise InputError(
                f'--index-range is "{self.index_range}"; give OUTSIDE:INSIDE, as n - 1 or as '
                "temperatures with unit."
            )
        outside, inside = (_refractivity(end, air) for end in ends)
        return outside, inside


def _refractivity(end: str, air: Air) -> float:
    """One end of --index-range: a bare number is n - 1, anything else a temperature."""
    try:
        value = float(end)
    except ValueError:
        return float(air.refractivity(quantity(end, "kelvin", "--index-range")))
    if not 0.0 <= value < LARGEST_REFRACTIVITY:
        raise InputError(
            f'--index-range has the end "{end}", which is no n - 1 of air (5.8e-5 at 1100 degC, '
            '2.718e-4 in the room); a temperature needs its unit, such as "20 degC".'
        )
    return value


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
            expansion=None
            if self.expansion is None
            else quantity(self.expansion, "1/kelvin", "--expansion"),
            reference_temperature_k=reference,
            hot_temperature_k=self.hot_temperature_k(),
            region_angle_deg=self.region_angle,
        )

    def hot_temperature_k(self) -> float | None:
        """Temperature of the hot part, K, where it is known."""
        hot = self.hot_temperature
        return None if hot is None else quantity(hot, "kelvin", "--hot-temperature")


@Parameter(name="*", group=CAMERA)
@frozen
class CameraOptions:
    """The camera; by default the one of Kern et al. (2025), looking from diagonally above.

    Parameters
    ----------
    focal_length
        Distance from pinhole to sensor.
    sensor
        Width and height of the sensor, "6.7 mm,5.6 mm".
    resolution
        Pixels across and down, "2448,2048".
    principal_point
        Where the axis meets the sensor in pixels from the upper left corner, "1224,1024".
    focus
        Nearest and farthest sharp distance NEAR:FAR; "0:inf" for no limit.
    origin
        Camera position in mm, "150,-100,120"; by default diagonally above, outside the hot air
        and not nearer than the focus interval.
    target
        Point that is looked at; by default the part's centre.
    up
        Direction that is up in the picture.
    scale
        Factor on the resolution.
    """

    focal_length: str = "10 mm"
    sensor: str = "6.7 mm,5.6 mm"
    resolution: str = "2448,2048"
    principal_point: str | None = None
    focus: str = "50:250"
    origin: str | None = None
    target: str | None = None
    up: str = "0,0,1"
    scale: float = 0.5

    def camera(self, part: Part, field: IndexField | None, stack: ShellStack) -> Camera:
        """The camera these options describe."""
        from iriftrace.camera import Camera, look_at
        from iriftrace.viewpoint import default_viewpoint

        sizes = [quantity(piece, "mm", "--sensor") for piece in self.sensor.split(",")]
        if len(sizes) != 2:
            raise InputError(
                f'--sensor is "{self.sensor}"; give width and height, "6.7 mm,5.6 mm".'
            )
        width, height = finite_numbers(self.resolution, 2, "--resolution")
        if width % 1 or height % 1:
            raise InputError(f'--resolution is "{self.resolution}"; pixels are whole numbers.')
        near, far = numbers(self.focus, 2, "--focus", ":")
        if self.origin is None:
            origin = default_viewpoint(part, field, stack, near).tolist()
        else:
            origin = finite_numbers(self.origin, 3, "--origin")
        target = part.centre.tolist()
        if self.target is not None:
            target = finite_numbers(self.target, 3, "--target")
        up = finite_numbers(self.up, 3, "--up")
        if not any(up):
            raise InputError(f'--up is "{self.up}", which is no direction; give one, "0,0,1".')
        point = [width / 2, height / 2]
        if self.principal_point is not None:
            point = finite_numbers(self.principal_point, 2, "--principal-point")
        camera = Camera(
            focal_length_mm=quantity(self.focal_length, "mm", "--focal-length"),
            sensor_mm=(sizes[0], sizes[1]),
            resolution=(int(width), int(height)),
            principal_point_px=(point[0], point[1]),
            focus_mm=(near, far),
            matrix=look_at(origin, target, up),
        )
        camera.scaled(self.scale)  # refuses a scale that leaves no pixel
        return camera


Variables = Annotated[
    list[str] | None,
    Parameter(
        name=["-D", "--define"], negative=(), help="Scene parameter, name=value; repeatable."
    ),
]


def variables_of(definitions: list[str] | None) -> dict[str, str]:
    """Scene parameters by name."""
    values = {}
    for text in definitions or []:
        name, equals, value = text.partition("=")
        if not (name and equals and value):
            raise InputError(f'-D is "{text}"; write it as name=value, such as -D scale=0.25.')
        values[name] = value
    return values


Statuses = Annotated[
    list[Whole] | None,
    Parameter(
        negative=(),
        help="Further status codes whose rays the metrics use, such as 5; repeatable.",
    ),
]


def statuses(include: list[int] | None) -> tuple[int, ...]:
    """Status codes of the rays that the metrics use."""
    from iriftrace.status import Status

    known = [status.value for status in Status]
    wrong = [code for code in include or () if code not in known]
    if wrong:
        meanings = ", ".join(f"{status.value} {status.key}" for status in Status)
        raise InputError(f"--include {wrong[0]} is no status of a ray; the codes are {meanings}.")
    return (0, *(include or ()))
