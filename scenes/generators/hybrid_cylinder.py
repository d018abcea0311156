"""Cylinder of two materials joined end to end."""

from __future__ import annotations

import numpy as np

from iriftrace.core.errors import InputError
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.part.regions import Regions
from iriftrace.part.standards import check_count, check_positive, turned

REGIONS = ("head -x", "lateral -x", "transition", "lateral +x", "head +x")
"""From the cold end to the hot one."""


def hybrid_cylinder(
    diameter_mm: float = 27.0,
    length_mm: float = 170.0,
    *,
    transition_mm: float = 10.0,
    interface_mm: float = 0.0,
    segments: int = 60,
    stations: int = 32,
) -> Part:
    """Cylinder along x of two materials, of which the one at x > interface is meant to be hotter.

    Parameters
    ----------
    diameter_mm
        Of the circle through the polygon's corners.
    length_mm
    transition_mm
        Length of the region around the interface in which the temperature changes.
    interface_mm
        Where the materials meet, as x.
    segments
        Sides of the polygon.
    stations
        Rows of triangles along the axis, besides those of the transition.

    Returns
    -------
    Part
        Regions `REGIONS`.

    Raises
    ------
    InputError
        A length is not positive, the transition is not on the cylinder, or there are too few
        segments.
    """
    check_positive(
        "hybrid cylinder", diameter=diameter_mm, length=length_mm, transition=transition_mm
    )
    check_count("hybrid cylinder", "stations", stations, 2, 1000)
    half = 0.5 * length_mm
    start, stop = interface_mm - 0.5 * transition_mm, interface_mm + 0.5 * transition_mm
    if not -half < start < stop < half:
        raise InputError(
            f"The hybrid cylinder's transition from x = {start:g} to {stop:g} mm is not within its "
            f"length from {-half:g} to {half:g} mm; move the interface or shorten the transition.",
            code="scenes.size",
        )
    cold = max(1, round(stations * (start + half) / (length_mm - transition_mm)))
    hot = max(1, stations - cold)
    # A row for every few millimetres, so that the transition's own faces can tell where it is hot.
    rows = max(2, round(transition_mm / 2.5))
    ends = np.concatenate(
        (
            np.linspace(-half, start, cold + 1)[:-1],
            np.linspace(start, stop, rows + 1),
            np.linspace(stop, half, hot + 1)[1:],
        )
    )
    vertices, faces, place = turned(diameter_mm, ends, segments)
    # Row number from the cold end; -1 and one more than the last are the heads.
    number = np.searchsorted((0, cold, cold + rows, cold + rows + hot), place, side="right")
    regions = Regions(number.astype(np.int64), REGIONS)
    return part_of_mesh(vertices, faces, name="hybrid cylinder", regions=regions)
