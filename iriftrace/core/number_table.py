"""Rows of numbers in a text file, with any separator and decimal mark."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.units import counted

MISSING = -9999.0
"""Number that programs write for a value that is missing."""

_DECIMAL_COMMA = re.compile(r"\d,\d")
_DECIMAL_POINT = re.compile(r"\d\.\d")
_FORTRAN = re.compile(r"(?<=[\d.])[dD](?=[-+]?\d)")
_QUOTED = re.compile(r"\"([^\",;]*)\"")
_LETTERS = re.compile(r"[A-DF-Za-df-z_]|(?![A-Za-z])[^\W\d_]")
_GAP = re.compile(
    r"(?<![^\s,;\"])(?:null|none|#?n/?a|-?nan\(\w*\)|-?1\.#(?:qnan|ind)\w*|#(?:div/0|num)!|-+)"
    r"(?![^\s,;\"])",
    re.IGNORECASE,
)
_MAYBE_GAP = re.compile(r"[nN#]|-(?![\d.])")
_EMPTY_CELL = re.compile(r"[,;\t] *(?:[,;\t]|$)|^ *[,;\t]")
_NUMBER = re.compile(r"[-+]?\d[\d.,]*(?:[eEdD][-+]?\d+)?|\bnan\b")
_LETTER_RUN = re.compile(r"[^\W\d_]+")
_LONG_WORD = re.compile(r"[^\W\d_]{3}")
_STATISTICS = frozenset(
    "mean avg average median max maximum min minimum std stdev stddev dev deviation sigma rms sum "
    "total count range var variance standard mittelwert mittel summe anzahl spannweite abw "
    "standardabweichung varianz moyenne somme media promedio".split()
)
"""Words of the rows that spreadsheets and inspection programs write below a table."""

_COMMENT = re.compile(r"\s*[#%/*!]")


def is_numbers(line: str) -> bool:
    """True for a line that can be numbers: no letters besides exponents, NaN and Inf."""
    bare = re.sub(r"\b(?:nan|inf(?:inity)?)\b", "", with_exponents(line), flags=re.I)
    return _LETTERS.search(bare) is None


def with_exponents(line: str) -> str:
    """A line with Fortran's exponents, 1.5D+02, in the usual form."""
    return _FORTRAN.sub("e", line)


def with_gaps(line: str) -> str:
    """A row of numbers with nan in place of null (CFD-Post), N/A, dashes and signs of C and Excel.

    Other lines are returned as they are.
    """
    filled = _GAP.sub("nan", line) if _MAYBE_GAP.search(line) else line
    is_row = filled != line and is_numbers(filled) and re.search(r"\d", line)
    return filled if is_row else line


def without_statistics(lines: Sequence[str], path: Path) -> list[str]:
    """Lines without those of statistics, such as "Mean;1.2;3.4", of which a warning tells."""
    found = [line for line in lines if _LONG_WORD.search(line) and _is_statistic(line)]
    if not found:
        return list(lines)
    warn(
        f"Left out of {path.name}: {counted(len(found), 'row')} of statistics, such as "
        f"{found[0].strip()!r}."
    )
    return [line for line in lines if line not in found]


def _is_statistic(line: str) -> bool:
    """True for numbers with words of statistics alone, outside of a comment."""
    text, count = _NUMBER.subn("", line.casefold())
    words = set(_LETTER_RUN.findall(text))
    return count > 0 and bool(words) and words <= _STATISTICS and not _COMMENT.match(line)


def separator_of(row: str) -> str | None:
    """Separator of the numbers of a row: ``";"``, ``","`` or None for blanks and tabs."""
    if ";" in row:
        return ";"
    if "," not in row:
        return None
    # A comma between digits is a decimal sign where blanks separate, unless points are there too.
    pieces = row.split()
    decimal = len(pieces) > 1 and "." not in row and not any(p.endswith(",") for p in pieces)
    return None if decimal else ","


def numbers(rows: Sequence[str], separator: str | None, path: Path, what: str) -> FloatArray:
    """Rows, without comments and empty lines, as an array (rows, columns).

    `separator` is that of `separator_of`, `what` names the rows in messages ("coordinates"). Empty
    cells are NaN, but for those at the end of all rows.
    Raises InputError if a row has other columns than the first, or an entry is not a number.
    """
    lines = [_QUOTED.sub(r"\1", with_exponents(row)) for row in rows]
    if separator != "," and any(_DECIMAL_COMMA.search(row) for row in lines):
        if any(_DECIMAL_POINT.search(row) for row in lines):
            raise InputError(
                f"The {what} in {path} have points and commas, of which either may be the decimal "
                "sign; export them with decimal points and no other sign in a number."
            )
        lines = [row.replace(",", ".") for row in lines]
    try:
        if separator is not None:
            lines = _filled(lines, separator)
        return np.loadtxt(lines, delimiter=separator, comments=None, ndmin=2)
    except ValueError as error:
        text = str(error).split(";")[0]
        raise InputError(
            f"The {what} in {path} cannot be read as numbers ({text}); the file may be cut short "
            "or hold complex values or signs between thousands, so export plain numbers again."
        ) from None


def closed_by(rows: Sequence[str], separator: str | None) -> bool:
    """Whether all rows end with a separator, after which there is no column."""
    return separator is not None and all(row.rstrip(" ").endswith(separator) for row in rows)


def _filled(rows: Sequence[str], separator: str) -> list[str]:
    """Rows without separators at the end of all, and with nan in empty cells."""
    if closed_by(rows, separator):
        rows = [row.rstrip(" ").removesuffix(separator) for row in rows]
    if not any(_EMPTY_CELL.search(row) for row in rows):
        return list(rows)
    empty = re.compile(rf"(?:^|(?<={separator})) *(?={separator}|$)")
    return [empty.sub("nan", row) for row in rows]
