"""Numbers with units, as written in files and on the command line."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from functools import cache
from typing import TYPE_CHECKING

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
    **dict.fromkeys(("in", "inch", "inches", '"', "″"), "inch"),
}
"""Length units by the names that files give them."""

_STATED_UNIT = re.compile(
    r"(?<![^\W_])(?:length[\s_]*)?(?:units?|einheit(?:en)?)(?:\s+of\s+length)?(?:\s+(?:is|are))?"
    r"(?:\s*[:=]\s*[\[(]?|\s+(?:in\s+)?|\s*[\[(])(?!in\s+[a-zµμ])([a-zµμ]++)(?!\s*[*/^]\s*\d)"
    r"|(?:\b(?:coord(?:inate)?s|positions|translations?|xyz|koordinaten)"
    r"|^\W*(?:comment\s+)?(?:all\s+)?(?:lengths?|distances|dimensions|values|data|points|vertices"
    r"|exported|längen?|maße))(?:\s+(?:are|is|given))*(?:\s+in\s+|\s*[:=,]\s*|\s*[\[(]\s*)(?!in\b)"
    r"([a-zµμ]+)(?![\w/^*·]|\s+\w+\^?-\d)",
    re.IGNORECASE,
)
_NAMED_UNIT = re.compile(
    r"(?<![^\W_])(?i:inch(?:es)?|zoll|feet|(?:centi|micro)?m[eè]t(?:er|re)s?|microns?)(?![^\W_])"
    r"|(?:\bin |[=:(\[]\s*|\d\s*)\"?(?:m|cm|um|µm|μm|ft|mils?|in(?=\s*[\])\"]))"
    r"(?![^\W_])"
)
_NAMED_MM = re.compile(r"(?i)(?<![a-z])mm(?![a-z])|millimet")
_WORD_FOR_UNIT = re.compile(r"\bunit|\bunid|einheit|eenheid|enhe[td]|единиц|単位|单位|單位|단위")
"""In the word for a unit in several languages."""

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
        raise InputError(f"{text!r} is not a finite number; give one in {unit}.")
    if bare and unit == "kelvin":
        number = str(text).strip()
        raise InputError(
            f"{text!r} is a temperature without a unit, {number} K or {number} degC; write the one "
            "that is meant."
        )
    return value


def stated_length_unit(remark: str) -> str:
    """Length unit that a remark states, as in ``# Unit: mm`` or ``Maßeinheit;mm``; "" for none."""
    found = [match[1] or match[2] for match in _STATED_UNIT.finditer(remark)]
    cells = (cell.strip(" #/%*!\"'[]()") for cell in re.split(r"[;,:\uff1a=\t]", remark))
    match [cell for cell in cells if cell]:
        case [name, unit] if _WORD_FOR_UNIT.search(name.casefold()):
            found.append(unit)
    return next(
        (LENGTH_UNITS[name] for name in map(str.casefold, found) if name in LENGTH_UNITS), ""
    )


def names_length_unit(remark: str) -> bool:
    """True for a remark with the name of a length unit other than mm, in whatever words."""
    return bool(_NAMED_UNIT.search(remark)) and not _NAMED_MM.search(remark)


def length_unit_of(remarks: Iterable[str], name: str) -> str:
    """Length unit that one of the remarks in a file of some name states; "" for none.

    Warned of is a remark about units without one that is read.
    """
    lines = list(remarks)
    stated = next(filter(None, map(stated_length_unit, lines)), "")
    doubtful = (line for line in lines if _WORD_FOR_UNIT.search(line.casefold()))
    if not stated and (said := next(doubtful, "")):
        warn(
            f"{name} says {said.strip()!r}, of which no unit of length is read; its lengths are "
            "taken in mm, or as stated elsewhere (--length-unit)."
        )
    return stated


def length_factor(unit: str) -> float:
    """Millimetres in one length unit (um, mm, cm, m, inch, in); InputError for another name."""
    name = unit.strip()
    try:
        return _MILLIMETRES[LENGTH_UNITS.get(name.casefold(), name)]
    except KeyError:
        raise InputError(
            f"{unit!r} is not a length unit known here; use one of {', '.join(_MILLIMETRES)}."
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
        raise InputError(f"{text!r} is not a number with a unit; write it like '20 {sign}'.")
    number, name = float(match["number"]), match["unit"]
    if unit in ("kelvin", "K", "1/kelvin"):
        # pint reads C as coulomb and F as farad, which nobody means here.
        name = re.sub(r"(?<![\w°])[CF]$", r"deg\g<0>", name)
    registry = _registry()
    try:
        quantity = registry.Quantity(number, f"1{name}" if name.startswith("/") else name)
        return float(quantity.to(unit).magnitude)
    except pint.UndefinedUnitError:
        raise InputError(f"{text!r} has an unknown unit; give the number in {unit}.") from None
    except (pint.DimensionalityError, pint.OffsetUnitCalculusError):
        raise InputError(
            f"{text!r} cannot be converted to {unit}; give the number in {unit} or in a unit of "
            "the same kind."
        ) from None


def counted(count: int, noun: str) -> str:
    """A number with its noun: "1 pose", "1,224 poses"."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"
