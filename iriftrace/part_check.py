"""Checks of a part's surface: unit, orientation and closedness."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iriftrace.errors import IriftraceWarning
from iriftrace.topology import faces_to_flip, find_neighbours
from iriftrace.triangles import face_crosses

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Parts outside these sizes are rarely real; a metre read as a millimetre is common.
_PLAUSIBLE_SIZE_MM = (1.0, 10_000.0)
_SHORT_UNITS = {
    "meters": "m",
    "meter": "m",
    "millimeters": "mm",
    "millimeter": "mm",
    "centimeters": "cm",
    "centimeter": "cm",
    "inches": "inch",
    "inch": "inch",
    "microns": "um",
}


def check_unit(path: Path, vertices: FloatArray, declared: str | None, chosen: str) -> None:
    """Warn when the unit is not the one that the file declares, or makes an unlikely size."""
    short = _SHORT_UNITS.get(declared, declared) if declared else chosen
    if short != chosen:
        warnings.warn(
            f"{path} declares its unit as {short} but is read as {chosen}; "
            f"pass --length-unit {short} if the file is right.",
            IriftraceWarning,
            stacklevel=3,
        )
        return
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    smallest, largest = _PLAUSIBLE_SIZE_MM
    if size < smallest or size > largest:  # not for NaN, which is refused later
        warnings.warn(
            f"{path} is {size:.3g} mm across when read as {chosen}, which is unlikely for a "
            "measured part; check --length-unit.",
            IriftraceWarning,
            stacklevel=3,
        )


def oriented(
    path: Path, vertices: FloatArray, faces: IntArray, welded: IntArray
) -> tuple[IntArray, bool]:
    """Faces with one orientation, outward for a closed surface, and whether it is closed."""
    neighbours = find_neighbours(welded[faces])
    if not neighbours.opposed.all():
        areas = np.linalg.norm(face_crosses(vertices, faces), axis=1)
        flip = faces_to_flip(neighbours, areas)
        faces = np.where(flip[:, None], faces[:, ::-1], faces)
        warnings.warn(
            f"{path} has {np.count_nonzero(flip)} triangles that face the other way than their "
            "neighbours; they were turned over.",
            IriftraceWarning,
            stacklevel=3,
        )
    if neighbours.open_edges:
        warnings.warn(
            f"{path} is not closed ({neighbours.open_edges} open edges): coverage refers to the "
            "surface that is there, rays may pass through the holes, and what lies inside the part "
            "cannot be told; rays through a hole count what they find behind it.",
            IriftraceWarning,
            stacklevel=3,
        )
        return faces, False
    centred = vertices - vertices.mean(axis=0)
    volume = np.einsum("ij,ij->", centred[faces[:, 0]], face_crosses(centred, faces))
    if volume < 0:
        faces = faces[:, ::-1]
        warnings.warn(
            f"{path} has its inside out (negative volume); all triangles were turned over.",
            IriftraceWarning,
            stacklevel=3,
        )
    return faces, True
