"""Columns of a table of points by their names: which of them are x, y and z."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from attrs import frozen

from iriftrace.core.errors import InputError, warn
from iriftrace.core.units import LENGTH_UNITS, length_unit_of

MARKS = "#/%*!"
"""Signs at the beginning of a comment."""

_MOST_LISTED = 20

_BRACKETS = re.compile(r"\s*[\[(<{]\s*([^\])>}]*?)\s*[\])>}]")
_SUFFIX = re.compile(
    r"[\s_/,.-]+(?:in\s+)?"
    r"(um|µm|μm|mm|cm|m|inch(?:es)?|(?:milli|centi|micro)?met(?:re|er)|(?:milli)?met(?:re|er)s)$"
)
_UNREAD_UNITS = frozenset("nm dm km ft feet foot ' mil mils thou px pixel pixels".split())

_AXES = {"x": 0, "y": 1, "z": 2, "0": 0, "1": 1, "2": 2}
_FORMS = tuple(
    map(
        re.compile,
        (
            r"(?P<axis>[xyz])(?:[\s_:.-]+(?P<what>.+))?",
            r"(?P<what>.+?)[\s_:.-]+(?P<axis>[xyz0-2])",
            r"(?P<axis>[xyz])(?P<what>[^\W\d_]+)",
            r"(?P<what>[^\W\d_]+)(?P<axis>[xyz])",
        ),
    )
)
"""Names with an axis: "x", "X-Koordinate", "x_true"; "Points:0", "Actual X"; "xcoord"; "nx"."""

_MEANS_POINT = frozenset(
    "point points pt pts coord coords coordinate coordinates koord koordinate koordinaten "
    "cartesian position pos location vertex vertices punkt axis achse value wert "
    "coordonnée coordonnee coordonnées coordenada coordenadas coordinata posición posicion posição "
    "posicao posizione координата координаты 座標 坐标 좌표".split()
)
"""Words that say no more of a coordinate than that it is one."""

_MEASURED = frozenset("meas measured measurement actual act ist gemessen mesuré".split())
"""Words that say of a coordinate that others next to it are not the measured ones."""

_NOMINAL = re.compile(r"\b(?:nominals?|soll(?:werte?)?)\b", re.IGNORECASE)

_SCALED = re.compile(
    r"\b(?:scal(?:e|ing)|offset|(?:global[ _])?shift|factor|multipl\w+)\b.*\d", re.I
)
"""Remarks of what the numbers of a table may have to be multiplied by or added to."""

_NOT_CARTESIAN = frozenset(
    "range radius rho distance theta phi azimuth elevation polar angle lat latitude lon "
    "longitude northing easting north east up down nord est ost hochwert rechtswert hoch rechts "
    "row col column line sample disparity length width height depth".split()
)
"""Names of columns that are none of x, y and z, although three of them make a table."""

_CORRECTED = re.compile(r"(?:^|[^a-z_]|scalar_)correction[ _:.]?[xyz0-2](?![a-z])")


@frozen
class Axis:
    """A column that is a coordinate of something.

    `what` is "" for the points themselves, and such as "true" or "n" else; `number` is 0, 1 or 2;
    `unit` is "" where the name has none, and may be one that is not read, such as "ft".
    """

    what: str
    number: int
    unit: str


def axis_of(name: str) -> Axis | None:
    """The coordinate that a column's name says it is; None for another quantity."""
    text, unit = name.strip(f"{MARKS} \t\"'").casefold(), ""
    in_brackets = _BRACKETS.search(text)
    if in_brackets:
        word, text = in_brackets[1], _BRACKETS.sub("", text)
        scaled = re.search(r"\d", word) and set(re.split(r"[\W\d]+", word)) & LENGTH_UNITS.keys()
        unit = word if scaled or word in _UNREAD_UNITS else LENGTH_UNITS.get(word, "")
    elif suffix := _SUFFIX.search(text):
        unit, text = LENGTH_UNITS[suffix[1]], text[: suffix.start()]
    for form in _FORMS:
        if match := form.fullmatch(text.strip(" _:=")):
            words = re.split(r"[\s_:.-]+", match["what"] or "")
            what = " ".join(word for word in words if word not in _MEANS_POINT)
            return Axis(what, _AXES[match["axis"]], unit)
    return None


def coordinate_columns(names: Sequence[str]) -> list[int] | None:
    """Numbers of the columns x, y and z of the points; None where they are not one each."""
    axes = [(number, axis_of(name)) for number, name in enumerate(names)]
    points = [(axis.number, number) for number, axis in axes if axis and not axis.what]
    if _other_measured(names):
        return None
    if sorted(axis for axis, _ in points) != [0, 1, 2]:
        return None
    return [number for _, number in sorted(points)]


def _other_measured(names: Iterable[str]) -> bool:
    """Whether a name says that it, and not x, y or z, is a measured coordinate."""
    return any(axis is not None and axis.what in _MEASURED for axis in map(axis_of, names))


def refuse_other_measured(file: Path, names: Sequence[str]) -> None:
    """Refuse a cloud with measured coordinates next to x, y and z."""
    if _other_measured(names):
        raise _undecided(file, names, "")


def _undecided(file: Path, names: Sequence[str], numbers: str) -> InputError:
    return InputError(
        f"{file} has the columns {listed(names)}{numbers}, which do not say which three are the "
        "measured x, y and z; choose them by name, or by number from 1 (--columns A,B,C)."
    )


def chosen_columns(
    names: Sequence[str], chosen: Sequence[str], count: int, file: Path
) -> list[int]:
    """Numbers of three columns that were chosen by name, or by number from 1.

    `count` is the number of columns, which have no `names` where that is empty.
    """
    if len(chosen) != 3 or len(set(chosen)) != 3:
        raise InputError(
            f"The columns {', '.join(chosen)} are not three; give those of x, y and z (--columns "
            "A,B,C)."
        )
    bare = [name.strip(f"{MARKS} \t\"'") for name in names]
    found = []
    for word in (name.strip() for name in chosen):
        same = [i for i, name in enumerate(bare) if name == word]
        same = same or [i for i, name in enumerate(bare) if name.casefold() == word.casefold()]
        if not same and word.isdecimal() and 1 <= int(word) <= count:
            same = [int(word) - 1]
        if len(same) != 1:
            there = f"the columns {listed(names)}" if names else f"{count} columns without names"
            raise InputError(
                f"{file} has {'no' if not same else 'more than one'} column {word!r} (--columns); "
                f"it has {there}: choose by name, or by number from 1."
            )
        found += same
    return found


def columns_of_points(
    names: Sequence[str], count: int, chosen: Sequence[str] | None, file: Path
) -> list[int]:
    """Numbers of the columns that are x, y and z, chosen or by their names.

    The first three of a table without names. Raises InputError if the names do not say which three
    of the `count` columns they are.
    """
    if chosen is not None:
        return chosen_columns(names, chosen, count, file)
    if not names:
        return [0, 1, 2]
    found = coordinate_columns(names) if len(names) == count else None
    if found is None:
        numbers = "" if len(names) == count else f" over {count} columns of numbers"
        raise _undecided(file, names, numbers)
    return found


def header_of(lines: Iterable[str], count: int) -> list[str]:
    """Names of a table's columns in the lines before its numbers; empty where none names them.

    The last line that names x, y and z; else the last one that names as many columns as there are
    (`count`), or x, y and z among others. A sentence of as many words is not a header.
    """
    tables = [words_of(line, count) for line in lines][::-1]
    for words in tables:
        if len(words) == count and coordinate_columns(words):
            return words
    return next((words for words in tables if _may_be_names(words, count)), [])


def _may_be_names(words: Sequence[str], count: int) -> bool:
    """Whether words are names of columns, none or not all of which are known."""
    axes = [axis for axis in map(axis_of, words) if axis]
    if {axis.number for axis in axes if not axis.what} == {0, 1, 2}:
        return True
    if len(words) == count == 3 and {word[:1].casefold() for word in words} == set("xyz"):
        return True
    if len(words) != count or any(re.fullmatch(r"[\d.:,/-]+", word) for word in words):
        return False
    # Three columns are x, y and z, but for names that say otherwise.
    units = [word for word in words if word.strip(" []()<>").casefold() in LENGTH_UNITS]
    bare = [_BRACKETS.sub("", word).casefold() for word in words]
    others = [word for word in bare if len(word) == 1 or word in _NOT_CARTESIAN]
    # A single word such as "by" or "up" only ends or looks like one.
    several = any(not axis.what for axis in axes) or len({axis.number for axis in axes}) > 1
    return several or (not units and (len(others) > 1 or count > 3))


def words_of(line: str, count: int) -> list[str]:
    """Words of a line, by the separator that makes as many of them as there are columns."""
    text = line.strip().lstrip(f"{MARKS} ")
    # "Columns: x y z" names three.
    options = [*_splits(text), *_splits(text.partition(": ")[2])]
    for words in options:
        while len(words) > count and not words[-1]:
            words.pop()
    return next((words for words in options if len(words) == count), max(options, key=len))


def _splits(text: str) -> Iterator[list[str]]:
    for mark in (mark for mark in ";\t," if mark in text):
        yield [word.strip() for word in next(csv.reader([text], delimiter=mark))]
    yield [word.strip("\"'") for word in re.split(r"\s{2,}|\t", text)]
    # "X [mm]" is one name.
    joined = re.sub(r"\s+(?=[\[(])", "", text)
    yield [word.strip("\"'") for word in re.findall(r"\"[^\"]*\"|'[^']*'|[^\s,;]+", joined)]


def unit_of(
    names: Sequence[str], lines: Sequence[str], chosen: Sequence[int], count: int, file: Path
) -> str:
    """Length unit that names, a row of units, a line of one or a remark state; "" for none.

    An InputError where the names state several; a warning of a remark without one that is read.
    """
    axes = [axis_of(names[i]) if i < len(names) else None for i in chosen]
    units = {axis.unit for axis in axes if axis and axis.unit}
    if len(units) > 1:
        raise InputError(
            f"The columns {', '.join(names[i] for i in chosen)} are in different units "
            f"({', '.join(sorted(units))}); write all three in one."
        )
    if units - LENGTH_UNITS.keys():
        raise InputError(
            f"The columns {', '.join(names[i] for i in chosen)} are in {units.pop()}, which is not "
            "read; export them in mm."
        )
    if units:
        return units.pop()
    for line in lines:
        words = [word.strip(" []()<>").casefold() for word in words_of(line, count)]
        if len(words) == count and all(words[i] in LENGTH_UNITS for i in chosen):
            return LENGTH_UNITS[words[chosen[0]]]
        if len(words) == 1 and words[0] in LENGTH_UNITS:
            return LENGTH_UNITS[words[0]]
    return length_unit_of(lines, file.name)


def refuse_corrected(file: Path, names: Iterable[str]) -> None:
    """Refuse a cloud of which a column's name, or a line of names, is of a correction of `correct`.

    CloudCompare writes ``scalar_correction_x``.
    """
    if any(_CORRECTED.search(name.casefold()) for name in names):
        raise InputError(
            f"{file} is corrected already, as its column correction_x says, and the refraction "
            "error would be removed twice; give the cloud as it was measured."
        )


def warn_of_remarks(file: Path, above: Sequence[str], are_chosen: bool) -> None:
    """Warn of lines above a table that say of columns that they are nominal or scaled.

    The former if none `are_chosen`.
    """
    if not are_chosen and (said := next(filter(_NOMINAL.search, above), "")):
        warn(
            f"{file.name} has the line {said!r} above its columns; if its x, y and z are the "
            "nominal ones and not the measured ones, choose these (--columns A,B,C)."
        )
    if said := next(filter(_SCALED.search, above), ""):
        warn(
            f"{file.name} has the line {said!r}, which is not applied; if its points are not those "
            "in the columns, export them so."
        )


def listed(names: Sequence[str]) -> str:
    """The first names, between commas."""
    rest = [f"and {len(names) - _MOST_LISTED} more"] if len(names) > _MOST_LISTED else []
    return ", ".join([*(name or '""' for name in names[:_MOST_LISTED]), *rest])
