"""Values of options with their units."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

from attrs import field, frozen
from cyclopts import Parameter, Token

from iriftrace.core.errors import InputError, warn
from iriftrace.core.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    from iriftrace.part.part import Part
    from iriftrace.part.uneven_growth import Temperatures


T = TypeVar("T")


def numbers(text: str, count: int, option: str, separator: str = ",") -> tuple[float, ...]:
    """Numbers of a compound option; raises InputError if there are more or fewer, or one is NaN."""
    try:
        values = [float(piece) for piece in text.split(separator)]
    except ValueError:
        values = []
    if len(values) != count or any(math.isnan(value) for value in values):
        raise InputError(
            f'{option} is "{text}", but {count} numbers separated by "{separator}" are needed.'
        )
    return tuple(values)


def quantity(text: str, unit: str, option: str) -> float:
    """A number with or without a unit, in `unit`; the error names the option."""
    from iriftrace.core.units import parse_quantity

    try:
        value = parse_quantity(text, unit)
    except InputError as error:
        raise InputError(f"{option}: {error}") from error
    if unit == "kelvin" and value < 0.0:
        raise InputError(f"{option}: {text!r} is below absolute zero; check number and unit.")
    return value


def word_parameter(
    metavar: str, read: Callable[[str, str], T], show: Callable[[T], str] = str
) -> Parameter:
    """An option of one word; `read` is called with the word and the option's name.

    In the help the word is called `metavar`, and `show` writes default values as users would.
    """

    def convert(_type: object, tokens: Sequence[Token]) -> T:
        return read(tokens[0].value, tokens[0].keyword or "")

    def default(value: T | None) -> str | None:
        return None if value is None else show(value)

    return Parameter(
        converter=convert,
        metavar=metavar,
        n_tokens=1,
        accepts_keys=False,
        show_default=default,
    )


def _quantity(metavar: str, unit: str, show: Callable[[float], str]) -> Parameter:
    return word_parameter(metavar, lambda text, option: quantity(text, unit, option), show)


def celsius(kelvin: float) -> str:
    """A temperature as users write it."""
    return f"{round(kelvin - ZERO_CELSIUS_K, 6):g} degC"


def _fraction(text: str, option: str) -> float:
    from iriftrace.core.units import parse_quantity

    try:
        return parse_quantity(text, "dimensionless")
    except InputError as error:
        raise InputError(
            f'{option} is "{text}", but it is a fraction; write "5 %" or 0.05.'
        ) from error


def _whole(text: str, _option: str) -> int:
    """A whole number; the default conversion would truncate 2.5 to 2."""
    try:
        return int(text)
    except ValueError:
        raise ValueError(f'"{text}" is not a whole number.') from None


def _finite(metavar: str, count: int | None = None) -> Parameter:
    """Finite numbers separated by commas, `count` of them if given."""

    def read(text: str, option: str) -> tuple[float, ...]:
        values = numbers(text, count or text.count(",") + 1, option)
        if any(math.isinf(value) for value in values):
            raise InputError(f'{option} is "{text}", but its numbers must be finite.')
        return values

    return word_parameter(metavar, read, lambda values: ",".join(f"{value:g}" for value in values))


def _size(text: str, option: str) -> tuple[float, float]:
    """Width and height in mm."""
    lengths = [quantity(piece, "mm", option) for piece in text.split(",")]
    if len(lengths) != 2:
        raise InputError(f'{option} is "{text}"; give width and height, "6.7 mm,5.6 mm".')
    return lengths[0], lengths[1]


def _lengths(text: str, option: str) -> tuple[float, ...]:
    """Lengths in mm, none of them twice, as its poses would be ranked twice."""
    lengths = tuple(quantity(piece, "mm", option) for piece in text.split(","))
    if len(set(lengths)) < len(lengths):
        raise InputError(
            f'{option} is "{text}", with a length twice, so that its poses would count twice; give '
            "each once."
        )
    return lengths


def _length_with_unit(text: str, option: str) -> float:
    """A length, mm, that is usual in another unit, so that a bare number is refused."""
    try:
        float(text)
    except ValueError:
        return quantity(text, "mm", option)
    raise InputError(f'{option} is "{text}" without a unit; write it with one, like "20 um".')


Output = Annotated[Path, Parameter(name=["-o", "--output"])]
Flag = Annotated[bool, Parameter(negative=())]
"""A switch without a ``--no-`` form."""
Whole = Annotated[int, word_parameter("INT", _whole)]

# Quantities as floats, mm, nm, Pa, s, degree, m/s, 1/K and K; users may write any other unit.
Length = Annotated[float, _quantity("LENGTH", "mm", "{:g} mm".format)]
LengthWithUnit = Annotated[float, word_parameter("LENGTH", _length_with_unit)]
Wavelength = Annotated[float, _quantity("LENGTH", "nm", "{:g} nm".format)]
LightOf = Annotated[
    Wavelength | None,
    Parameter(help='Wavelength that the file must have, "450 nm"; other light is refused.'),
]
Pressure = Annotated[float, _quantity("PRESSURE", "pascal", "{:g} Pa".format)]
Duration = Annotated[float, _quantity("TIME", "second", "{:g} s".format)]
Fraction = Annotated[
    float, word_parameter("FRACTION", _fraction, lambda value: f"{100 * value:g} %")
]
Angle = Annotated[float, _quantity("ANGLE", "degree", "{:g} deg".format)]
Speed = Annotated[float, _quantity("SPEED", "m/s", "{:g} m/s".format)]
Expansion = Annotated[float, _quantity("EXPANSION", "1/kelvin", "{:g} /K".format)]
Temperature = Annotated[float, _quantity("TEMPERATURE", "kelvin", celsius)]

# Several in one word.
Lengths = Annotated[tuple[float, ...], word_parameter("LENGTH,...", _lengths)]
Size = Annotated[
    tuple[float, float],
    word_parameter("WIDTH,HEIGHT", _size, lambda size: f"{size[0]:g} mm,{size[1]:g} mm"),
]
Interval = Annotated[
    tuple[float, float],
    word_parameter(
        "NEAR:FAR",
        lambda text, option: numbers(text, 2, option, ":"),
        lambda ends: f"{ends[0]:g}:{ends[1]:g}",
    ),
]
Numbers = Annotated[tuple[float, ...], _finite("NUMBER,...")]
Pair = Annotated[tuple[float, float], _finite("ACROSS,DOWN", 2)]
Vector = Annotated[tuple[float, float, float], _finite("X,Y,Z", 3)]


def refuse_given(options: Mapping[str, object], reason: str) -> None:
    """Refuse options, values by name, if one is not None; the reason follows its name."""
    for name, value in options.items():
        if value is not None:
            raise InputError(f"{name} {reason}")


def region_temperatures(
    texts: Sequence[str] | None, option: str = "--region-temperature"
) -> dict[str, float]:
    """Temperatures, K, of the regions that ``--region-temperature NAME=TEMPERATURE`` name."""
    found: dict[str, float] = {}
    for text in texts or ():
        name, equals, value = text.rpartition("=")
        if not (name and equals and value):
            raise InputError(
                f'{option} is "{text}"; write it as NAME=TEMPERATURE, such as "head +x=450 degC".'
            )
        if name in found:
            raise InputError(f'{option} names "{name}" twice; give it once.')
        found[name] = quantity(value, "kelvin", option)
    return found


FIELD = "field"
"""The word of --hot-temperature for the temperatures of the field's wall."""


@frozen
class HotTemperatures:
    """Temperature of the part and of regions, K; or, if `of_field`, those of a field's wall."""

    default: float | None = None
    regions: dict[str, float] = field(factory=dict)
    of_field: bool = False

    @classmethod
    def of_words(cls, words: Sequence[str] | None) -> HotTemperatures:
        """Read the user's words: a temperature, NAME=TEMPERATURE, or "field"."""
        option, given = "--hot-temperature", list(words or ())
        if FIELD in given:
            if len(given) > 1:
                raise InputError(
                    f'{option} is "field" and also a temperature; give the one or the other.'
                )
            return cls(of_field=True)
        alone = [word for word in given if "=" not in word]
        regions = region_temperatures([word for word in given if "=" in word], option)
        if len(alone) > 1 or (regions and not alone):
            raise InputError(
                f"{option} gives {len(alone)} temperatures for the whole part; give one, and "
                "NAME=TEMPERATURE for regions with another one."
            )
        return cls(quantity(alone[0], "kelvin", option) if alone else None, regions)

    @property
    def single(self) -> float | None:
        """The one temperature of the whole part, K; None if there are several or none."""
        return None if self.regions else self.default

    @property
    def uneven(self) -> bool:
        """True if the part may not have the same temperature everywhere."""
        return self.of_field or bool(self.regions)

    def wall(
        self, kelvin: float | None, regions: list[str] | None
    ) -> tuple[float | None, list[str] | None]:
        """Temperature of the wall, K, and NAME=TEMPERATURE of regions: by default these.

        Warns of a wall with another temperature than that by which the part expands.
        """
        if kelvin is None and self.default is not None:
            own = [f"{name}={kelvins!r} K" for name, kelvins in self.regions.items()]
            return self.default, own if regions is None else regions
        if kelvin is not None and self.single is not None and abs(self.single - kelvin) > 1.0:
            warn(
                f"The part expands to its size at {celsius(self.single)} (--hot-temperature), but "
                f"its wall has {celsius(kelvin)} (--wall-temperature); leave one of them out."
            )
        return kelvin, regions

    def at_walls(
        self, part: Part, field_wall: Callable[[Part], Temperatures] | None
    ) -> Temperatures:
        """Temperatures of the walls nearest to points; for a field those of `field_wall`."""
        from iriftrace.part.region_choice import values_by_region
        from iriftrace.part.wall_temperature import WallTemperatures, wall_temperature

        if self.of_field or self.default is None:
            if field_wall is None:
                raise InputError(
                    '--hot-temperature is "field", but this command reads the part without a '
                    "field; give a temperature, and NAME=TEMPERATURE for regions with another one."
                )
            return field_wall(part)
        wall = WallTemperatures(self.default, values_by_region(part, self.regions))
        return lambda points: wall_temperature(wall, part, points)
