"""Entries and pixels of an EXR file."""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from iriftrace.core.arrays import AnyArray
from iriftrace.core.errors import InputError
from iriftrace.core.files import is_number
from iriftrace.core.plain import JsonObject

RGB = {
    "displacement": ("displacement.X", "displacement.Y", "displacement.Z"),
    "shift": ("shift.px.X", "shift.px.Y"),
    "refracted": ("refracted.X", "refracted.Y", "refracted.Z"),
}
"""Channels that R, G and B may repeat, for programs that show no others; the third of two is 0."""

PREFIX = "iriftrace."

RGB_ENTRY = "rgb"
"""Key of the header that states which channels R, G and B repeat."""

# More threads than this gain nothing for RLE: copying the pixels takes longer than packing them.
THREADS = min(4, os.cpu_count() or 1)

FloatImage = NDArray[np.float32]


def colour_channels(channels: dict[str, FloatImage], rgb: str) -> dict[str, FloatImage]:
    """Channels R, G and B that repeat others."""
    if rgb not in RGB:
        raise InputError(f"R, G and B can repeat {', '.join(RGB)}, but not {rgb!r}; give one.")
    planes = [channels[name].copy() for name in RGB[rgb]]
    nothing = [np.zeros_like(planes[0])] * (3 - len(planes))
    return dict(zip("RGB", [*planes, *nothing], strict=True))


def exr_content(name: str, remedy: str) -> tuple[JsonObject, dict[str, AnyArray]]:
    """Header and channels of an OpenEXR file; raises InputError with a remedy if it is damaged."""
    if not OpenEXR.isOpenExrFile(name):
        raise InputError(f"{name} is not an OpenEXR file; {remedy}.")
    try:
        with OpenEXR.File(name, separate_channels=True, num_threads=THREADS) as file:
            # Closing the file empties its dictionaries, so both are copied.
            channels = {key: channel.pixels for key, channel in file.channels().items()}
            return dict(file.header()), channels
    except Exception as error:  # OpenEXR and its layer of Python let any through
        raise InputError(f"{name} is damaged or incomplete ({error}); {remedy}.") from error


def names_part(named: object) -> bool:
    """True for a header entry with a part's file, checksum, unit and place."""
    return (
        isinstance(named, dict)
        and all(isinstance(named.get(key), str) for key in ("path", "sha256", "length_unit"))
        and isinstance(rows := named.get("to_world"), list)
        and len(rows) == 4
        and all(isinstance(row, list) and len(row) == 4 for row in rows)
        and all(is_number(value) for row in rows for value in row)
    )


def encoded(key: str, value: object) -> str:
    """An entry of the header as text; InputError if it is not plain JSON."""
    # What JSON cannot read is returned unchanged.
    if isinstance(value, str) and decoded(value) is value:
        return value
    try:
        return json.dumps(value, allow_nan=False, ensure_ascii=False)
    except (TypeError, ValueError) as error:
        raise InputError(f"header entry {key!r} is not plain JSON: {error}.") from error


def decoded(text: Any) -> Any:
    """The entry that a text of the header represents."""
    try:
        return json.loads(text)
    except (TypeError, ValueError):
        return text
