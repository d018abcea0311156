"""AOV images made with NumPy alone: what the renderer would deliver for simple bodies."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from iriftrace.camera.camera import Camera
from iriftrace.image.aov_image import CHANNELS, SCHEMA, AovImage, Status
from iriftrace.part.part import Part
from iriftrace.part.regions import Regions

FloatArray = NDArray[np.float64]


def make_part(
    vertices: ArrayLike,
    faces: ArrayLike,
    *,
    regions: Regions | None = None,
    groups: ArrayLike | None = None,
) -> Part:
    """A part without a file: one region and one smooth patch by default."""
    faces = np.asarray(faces, dtype=np.int64)
    one = np.zeros(len(faces), dtype=np.int64)
    regions = regions or Regions(one, ("all",))
    return Part(
        vertices=np.asarray(vertices, dtype=np.float64),
        faces=faces,
        region_of_face=regions.of_face,
        region_names=regions.names,
        smooth_group=one if groups is None else np.asarray(groups, dtype=np.int64),
        path="by hand",
        sha256="0" * 64,
        length_unit="mm",
        closed=False,
    )


def plate(axis_x: ArrayLike, axis_y: ArrayLike, centre: ArrayLike, cells: int = 1) -> Part:
    """A parallelogram of `cells` x `cells` x 2 triangles; the axes are its half sides, mm."""
    steps = np.linspace(-1, 1, cells + 1)
    v, u = (a.ravel() for a in np.meshgrid(steps, steps, indexing="ij"))
    vertices = np.asarray(centre) + np.outer(u, axis_x) + np.outer(v, axis_y)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    right, below, across = corner + 1, corner + cells + 1, corner + cells + 2
    first = np.stack((corner, right, across), axis=1)
    second = np.stack((corner, across, below), axis=1)
    return make_part(vertices, np.stack((first, second), axis=1).reshape(-1, 3))


def cast(camera: Camera, part: Part) -> tuple[FloatArray, NDArray[np.int64]]:
    """First hits of every pixel's ray by brute force (Moeller and Trumbore 1997).

    Returns
    -------
    distance, face : (height * width,) arrays
        Distance along the ray, mm, inf for a miss; face number, -1 for a miss.
    """
    origins, directions = camera.rays()
    a, b, c = part.vertices[part.faces].transpose(1, 0, 2)
    distance = np.full(len(origins), np.inf)
    face = np.full(len(origins), -1)
    # With n = (b - a) x (c - a), the ray o + t d meets the plane at t = n.(a - o) / n.d, and the
    # barycentric coordinates there are d.((a - o) x edge) / n.d.
    normal = np.cross(b - a, c - a)
    for start in range(0, len(origins), 1000):
        chunk = slice(start, start + 1000)
        d, o = directions[chunk], origins[chunk]
        slope = d @ normal.T
        moment = np.cross(o, d)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (np.einsum("ij,ij->i", a, normal) - o @ normal.T) / slope
            # d.((a - o) x e) = (d x a).e - (d x o).e = a x e . d + (o x d).e
            u = -(d @ np.cross(a, c - a).T + moment @ (c - a).T) / slope
            v = (d @ np.cross(a, b - a).T + moment @ (b - a).T) / slope
            inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        t = np.where(inside, t, np.inf)
        nearest = t.argmin(axis=1)
        distance[chunk] = t[np.arange(len(t)), nearest]
        face[chunk] = np.where(np.isfinite(distance[chunk]), nearest, -1)
    return distance, face


def make_image(
    camera: Camera,
    part: Part,
    *,
    displacement: ArrayLike = (0.0, 0.0, 0.0),
    shift: ArrayLike = (0.0, 0.0),
    status: ArrayLike | None = None,
    header: dict[str, Any] | None = None,
) -> AovImage:
    """The image of a part, with displacements that the test chooses.

    Parameters
    ----------
    camera, part
        What is seen.
    displacement
        (3,) or (height, width, 3) array, mm, world.
    shift
        (2,) or (height, width, 2) array, px.
    status
        (height, width) codes of the pixels that hit; 0 by default.
    header
        Entries besides schema and camera.
    """
    distance, face = cast(camera, part)
    return image_of_hits(camera, part, distance, face, displacement, shift, status, header)


def image_of_hits(
    camera: Camera,
    part: Part,
    distance: FloatArray,
    face: NDArray[np.int64],
    displacement: ArrayLike = (0.0, 0.0, 0.0),
    shift: ArrayLike = (0.0, 0.0),
    status: ArrayLike | None = None,
    header: dict[str, Any] | None = None,
) -> AovImage:
    """As `make_image`, with hits that are known already."""
    width, height = camera.resolution
    origins, directions = camera.rays()
    hit = face >= 0
    straight = np.zeros((height * width, 3))
    straight[hit] = origins[hit] + distance[hit, None] * directions[hit]
    moved = np.zeros((height, width, 3)) + np.asarray(displacement)
    shifted = np.zeros((height, width, 2)) + np.asarray(shift)
    cosine = np.zeros(height * width)
    cosine[hit] = np.abs(np.einsum("ij,ij->i", directions[hit], part.face_normals[face[hit]]))
    code = np.zeros((height, width)) if status is None else np.asarray(status)
    seen = hit.reshape(height, width)
    planes: dict[str, FloatArray] = {name: np.zeros((height, width)) for name in CHANNELS}
    for i, axis in enumerate("XYZ"):
        planes[f"straight.{axis}"] = straight[:, i].reshape(height, width)
        planes[f"displacement.{axis}"] = moved[..., i]
        planes[f"refracted.{axis}"] = planes[f"straight.{axis}"] + moved[..., i]
    planes["displacement.norm"] = np.linalg.norm(moved, axis=2)
    planes["shift.px.X"], planes["shift.px.Y"] = shifted[..., 0], shifted[..., 1]
    planes["incidence.angle"] = np.arccos(np.clip(cosine, 0, 1)).reshape(height, width)
    planes["path.length"] = np.where(hit, distance, 0).reshape(height, width)
    planes["part.face"] = (face + 1).reshape(height, width).astype(np.float64)
    planes["status.code"] = np.where(seen, code, int(Status.MISSED))
    channels = {
        name: np.where(seen | (name == "status.code"), plane, 0).astype(np.float32)
        for name, plane in planes.items()
    }
    return AovImage(channels, {"schema": SCHEMA, "camera": camera.as_dict(), **(header or {})})
