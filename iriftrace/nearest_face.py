"""The nearest point of a triangle surface, and the triangle in which it lies."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
from attrs import field, frozen
from numpy.typing import NDArray
from vtkmodules.vtkCommonCore import mutable
from vtkmodules.vtkCommonDataModel import vtkStaticCellLocator

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@frozen(eq=False)
class NearestFace:
    """A triangle surface that is asked for its points nearest to others.

    Parameters
    ----------
    vertices : (n, 3) array, mm
    faces : (m, 3) array
    """

    vertices: FloatArray
    faces: IntArray
    _locator: vtkStaticCellLocator = field(init=False, repr=False)

    @_locator.default
    def _built(self) -> vtkStaticCellLocator:
        faces = np.insert(self.faces, 0, 3, axis=1).ravel()
        locator = vtkStaticCellLocator()
        locator.SetDataSet(pv.PolyData(np.asarray(self.vertices, dtype=np.float64), faces))
        locator.BuildLocator()
        return locator

    def find(self, points: FloatArray) -> tuple[FloatArray, IntArray]:
        """Nearest points of the surface, and where they lie.

        Parameters
        ----------
        points : (k, 3) array, mm

        Returns
        -------
        foot : (k, 3) array, mm
        face : (k,) array
        """
        foot = np.empty((len(points), 3))
        face = np.empty(len(points), dtype=np.int64)
        # VTK's own types of numbers that a call changes are unknown to its stubs.
        find: Any = self._locator.FindClosestPoint
        point, square = [0.0] * 3, mutable(0.0)
        cell, piece = mutable(0), mutable(0)
        for i, place in enumerate(np.asarray(points, dtype=np.float64).tolist()):
            find(place, point, cell, piece, square)
            foot[i], face[i] = point, int(cell)
        return foot, face

    def distance(self, points: FloatArray) -> FloatArray:
        """Distance (k,), mm, of points (k, 3), mm, from the surface."""
        places = np.asarray(points, dtype=np.float64)
        distance: FloatArray = np.linalg.norm(places - self.find(places)[0], axis=1)
        return distance
