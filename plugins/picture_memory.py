"""Refuses pictures that cannot fit into memory, before anything of them is allocated."""

from __future__ import annotations

import os
from pathlib import Path

from iriftrace.errors import InputError

BYTES_PER_PIXEL = 170
"""What a picture needs at the least: channels, straight rays, their state and the metrics.

Measured where a fifth of the rays hit the part; more hits need more.
"""

MOST_VALUES = 2**32 - 1
"""Entries of one of Dr.Jit's arrays, such as all channels of a picture."""

_LIMIT_OF_CONTAINER = Path("/sys/fs/cgroup/memory.max")


def memory_bytes() -> float:
    """Memory of this machine or container; infinite where the system does not say."""
    try:
        installed = float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):
        installed = float("inf")
    try:
        # "max" where there is no limit.
        return min(installed, float(_LIMIT_OF_CONTAINER.read_text()))
    except (OSError, ValueError):
        return installed


def check_picture_size(width: int, height: int, channels: int) -> None:
    """Refuse a picture that is larger than memory, or than an array can be.

    Parameters
    ----------
    width, height : int
        Pixels that are traced.
    channels : int

    Raises
    ------
    InputError
    """
    pixels = width * height
    advice = "lower the resolution (-D scale=...), or crop the film"
    needed, there = BYTES_PER_PIXEL * pixels, memory_bytes()
    if needed > there:
        raise InputError(
            f"A picture of {width} x {height} pixels needs at least {needed:,} bytes of memory, "
            f"but this machine has {int(there):,}; {advice}."
        )
    if channels * pixels > MOST_VALUES:
        raise InputError(
            f"A picture of {width} x {height} pixels has {channels * pixels:,} values in "
            f"{channels} channels ({4 * channels * pixels:,} bytes), but one array holds at most "
            f"{MOST_VALUES:,}; {advice}."
        )
