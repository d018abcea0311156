"""The part's surface for VTK: distances of points from it, and the file that the mesher reads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from iriftrace.nearest_face import NearestFace
from iriftrace.part import Part
from iriftrace.whole_file import whole_file

FloatArray = NDArray[np.float64]

_METRES = 1e-3


def distance_from(
    points: FloatArray, part: Part, chosen: NDArray[np.bool_] | None = None
) -> FloatArray:
    """Distance of points from the nearest of the part's triangles.

    Parameters
    ----------
    points
        (n, 3) array, mm, world.
    part
        mm, world.
    chosen
        (m,) mask of the triangles that count; all by default.

    Returns
    -------
    (n,) array
        mm.
    """
    faces = part.faces if chosen is None else part.faces[chosen]
    return NearestFace(part.vertices, faces).distance(points)


def write_surface(part: Part, path: Path) -> None:
    """Write the part as binary STL in metres."""
    faces: Any = part.faces
    with whole_file(path) as temporary:
        pv.PolyData.from_regular_faces(part.vertices * _METRES, faces).save(temporary)
