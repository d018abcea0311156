"""Folders in a case of OpenFOAM: pieces that processors computed, and times."""

from __future__ import annotations

import math
import re
from pathlib import Path

_PROCESSOR = re.compile(r"processor(\d+)")


def processor_folders(case: Path) -> list[Path]:
    """Folders of the processors in the order of their numbers; none for a case in one piece."""
    found = {
        int(match[1]): entry
        for entry in case.iterdir()
        if (match := _PROCESSOR.fullmatch(entry.name)) and entry.is_dir()
    }
    return [found[number] for number in sorted(found)]


def time_folders(piece: Path) -> dict[float, Path]:
    """Folders of the times, by time in s and in its order, of a case or of one of its pieces."""
    found = {}
    for entry in piece.iterdir():
        try:
            time = float(entry.name)
        except ValueError:
            continue
        if math.isfinite(time) and entry.is_dir():
            found[time] = entry
    return dict(sorted(found.items()))
