"""The same refraction by a straightforward loop with trimesh and Embree, for comparison."""

from __future__ import annotations

import time
from statistics import median

import numpy as np
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from iriftrace.core.arrays import FloatArray
from iriftrace.io.shells import load_shells
from iriftrace.tracing.pose_image import pose_image
from iriftrace.tracing.render import render_scene
from iriftrace.tracing.scene import Scene

STEP_MM = 2e-4
"""Offset along the ray beyond the triangle that it left, mm."""

MOST_CROSSINGS = 100


class EmbreeLoop:
    """Rays through the shells of a scene to its part: Embree's nearest triangle, Snell in NumPy."""

    def __init__(self, scene: Scene) -> None:
        shells = load_shells(scene.path.parent).shells
        meshes = [(scene.part.vertices, scene.part.faces), *((s.vertices, s.faces) for s in shells)]
        starts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])[:-1]
        faces = [faces + start for (_, faces), start in zip(meshes, starts, strict=True)]
        vertices = np.concatenate([np.asarray(v, dtype=np.float64) for v, _ in meshes])
        self.part_faces = len(faces[0])
        counts = [len(one) for one in faces]
        self.outside = np.repeat([0.0, *(shell.ext for shell in shells)], counts)
        self.inside = np.repeat([0.0, *(shell.int_ for shell in shells)], counts)
        mesh = trimesh.Trimesh(vertices, np.concatenate(faces), process=False)
        self.normals = np.asarray(mesh.face_normals)
        self.corner = vertices[mesh.faces[:, 0]]
        self.embree = RayMeshIntersector(mesh)

    def trace(self, origin: FloatArray, direction: FloatArray) -> FloatArray:
        """Where rays end on the part, mm; NaN where they miss it."""
        ends = np.full(origin.shape, np.nan)
        place, heading = origin.copy(), direction.copy()
        active = np.arange(len(origin))
        for _ in range(MOST_CROSSINGS):
            face = self.embree.intersects_first(place, heading)
            hit = face >= 0
            face, place, heading, active = face[hit], place[hit], heading[hit], active[hit]
            if len(active) == 0:
                break
            normal = self.normals[face]
            cosine = np.einsum("ij,ij->i", heading, normal)
            way = np.einsum("ij,ij->i", self.corner[face] - place, normal) / cosine
            place = place + way[:, None] * heading
            on_part = face < self.part_faces
            ends[active[on_part]] = place[on_part]
            entering = cosine < 0
            from_, to = (
                np.where(entering, self.outside[face], self.inside[face]),
                np.where(entering, self.inside[face], self.outside[face]),
            )
            ratio = (1.0 + from_) / (1.0 + to)
            facing = np.where(entering, -cosine, cosine)
            turned = 1.0 - ratio**2 * (1.0 - facing**2)
            towards = np.where(entering, 1.0, -1.0)
            along = towards * (ratio * facing - np.sqrt(np.maximum(turned, 0.0)))
            bent = ratio[:, None] * heading + along[:, None] * normal
            on = ~on_part & (turned > 0)
            heading, active = bent[on], active[on]
            place = place[on] + STEP_MM * heading
        return ends


def peer_over_trace(scene: Scene, repeats: int) -> tuple[float, int]:
    """Median over pairs of the loop's time over the refracted trace's, and the number of rays.

    Both bend the same rays at the shells: those whose straight twin hits the part.
    """
    loop = EmbreeLoop(scene)
    image = pose_image(scene)
    row, column = np.nonzero(image.channels["part.face"] > 0)
    origin, direction = image.camera.rays(np.column_stack((column, row)))
    ratios = []
    for _ in range(repeats):
        started = time.perf_counter()
        loop.trace(origin, direction)
        seconds = time.perf_counter() - started
        ratios.append(seconds / render_scene(scene).metrics.time_s["refracted"])
    return median(ratios), len(origin)
