"""First hits of a camera's rays on a mesh of thousands of triangles, by filling each one's pixels.

Gives what `aov_by_hand.cast` gives, in time proportional to the pixels and not to their product
with the triangles.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iriftrace.camera.camera import Camera
from iriftrace.part.part import Part

FloatArray = NDArray[np.float64]


def rasterise(camera: Camera, part: Part) -> tuple[FloatArray, NDArray[np.int64]]:
    """First hits of every pixel's ray; the part must lie in front of the camera.

    Returns
    -------
    distance, face : (height * width,) arrays
        Distance along the ray, mm, inf for a miss; face number, -1 for a miss.
    """
    width, height = camera.resolution
    origins, directions = (rays.reshape(height, width, 3) for rays in camera.rays())
    distance = np.full((height, width), np.inf)
    face = np.full((height, width), -1)
    corners = part.vertices[part.faces]
    places = camera.project(corners.reshape(-1, 3)).reshape(-1, 3, 2)
    # Pixels whose centres lie in a triangle's bounding box.
    first = np.maximum(np.ceil(places.min(axis=1)), 0).astype(int)
    last = np.minimum(np.floor(places.max(axis=1)), (width - 1, height - 1)).astype(int)
    drawn = (last >= first).all(axis=1)
    if part.closed and camera.projection == "pinhole":
        # Those that turn away lie behind others.
        drawn &= np.einsum("ij,ij->i", camera.origin - corners[:, 0], part.face_normals) > 0
    for number in np.flatnonzero(drawn):
        (left, top), (right, bottom) = first[number], last[number]
        box = np.s_[top : bottom + 1, left : right + 1]
        o, d = origins[box], directions[box]
        a, b, c = corners[number]
        normal = np.cross(b - a, c - a)
        area = normal @ normal
        slope = d @ normal
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (a - o) @ normal / slope
            point = o + t[..., None] * d
            inside = t < distance[box]
            for start, end in ((a, b), (b, c), (c, a)):
                # A hair wider, so that no ray slips through between two triangles.
                inside &= np.cross(end - start, point - start) @ normal >= -1e-12 * area
        distance[box][inside] = t[inside]
        face[box][inside] = number
    return distance.ravel(), face.ravel()
