"""Groups of command-line options and what they stand for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from attrs import frozen
from cyclopts import Group, Parameter

from iriftrace.errors import InputError

if TYPE_CHECKING:
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


def numbers(text: str, count: int, option: str, separator: str = ",") -> list[float]:
    """Numbers of a compound option; InputError when there are more or fewer."""
    try:
        values = [float(piece) for piece in text.split(separator)]
    except ValueError:
        values = []
    if len(values) != count:
        raise InputError(
            f'{option} is "{text}", but {count} numbers separated by "{separator}" are needed.'
        )
    return values


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
        from iriftrace.units import parse_quantity

        return Air(
            wavelength_nm=parse_quantity(self.wavelength, "nm"),
            temperature_k=parse_quantity(self.ambient, "kelvin"),
            pressure_pa=parse_quantity(self.pressure, "pascal"),
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
        The file holds ready-made iso-surfaces instead of volume cells.
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
        from iriftrace.transform import parse_transform

        return read_field(
            path,
            array=self.array,
            quantity=self.quantity,
            temperature_unit=self.temperature_unit,
            length_unit=self.field_length_unit,
            air=air,
            transform=None
            if self.field_transform is None
            else parse_transform(self.field_transform),
        )

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
        Own list of n - 1 for the shells, separated by commas.
    rule
        Where a shell lies between the layers it separates; "outer" is of first order, for studies.
    min_size
        Pieces of a shell smaller than this are dropped.
    smooth
        Taubin smoothing steps.
    subdivide
        Times every triangle is split into four.
    """

    layers: int = 13
    index_range: str | None = None
    levels: str | None = None
    rule: Literal["midpoint", "outer"] = "midpoint"
    min_size: str = "1 mm"
    smooth: int = 0
    subdivide: int = 0

    def build(self, field: IndexField) -> ShellStack:
        """Contour the field."""
        from iriftrace.shells import contour_shells
        from iriftrace.units import parse_quantity

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
            min_size_mm=parse_quantity(self.min_size, "mm"),
        )
        return self.edited(stack)

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
        from iriftrace.units import parse_quantity

        ends = self.index_range.split(":")
        if len(ends) != 2:
            raise InputError(
                f'--index-range is "{self.index_range}"; give OUTSIDE:INSIDE, as n - 1 or as '
                "temperatures with unit."
            )
        try:
            outside, inside = (float(end) for end in ends)
        except ValueError:
            outside, inside = (
                float(air.refractivity(parse_quantity(end, "kelvin"))) for end in ends
            )
        return outside, inside


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
        from iriftrace.units import parse_quantity

        hot = self.hot_temperature
        return read_part(
            path,
            length_unit=self.length_unit,
            transform=None if self.part_transform is None else parse_transform(self.part_transform),
            expansion=None
            if self.expansion is None
            else parse_quantity(self.expansion, "1/kelvin"),
            reference_temperature_k=parse_quantity(self.reference_temperature, "kelvin"),
            hot_temperature_k=None if hot is None else parse_quantity(hot, "kelvin"),
            region_angle_deg=self.region_angle,
        )


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
        Camera position in mm, "150,-100,120"; by default diagonally above, outside the hot air.
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

    def camera(self, part: Part, field: IndexField | None) -> Camera:
        """The camera these options describe."""
        from iriftrace.camera import Camera, look_at
        from iriftrace.units import parse_quantity
        from iriftrace.viewpoint import default_viewpoint

        sizes = [parse_quantity(piece, "mm") for piece in self.sensor.split(",")]
        if len(sizes) != 2:
            raise InputError(
                f'--sensor is "{self.sensor}"; give width and height, "6.7 mm,5.6 mm".'
            )
        width, height = numbers(self.resolution, 2, "--resolution")
        near, far = numbers(self.focus, 2, "--focus", ":")
        target = part.centre if self.target is None else numbers(self.target, 3, "--target")
        given = self.origin
        origin = default_viewpoint(part, field) if given is None else numbers(given, 3, "--origin")
        point = self.principal_point
        x, y = (width / 2, height / 2) if point is None else numbers(point, 2, "--principal-point")
        return Camera(
            focal_length_mm=parse_quantity(self.focal_length, "mm"),
            sensor_mm=(sizes[0], sizes[1]),
            resolution=(int(width), int(height)),
            principal_point_px=(x, y),
            focus_mm=(near, far),
            matrix=look_at(origin, target, numbers(self.up, 3, "--up")),
        )


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
