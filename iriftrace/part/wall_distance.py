"""Distance of points to a part, and the direction in which it grows."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.geometry.query import NearestFace, inside_closed
from iriftrace.part.part import Part

_ON_WALL_MM = 1e-9
"""Closer than this, the direction to the nearest point is rounding; the face's normal holds."""


@frozen(eq=False, slots=False)
class WallDistance:
    """A closed part that is asked for distances.

    Parameters
    ----------
    part : Part

    Raises
    ------
    InputError
        The part is not closed, so that it has no outside.
    """

    part: Part

    def __attrs_post_init__(self) -> None:
        """Refuse a part without an inside."""
        if not self.part.closed:
            raise InputError(
                f"{self.part.path} is not closed, so it is not clear where the air is; mend the "
                "mesh (fill its holes) first."
            )

    @cached_property
    def _surface(self) -> NearestFace:
        return NearestFace(self.part.vertices, self.part.faces)

    def nearest(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distance to the part and its gradient.

        Parameters
        ----------
        points : (n, 3) array, mm, world
            Outside the part or on it.

        Returns
        -------
        distance : (n,) array, mm
        gradient : (n, 3) array
            Unit vectors from the nearest point of the part; on the part its outward normal. Where
            several points of the part are equally near, that of one of them.
        """
        foot, face = self._surface.find(points)
        offset = points - foot
        distance = np.linalg.norm(offset, axis=1)
        away = distance > _ON_WALL_MM
        gradient = self.part.face_normals[face]
        gradient[away] = offset[away] / distance[away, None]
        return distance, gradient

    def foot(self, points: FloatArray) -> FloatArray:
        """Nearest points of the part, (n, 3) array, mm."""
        return self._surface.find(points)[0]

    def faces(self, points: FloatArray) -> NDArray[np.int64]:
        """Faces (n,) of the part that are nearest to the points."""
        return self._surface.find(points)[1]

    def normals(self, points: FloatArray) -> FloatArray:
        """Outward normals (n, 3) of the part where it is nearest to the points."""
        return self.part.face_normals[self.faces(points)]

    def inside(self, points: FloatArray) -> NDArray[np.bool_]:
        """Whether points (n, 3), mm, lie in the part."""
        return inside_closed(points, self.part.vertices, self.part.faces)
