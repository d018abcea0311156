"""Numbers with units, as written in files and on the command line."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from functools import cache
from typing import TYPE_CHECKING, ClassVar, Self

from iriftrace.core.errors import InputError, warn

if TYPE_CHECKING:
    import pint

ZERO_CELSIUS_K = 273.15
"""0 degC in kelvin."""

PLAUSIBLE_K = (200.0, 3000.0)
"""Temperatures of parts, walls and the air around them; others are in another unit."""

_MILLIMETRES = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1e3, "inch": 25.4, "in": 25.4}
LENGTH_UNITS = {
    **dict.fromkeys(("um", "µm", "μm", "micron", "microns"), "um"),
    **dict.fromkeys(("micrometer", "micrometre", "micrometers", "micrometres"), "um"),
    **dict.fromkeys(("mm", "millimeter", "millimetre", "millimeters", "millimetres"), "mm"),
    **dict.fromkeys(("cm", "centimeter", "centimetre", "centimeters", "centimetres"), "cm"),
    **dict.fromkeys(("m", "meter", "metre", "meters", "metres"), "m"),
    **dict.fromkeys(("in", "inch", "inches"), "inch"),
}
"""Length units by the names that files give them."""

_STATED_UNIT = re.compile(
    r"(?<![^\W_])(?:length[ _]?)?units?\s*[:=]\s*[\[(]?\s*([a-zµμ]+)", re.IGNORECASE
)

_NAME = r"[A-Za-z°µμ%_]+(?:(?:\*\*|\^)[-+]?\d+)?"
_QUANTITY = re.compile(
    r"(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*"
    rf"(?P<unit>/?\s*{_NAME}(?:\s*[*/]\s*{_NAME})*)"
)


def parse_quantity(text: str | float, unit: str) -> float:
    """Read a number with or without a unit, as in ``"20 degC"``, ``"1 atm"`` or ``"14e-6/K"``.

    `unit` is that of the result and of a bare number, in pint's names (``"kelvin"``, ``"pascal"``,
    ``"mm"``, ``"1/kelvin"``). A float is a temperature in K, but a text of a temperature needs its
    unit. Raises InputError for anything but a number with a unit, for another dimension, and for a
    number that is not finite.
    """
    try:
        value, bare = float(text), isinstance(text, str)
    except ValueError:
        value, bare = _convert(str(text), unit), False
    if not math.isfinite(value):
        raise InputError(
            f"{text!r} is not a finite number; give one in {unit}.", code="units.not_finite"
        )
    if bare and unit == "kelvin":
        number = str(text).strip()
        raise InputError(
            f"{text!r} is a temperature without a unit, {number} K or {number} degC; write the one "
            "that is meant.",
            code="units.no_unit",
        )
    return value


def named_quantities(text: str, units: Mapping[str, str]) -> dict[str, float]:
    """Read ``"wall 10 K, pressure 2 hPa, air 5 %"`` as numbers in the `units` of their names.

    A number in ``"K"`` is a difference of temperatures. Raises ValueError, with the fault and its
    remedy, for an unknown name, a number without its unit, or a name that is given twice.
    """
    found: dict[str, float] = {}
    for piece in filter(None, map(str.strip, text.split(","))):
        name, _, value = piece.partition(" ")
        if name not in units:
            raise ValueError(f"{name!r} is not an input; use {', '.join(units)}")
        if name in found:
            raise ValueError(f"{name!r} is given twice; give it once")
        found[name] = _named(name, value.strip(), units[name])
    return found


_EXAMPLES = {
    "dimensionless": "5 %",
    "K": "10 K",
    "pascal": "2 hPa",
    "mm": "8 um",
    "radian": "0.1 mrad",
}
"""Values as they are written, by unit."""


def _named(name: str, text: str, unit: str) -> float:
    """A number with its unit; ValueError with the fault and its remedy."""
    try:
        float(text)
        bare = True
    except ValueError:
        bare = False
    example = f'"{name} {_EXAMPLES[unit]}"'
    if bare and unit != "dimensionless":
        raise ValueError(f"{name} has no unit; write it with one, like {example}")
    if unit == "K" and not text.endswith("K"):
        raise ValueError(f"{name} is {text!r}; give a difference in K, like {example}")
    try:
        return float(text.removesuffix("K")) if unit == "K" else parse_quantity(text, unit)
    except (InputError, ValueError):
        raise ValueError(f"{name} is {text!r}; write it like {example}") from None


def stated_length_unit(remark: str) -> str:
    """Length unit that a remark states, as in ``# unit: mm`` or ``UNITS=inch``; "" for none."""
    found = _STATED_UNIT.search(remark)
    return LENGTH_UNITS.get(found[1].casefold(), "") if found else ""


def length_unit_of(remarks: Iterable[str], name: str) -> str:
    """Length unit that one of the remarks in a file of some name states; "" for none.

    Warned of is a remark that states another unit.
    """
    stated = [remark for remark in remarks if _STATED_UNIT.search(remark)]
    unit = next(filter(None, map(stated_length_unit, stated)), "")
    if stated and not unit:
        warn(
            f"{name} says {stated[0].strip()!r}, which is not a unit of length known here; its "
            "lengths are read in mm, unless a unit is given."
        )
    return unit


def length_factor(unit: str) -> float:
    """Millimetres in one length unit (um, mm, cm, m, inch, in); InputError for another name."""
    name = unit.strip()
    try:
        return _MILLIMETRES[LENGTH_UNITS.get(name.casefold(), name)]
    except KeyError:
        raise InputError(
            f"{unit!r} is not a length unit known here; use one of {', '.join(_MILLIMETRES)}.",
            code="units.unknown_length",
        ) from None


@cache
def _registry() -> pint.UnitRegistry[float]:
    # Imported when needed: pint takes a noticeable time, and most numbers have no unit.
    import pint

    return pint.UnitRegistry()


def _convert(text: str, unit: str) -> float:
    import pint

    match = _QUANTITY.fullmatch(text.strip())
    if match is None:
        sign = unit.removeprefix("1")  # "20 1/kelvin" would be two numbers
        raise InputError(
            f"{text!r} is not a number with a unit; write it like '20 {sign}'.",
            code="units.no_number",
        )
    number, name = float(match["number"]), match["unit"]
    if unit in ("kelvin", "K", "1/kelvin"):
        # pint reads C as coulomb and F as farad, which nobody means here.
        name = re.sub(r"(?<![\w°])[CF]$", r"deg\g<0>", name)
    registry = _registry()
    try:
        quantity = registry.Quantity(number, f"1{name}" if name.startswith("/") else name)
        return float(quantity.to(unit).magnitude)
    except pint.UndefinedUnitError:
        raise InputError(
            f"{text!r} has an unknown unit; give the number in {unit}.", code="units.unknown_name"
        ) from None
    except (pint.DimensionalityError, pint.OffsetUnitCalculusError):
        raise InputError(
            f"{text!r} cannot be converted to {unit}; give the number in {unit} or in a unit of "
            "the same kind.",
            code="units.other_dimension",
        ) from None


def counted(count: int, noun: str) -> str:
    """A number with its noun: "1 pose", "1,224 poses"."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


class _Quantity(float):
    """A number in `unit` (pint's name), also read from text.

    `str` shows it with its `symbol`; in an f-string it is the plain number.
    """

    unit: ClassVar[str]
    symbol: ClassVar[str]

    def __new__(cls, value: str | float) -> Self:
        return super().__new__(cls, parse_quantity(value, cls.unit))

    def __str__(self) -> str:
        return f"{self:g} {self.symbol}"

    def __format__(self, spec: str) -> str:
        return format(float(self), spec)


class Length(_Quantity):
    """A length, mm."""

    unit, symbol = "mm", "mm"


class LengthWithUnit(Length):
    """A length, mm, that is usual in another unit, so that a text needs its unit."""

    def __new__(cls, value: str | float) -> Self:
        if isinstance(value, str) and _is_number(value):
            raise InputError(
                f'"{value}" is a length without a unit; write it with one, like "20 um".',
                code="units.no_unit",
            )
        return super().__new__(cls, value)


class FNumber(float):
    """Focal length over the aperture's diameter; in a text "f/4", in an f-string the number."""

    def __new__(cls, value: str | float) -> Self:
        first, slash, number = value.partition("/") if isinstance(value, str) else ("f", "/", value)
        try:
            if first.strip().lower() != "f" or not slash:
                raise ValueError
            return super().__new__(cls, number)
        except ValueError:
            raise InputError(
                f'"{value}" is not an f-number; write it like f/4.', code="aperture.not_read"
            ) from None

    def __str__(self) -> str:
        return f"f/{self:g}"

    __format__ = _Quantity.__format__


class Wavelength(_Quantity):
    """A wavelength, nm."""

    unit, symbol = "nm", "nm"


class Temperature(_Quantity):
    """An absolute temperature, K; a text needs its unit, and `str` shows degC."""

    unit, symbol = "kelvin", "degC"

    def __new__(cls, value: str | float) -> Self:
        kelvin = super().__new__(cls, value)
        if kelvin < 0.0:
            raise InputError(
                f"{value!r} is below absolute zero; check number and unit.",
                code="units.below_zero",
            )
        return kelvin

    def __str__(self) -> str:
        return f"{round(self - ZERO_CELSIUS_K, 6):g} {self.symbol}"


class Pressure(_Quantity):
    """A pressure, Pa."""

    unit, symbol = "pascal", "Pa"


class Duration(_Quantity):
    """A time, s."""

    unit, symbol = "second", "s"


class Angle(_Quantity):
    """An angle, degree."""

    unit, symbol = "degree", "deg"


class Speed(_Quantity):
    """A speed, m/s."""

    unit, symbol = "m/s", "m/s"


class Expansion(_Quantity):
    """A linear thermal expansion, 1/K."""

    unit, symbol = "1/kelvin", "/K"


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
