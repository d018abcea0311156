"""Clouds of points as tables of text, as sensors and inspection programs write them."""

from __future__ import annotations

import codecs
import re
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.core.number_table import is_numbers, numbers, separator_of
from iriftrace.triangulation.columns import (
    MARKS,
    columns_of_points,
    header_of,
    refuse_corrected,
    unit_of,
)

_QUOTES = str.maketrans("", "", "\"'")


def read_table(
    file: Path, chosen: Sequence[str] | None
) -> tuple[FloatArray, str, dict[str, FloatArray]]:
    """Coordinates (m, 3) of a text file's rows, the unit it states or "", and further columns.

    `chosen` are the names or numbers of the columns x, y and z, as for `read_cloud`. Empty cells
    are NaN. A count of the points in the first row is left out; one that is wrong is warned of.
    """
    lines = _text(file).splitlines()
    rows = [line for line in lines if line.strip() and is_numbers(line.lstrip(f"{MARKS} "))]
    rows = [row for row in rows if not row.lstrip().startswith(tuple(MARKS))]
    if not rows:
        return np.empty((0, 3)), "", {}
    before = [line for line in lines[: lines.index(rows[0])] if line.strip()]
    refuse_corrected(file, before)
    rows = list(_without_count(rows, file))
    if not rows:
        return np.empty((0, 3)), "", {}
    cells, separator = _cells(rows)
    table = numbers(cells, separator, file, "points")
    count = table.shape[1]
    if count < 3:
        raise InputError(f"{file} has {count} columns; a point has three coordinates.")
    names = header_of(before, count)
    if not names and chosen is None and count > 3 and _counts_rows(table[:, 0]):
        raise InputError(
            f"The first of the {count} columns in {file} counts the rows, and none has a name; "
            "choose x, y and z by number from 1 (--columns 2,3,4)."
        )
    places = columns_of_points(names, count, chosen, file)
    bare = [name.strip(f"{MARKS} \t\"'") for name in names] if len(names) == count else [""] * count
    further = {bare[i] or f"column_{i + 1}": table[:, i] for i in range(count) if i not in places}
    return table[:, places], unit_of(names, before, places, count), further


def _without_count(rows: Sequence[str], file: Path) -> Sequence[str]:
    """Rows after a first one that is nothing but the number of points."""
    first = rows[0].strip()
    if not first.isdecimal() or (len(rows) > 1 and len(re.split(r"[\s,;]+", rows[1].strip())) == 1):
        return rows
    if int(first) != len(rows) - 1:
        warnings.warn(
            f"{file.name} states {int(first):,} points and holds {len(rows) - 1:,}; it may be cut "
            "short: export the cloud again.",
            IriftraceWarning,
            stacklevel=4,
        )
    return rows[1:]


def _cells(rows: Sequence[str]) -> tuple[Sequence[str], str | None]:
    """Rows without quotes, "nan" in their empty cells, and their separator."""
    bare = [row.translate(_QUOTES) for row in rows]
    separator = separator_of(bare[0])
    if separator is None and any(re.search(r"^\t|\t\t|\t$", row) for row in bare):
        separator = "\t"
    if separator is None:
        return bare, None
    if all(row.rstrip(" ").endswith(separator) for row in bare):
        bare = [row.rstrip(" ").removesuffix(separator) for row in bare]
    empty = re.compile(rf"(?:^|(?<={separator})) *(?={separator}|$)")
    return [empty.sub("nan", row) for row in bare], separator


def _text(file: Path) -> str:
    """A text file, of Unicode with a mark of its byte order or of whatever else."""
    content = file.read_bytes()
    wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    return content.decode("utf-16" if wide else "utf-8-sig", errors="replace")


def _counts_rows(column: FloatArray) -> bool:
    """Whether numbers are those of the rows, from 0 or 1."""
    return len(column) > 2 and column[0] in (0.0, 1.0) and bool((np.diff(column) == 1.0).all())
