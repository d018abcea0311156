"""What a running solver says: its log, the heat from the wall, temperatures in the plume."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_TIME = re.compile(r"^Time = (\S+)", re.M)
_COURANT = re.compile(r"^Courant Number mean: \S+ max: (\S+)", re.M)
_FATAL = re.compile(r"FOAM FATAL (?:IO )?ERROR.*?\n(?P<text>.*?)(?:\n\s*\n|\Z)", re.S)
_FLOATING_POINT = re.compile(r"sigFpe|Floating point exception", re.I)
_CELLS = re.compile(r"^\s*cells:\s+(\d+)", re.M)
_TAIL = 20_000


@frozen
class Steps:
    """How far a solver has come.

    Attributes
    ----------
    times
        (n,) times of the steps in the text, s.
    courant
        (m,) largest Courant number of each step.
    """

    times: FloatArray
    courant: FloatArray

    @property
    def last(self) -> float | None:
        """Time of the last step, s."""
        return float(self.times[-1]) if len(self.times) else None


def read_steps(text: str) -> Steps:
    """Steps in a solver's log or in a piece of it."""
    return Steps(
        times=_numbers(_TIME.findall(text)),
        courant=_numbers(_COURANT.findall(text)),
    )


def tail(path: Path) -> str:
    """The last lines of a log that another process is writing; "" before it is there."""
    if not path.is_file():
        return ""
    with path.open("rb") as file:
        file.seek(0, 2)
        file.seek(max(0, file.tell() - _TAIL))
        return file.read().decode(errors="replace")


def failure(text: str) -> str:
    """Why a program of OpenFOAM stopped, in one line; "" where the log names no reason."""
    if found := _FATAL.search(text):
        return " ".join(found["text"].split())
    if _FLOATING_POINT.search(text):
        return "an invalid number came up (floating point exception)"
    return ""


def cell_count(text: str) -> int | None:
    """Number of cells in the log of ``checkMesh``."""
    found = _CELLS.search(text)
    return int(found[1]) if found else None


def read_heat(case: Path) -> FloatArray:
    """Heat that the wall gives to the air.

    Parameters
    ----------
    case
        Folder of the case.

    Returns
    -------
    (n, 2) array
        Time in s and heat flow in W, of the half or quarter that is computed.
    """
    return _series(case / "postProcessing/heat", "surfaceFieldValue", (0, -1))


def read_plume(case: Path) -> FloatArray:
    """Temperatures at points in the plume.

    Returns
    -------
    (n, 1 + points) array
        Time in s and temperatures in K.
    """
    return _series(case / "postProcessing/plume", "T", None)


def _series(folder: Path, name: str, columns: tuple[int, ...] | None) -> FloatArray:
    """Rows of a table that every start of the solver writes into a folder of its own."""
    rows: dict[float, list[float]] = {}
    for file in sorted(folder.glob(f"*/{name}*"), key=lambda f: float(f.parent.name)):
        for line in file.read_text(errors="replace").splitlines():
            values = _row(line)
            if values:
                # A run that went on has computed some of the last steps again.
                rows[values[0]] = values if columns is None else [values[i] for i in columns]
    width = min((len(row) for row in rows.values()), default=1)
    return np.array([rows[time][:width] for time in sorted(rows)]).reshape(len(rows), width)


def _row(line: str) -> list[float]:
    """Numbers of one line of a table; none of a comment or of a line that is being written."""
    if line.startswith("#"):
        return []
    values = []
    for word in line.split():
        try:
            values.append(float(word))
        except ValueError:
            if not word.isalnum():
                return []
    return values if len(values) > 1 else []


def _numbers(words: list[str]) -> FloatArray:
    values = []
    for word in words:
        try:
            values.append(float(word))
        except ValueError:
            values.append(np.nan)
    return np.array(values, dtype=np.float64)
