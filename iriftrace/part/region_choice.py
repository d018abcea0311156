"""Regions of a part as named by users, and as shown in messages: with their position."""

from __future__ import annotations

import re
from collections.abc import Mapping
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

import numpy as np

from iriftrace.core.errors import InputError

if TYPE_CHECKING:
    from iriftrace.part.part import Part

_PLANE = re.compile(r"(?:plane|head) (?:[+-](?P<axis>[xyz])(?: \d+)?|\d+)")


def placed_regions(part: Part) -> tuple[str, ...]:
    """Names of a part's regions; planes across an axis with their place, ``plane -x 1 (x 80 mm)``.

    Others have the direction of their normal, ``plane 1 (azimuth 90, elevation 30)``, deg. Names of
    holes contain their positions already.
    """
    return tuple(name + _place(part, number, name) for number, name in enumerate(part.region_names))


def _place(part: Part, number: int, name: str) -> str:
    match = _PLANE.fullmatch(name)
    chosen = part.region_of_face == number
    areas = part.face_areas[chosen]
    if match is None or not areas.sum() > 0.0:
        return ""
    if match["axis"] is None:
        x, y, z = np.average(part.face_normals[chosen], axis=0, weights=areas)
        azimuth = round(float(np.degrees(np.arctan2(y, x)))) % 360
        elevation = round(float(np.degrees(np.arctan2(z, np.hypot(x, y)))))
        return f" (azimuth {azimuth}, elevation {elevation})"
    axis = "xyz".index(match["axis"])
    middle = np.average(part.face_centres[chosen, axis], weights=areas)
    return f" ({match['axis']} {round(float(middle), 3) + 0.0:.4g} mm)"


def regions_like(part: Part, pattern: str) -> tuple[str, ...]:
    """Names of the regions that match a name, with or without position, or a pattern.

    Patterns have ``*`` and ``?``. Raises InputError with the part's regions if none matches.
    """
    if pattern in part.region_names:
        return (pattern,)
    found = tuple(
        name
        for name, placed in zip(part.region_names, placed_regions(part), strict=True)
        if placed == pattern or fnmatchcase(name, pattern)
    )
    if not found:
        raise InputError(
            f'{part.path} has no region "{pattern}"; its regions are '
            f"{', '.join(placed_regions(part))}. An asterisk stands for several, such as "
            f'"{part.region_names[0].split()[0]}*".',
            code="region.unknown_name",
        )
    return found


def values_by_region(part: Part, values: Mapping[str, float]) -> dict[str, float]:
    """Values of each region that matches names or patterns; a full name overrides patterns.

    Raises InputError if a pattern matches no region, or two give a region different values.
    """
    found = {name: value for name, value in values.items() if name in part.region_names}
    patterns: dict[str, str] = {}
    for pattern in (name for name in values if name not in found):
        for name in regions_like(part, pattern):
            if name in values:
                continue
            other = patterns.setdefault(name, pattern)
            if values[other] != values[pattern]:
                raise InputError(
                    f'"{other}" and "{pattern}" give the region "{name}" different values; give '
                    "it a value by its full name too.",
                    code="region.two_values",
                )
            found[name] = values[pattern]
    return found
