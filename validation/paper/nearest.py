"""Resolution as the distance to the nearest neighbour among the hits of one pose.

Kern et al. (2025) use this distance, across and along the optical axis. Nearest can mean in space
or in the plane across the axis. On a plane tilted about a pixel axis the nearest point in either
sense lies at the same depth, so that the axial value is 0.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from iriftrace.core.arrays import FloatArray
from iriftrace.image.aov_image import AovImage, Status
from iriftrace.image.rays import rays_that_count
from iriftrace.image.resolution import Spacing


def nearest_resolution(image: AovImage, dimensions: int) -> tuple[float, float]:
    """Mean of `nearest_spacing` over an image's good rays: across and along the axis, mm."""
    lateral, axial = nearest_spacing(rays_that_count(image, (Status.GOOD,)).position.T, dimensions)
    return float(lateral.mean()), float(axial.mean())


def nearest_spacing(points: FloatArray, dimensions: int) -> Spacing:
    """Step from each of (n, 3) hit points, mm, camera frame, to the nearest other one.

    In space (3 dimensions) or across the optical axis (2); there are at least two points.
    """
    places = points[:, :dimensions]
    # An unbalanced tree is built twice as fast and is searched as fast.
    tree = cKDTree(places, balanced_tree=False, compact_nodes=False)
    found = tree.query(places, k=2, workers=-1)[1]
    # Of two equal points either may come first.
    nearest = np.where(found[:, 0] == np.arange(len(points)), found[:, 1], found[:, 0])
    x, y, z = (row[nearest] - row for row in np.ascontiguousarray(points.T))
    return np.sqrt(x * x + y * y), np.abs(z)
