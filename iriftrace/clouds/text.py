"""Clouds of points as tables of text, as sensors and inspection programs write them."""

from __future__ import annotations

import csv
import re
import unicodedata
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from iriftrace.clouds.columns import (
    MARKS,
    columns_of_points,
    header_of,
    refuse_corrected,
    unit_of,
    warn_of_remarks,
    words_of,
)
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.files import text_in
from iriftrace.core.number_table import (
    closed_by,
    is_numbers,
    numbers,
    separator_of,
    with_exponents,
    without_statistics,
)

_FORMATS = {
    r"ply\s": "a .ply",
    r"solid\b": "an .stl",
    r"#\s*\.PCD": "a .pcd",
    r"(?:ST)?C?N?4?OFF\b": "an .off",
    r"#\s*vtk DataFile": "a .vtk",
    r"(?:ncols|DSAA)\s": "a map of heights",
}
"""Formats of other files by the beginning of their text."""

_WORD = "nan"
_MOST_UNNAMED = 16
"""Columns of a table of points without names; those of a transposed one are as many as points."""

_ALIKE = 0.1
"""Differences of heights side by side over the range of all, below which a map is smooth."""

_QUOTES = str.maketrans("", "", "\"'[](){}")
_QUOTED_COMMA = re.compile(r"\"([-+\d]*),(\d+)\"")
_DECIMAL_COMMA = re.compile(r"(?<=\d),(?=\d)")
_REMARK = re.compile(r"(?<=[\d.])\s+(?:#|//|%).*")
_BROKEN_CELL = re.compile(r"\"(?<![^,;\t\n]\")[^\",;\t\n]*(?:\n[^\",;\t\n]*)+\"")
_BELOW_ZERO = re.compile(r"\(\s*(\d[\d.,]*)\s*\)")  # of accountants
_DASHES = re.compile(r"\s*-+(?:\s*[,;\t]\s*-+)+\s*")
_DATE = re.compile(r"\d[:/]\d|\d-\d|\d\.\d+\.\d")
"""Times of a day and dates, which have no letters."""


def read_table(
    file: Path, chosen: Sequence[str] | None
) -> tuple[FloatArray, str, dict[str, FloatArray]]:
    """Coordinates (m, 3) of a text file's rows, the unit it states or "", and further columns.

    `chosen` are the names or numbers of the columns x, y and z, as for `read_cloud`. Empty cells
    and words are NaN; columns of words are left out with a warning. A count of the points in the
    first row is left out; one that is wrong is warned of.
    """
    # Signs as wide as those of Chinese and Japanese text are the same ones.
    text = unicodedata.normalize("NFKC", text_in(file))
    text = _BROKEN_CELL.sub(lambda cell: " ".join(cell[0].split()), text)
    for beginning, kind in _FORMATS.items():
        if re.match(beginning, text.lstrip(), re.IGNORECASE):
            raise InputError(
                f"{file} begins like {kind} and not like a table of points; give it its own "
                "ending, or export a point with x, y and z in each row."
            )
    lines = without_statistics(text.splitlines(), file)
    lines = [_BELOW_ZERO.sub(r"-\1", _REMARK.sub("", line)) for line in lines]
    lines = [re.sub("-+", _WORD, line) if _DASHES.fullmatch(line) else line for line in lines]
    rows = _rows(lines)
    # A header is before the first row; words after it are in cells.
    worded = not rows or len(rows) < _filled(lines, rows[0]) or bool(_DATE.search(rows[-1]))
    if worded:
        lines = _without_words(lines)
        rows = _rows(lines)
    if not rows:
        return np.empty((0, 3)), "", {}
    before = [line for line in lines[: lines.index(rows[0])] if line.strip()]
    refuse_corrected(file, before)
    between = _between(lines, rows)
    if between:
        warn(
            f"{file.name} has lines between its points that are none, such as {between[0]!r}, and "
            "are left out; if they part several scans, correct each by itself, as the sensor "
            "stood elsewhere."
        )
    rows = list(_without_count(rows, file))
    if not rows:
        return np.empty((0, 3)), "", {}
    cells, separator, last_is_empty = _cells(rows)
    table = numbers(cells, separator, file, "points")
    count = table.shape[1]
    if count < 3:
        raise InputError(f"{file} has {count} columns; a point has three coordinates.")
    names = header_of(before, count + 1)[:count] if last_is_empty else []
    names = names if len(names) == count else header_of(before, count)
    if not names:
        table = _without_numbered_columns(table, file)
    if names or chosen is not None:
        places = columns_of_points(names, count, chosen, file)
    else:
        if separator == "," and count > 5 and _are_whole(table):
            raise InputError(
                f"{file} has {count} columns of whole numbers between commas, as if these were "
                "decimal signs too; export it with decimal points, or with semicolons."
            )
        places = _unnamed_columns(table, file)
    above = [line.strip() for line in before if words_of(line, count) != names]
    unit = unit_of(names, above, places, count, file)
    warn_of_remarks(file, above, chosen is not None)
    bare = [name.strip(f"{MARKS} \t\"'") for name in names] if len(names) == count else [""] * count
    further = {bare[i] or f"column_{i + 1}": table[:, i] for i in range(count) if i not in places}
    if worded:
        further = _numbers_alone(further, file)
    return table[:, places], unit, further


def _without_numbered_columns(table: FloatArray, file: Path) -> FloatArray:
    """Rows after a first one that numbers the columns, which pandas writes without names."""
    numbered = table[0][~np.isnan(table[0])]
    if len(numbered) < 3 or numbered[0] not in (0.0, 1.0) or (np.diff(numbered) != 1.0).any():
        return table
    warn(f"The first row of {file.name} numbers the columns from {numbered[0]:g}, and is left out.")
    return table[1:]


def _unnamed_columns(table: FloatArray, file: Path) -> list[int]:
    """Numbers of the columns x, y and z of a table without names: the first that are not words.

    Raises InputError where they may be other columns, or rows.
    """
    count = table.shape[1]
    if len(table) <= 4 and count > _MOST_UNNAMED:
        raise InputError(
            f"{file} has {len(table)} rows of {count} numbers, as if each column were a point; "
            "transpose it, so that each row is one."
        )
    steps = np.diff(table[~np.isnan(table[:, 0]), 0])
    whole = [column for column in range(1, count + 1) if _are_whole(table[:, column - 1])]
    rest = [str(column) for column in range(1, count + 1) if column not in whole]
    if count > _MOST_UNNAMED or (count > 3 and _are_alike(table)):
        doubt, choice = "as a map of heights has them", "1,2,3"
    elif count > 3 and len(steps) > 1 and ((steps > 0).all() or (steps < 0).all()):
        doubt = (
            "of which the first counts the rows or is their time: its numbers rise or fall from "
        )
        doubt, choice = f"{doubt}row to row", "2,3,4, or 1,2,3 if it is x"
    elif count > 5 and _are_twice(table):
        doubt = "of which 1 to 3 are nearly 4 to 6, as nominal and measured points are"
        choice = "4,5,6"
    elif count > 3 and 0 < sum(column <= 3 for column in whole) < 3:
        doubt = f"and whole numbers, as of pixels, in column {', '.join(map(str, whole))}"
        choice = ",".join(rest[:3]) if len(rest) > 2 else "A,B,C"
    else:
        values = np.flatnonzero(~np.isnan(table).all(axis=0)).tolist()
        return values[:3] if len(values) >= 3 else [0, 1, 2]
    raise InputError(
        f"{file} has {count} columns without names, {doubt}; export a point with x, y and z in "
        f"each row, or choose these columns by number from 1 (--columns {choice})."
    )


def _are_whole(numbers: FloatArray) -> bool:
    return bool((numbers == np.round(numbers)).all())


def _are_alike(table: FloatArray) -> bool:
    """Whether the first three columns differ little from each other, as heights side by side."""
    known = table[np.isfinite(table[:, :3]).all(axis=1), :3]
    if len(known) < 3:
        return False
    steps = np.median(np.abs(np.diff(known, axis=1)), axis=0)
    return bool(steps.max() < _ALIKE * np.ptp(np.quantile(known, (0.05, 0.95))))


def _are_twice(table: FloatArray) -> bool:
    """Whether three columns and the next three are the same places within a twentieth."""
    known = table[np.isfinite(table[:, :6]).all(axis=1), :6]
    if len(known) < 3:
        return False
    off = np.linalg.norm(known[:, 3:] - known[:, :3], axis=1)
    return bool(np.median(off) < 0.05 * np.linalg.norm(np.ptp(known[:, :3], axis=0)))


def _rows(lines: Sequence[str]) -> list[str]:
    """Lines of numbers, without comments."""
    found = [line for line in lines if line.strip() and is_numbers(line.lstrip(f"{MARKS} "))]
    return [line for line in found if not line.lstrip().startswith(tuple(MARKS))]


def _between(lines: Sequence[str], rows: Sequence[str]) -> list[str]:
    """Lines after the first row and before the last that are neither rows nor empty."""
    last = len(lines) - 1 - lines[::-1].index(rows[-1])
    inner, points = lines[lines.index(rows[0]) : last], set(rows)
    if len(inner) == len(rows) - 1:
        return []
    return [line.strip() for line in inner if line.strip(f"{MARKS} ,;\t") and line not in points]


def _filled(lines: Sequence[str], first: str) -> int:
    """Number of lines from a first one on that are neither empty nor comments."""
    kept = (line.lstrip() for line in lines[lines.index(first) :])
    return sum(bool(line) and not line.startswith(tuple(MARKS)) for line in kept)


def _without_words(lines: Sequence[str]) -> list[str]:
    """Lines of a table with nan in place of words, such as names or dates, next to three numbers.

    Of the separators that with the most such lines.
    """
    options: list[tuple[int, list[str]]] = [(0, list(lines))]
    for mark in ";\t,":
        rows = [next(csv.reader([line], delimiter=mark), []) for line in lines]
        counts = Counter(len(row) for row in rows if len(row) > 3)
        usual = max(counts, key=lambda count: counts[count], default=0)
        text, changed = [], 0
        for line, row in zip(lines, rows, strict=True):
            cells = [_number(cell, mark) for cell in row]
            is_row = len(row) == usual and sum(cell != _WORD for cell in cells) >= 3
            changed += is_row
            text.append(mark.join(cells) if is_row else line)
        options.append((changed, text))
    return max(options, key=lambda option: option[0])[1]


def _number(cell: str, mark: str) -> str:
    """The cell of a table if it is a number or empty, 1 or 0 for true or false, else "nan"."""
    text = with_exponents(cell.strip().strip("\"'"))
    text = {"true": "1", "false": "0"}.get(text.casefold(), text)
    try:
        float(text if mark == "," else text.replace(",", "."))
    except ValueError:
        return _WORD
    return text


def _numbers_alone(columns: dict[str, FloatArray], file: Path) -> dict[str, FloatArray]:
    """Columns that hold a number; the others are named in a warning."""
    kept = {name: values for name, values in columns.items() if not np.isnan(values).all()}
    words = [name for name in columns if name not in kept]
    if words:
        warn(f"{file.name} has columns of words or dates, which are left out: {', '.join(words)}.")
    return kept


def _without_count(rows: Sequence[str], file: Path) -> Sequence[str]:
    """Rows after a first one that is nothing but the number of points."""
    first = rows[0].strip()
    if not first.isdecimal() or (len(rows) > 1 and len(re.split(r"[\s,;]+", rows[1].strip())) == 1):
        return rows
    count = int(first)
    if 0 < count < len(rows) - 1 and rows[count + 1].strip().isdecimal():
        raise InputError(
            f"{file} holds several scans, one after the other, each with its number of points; "
            "correct each by itself: write a file for each."
        )
    if count != len(rows) - 1:
        warn(
            f"{file.name} states {count:,} points and holds {len(rows) - 1:,}; it may be cut "
            "short: export the cloud again."
        )
    return rows[1:]


def _cells(rows: Sequence[str]) -> tuple[Sequence[str], str | None, bool]:
    """Rows without quotes and brackets, their separator, and if it ends all of them."""
    if not any("." in row for row in rows):
        rows = [_QUOTED_COMMA.sub(r"\1.\2", row) for row in rows]
        if all(", " in row and _DECIMAL_COMMA.search(row) for row in rows):
            rows = [_DECIMAL_COMMA.sub(".", row) for row in rows]
    bare = [row.translate(_QUOTES) for row in rows]
    separator = separator_of(bare[0])
    if separator is None and any(re.search(r"^\t|\t\t|\t$", row) for row in bare):
        separator = "\t"
    if separator is None:
        return bare, None, False
    return bare, separator, closed_by(bare, separator)
