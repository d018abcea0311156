"""What is built once for a scene and then serves every pose: tables, sub-scene, wall layers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .aligned import aligned
from .geometry import PART, SceneTables, shell_indices
from .tracing import crossed_steps, query_step

SAMPLES_PER_DIAGONAL = 100
"""Wall samples along the part's diagonal, by which the layer at the wall is found."""

WALL_STEPS = 80
"""Steps of a ray query before and behind a point between which its layer is uncertain."""


class PreparedScene:
    """A scene ready for tracing.

    Parameters
    ----------
    scene : mi.Scene
        Loaded with ``optimize=False``.

    Raises
    ------
    InputError
        See :class:`SceneTables`.
    """

    def __init__(self, scene: Any) -> None:
        import mitsuba as mi

        self.scene = scene
        self.tables = SceneTables(scene)
        self.step = query_step(scene)
        opaque = [s for s in scene.shapes() if shell_indices(s.bsdf()) is None]
        if self.tables.shell_shapes:
            # Straight rays never look at shells; most of the query's cost is theirs. A shape takes
            # its key as id, so the keys are the ids it has.
            content = {shape.id() or f"shape_{i}": shape for i, shape in enumerate(opaque)}
            self.opaque = mi.load_dict(
                {"type": "scene", "embree_use_robust_intersections": True, **content},
                optimize=False,
            )
        else:
            self.opaque = scene
        low, high = self._wall_layers()
        self.lowest_wall_index = mi.Float64(low)
        self.highest_wall_index = mi.Float64(high)

    def surroundings(self, point: NDArray[np.float64]) -> str | None:
        """What a point (3,), mm, world, lies in: ``"part"``, ``"hot air"`` or None for outside.

        Inside a closed surface every line starts by crossing it outward; most do if it has holes.
        """
        import drjit as dr
        import mitsuba as mi

        directions = _directions(256)
        origin = mi.Point3d(*(aligned(np.full(len(directions), x)) for x in point))
        direction = mi.Vector3d(*(aligned(x) for x in directions.T))
        _, enclosed = crossed_steps(self.scene, self.tables, origin, direction, self.step)
        ray = mi.Ray3f(mi.Point3f(origin), mi.Vector3f(direction))
        hit = self.opaque.ray_intersect_preliminary(ray)
        found = hit.is_valid()
        shape = self.tables.shape_number(hit, found)
        on_part = found & (self.tables.kind(shape, found) == PART)
        _, normal = self.tables.plane(self.tables.face(shape, hit.prim_index, on_part), on_part)
        behind = on_part & (dr.dot(normal, direction) > 0)
        if np.mean(np.array(behind)) > 0.5:
            return "part"
        return "hot air" if np.mean(np.array(enclosed)) > 0.5 else None

    def _wall_layers(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Smallest and largest index of the layers that touch each face of the part.

        Straight lines from many points on the part count the steps to the outside; so no field is
        needed, and shells that cut the part or end on it are taken as they are. The samples can
        miss a small patch, so rays that do not fit are looked at one by one.
        """
        vertices, faces = self.tables.part_arrays()
        if not self.tables.shell_shapes or self.tables.stock_shells:
            return np.full(len(faces), -np.inf), np.full(len(faces), np.inf)
        points, directions, face = _wall_samples(vertices, faces)
        index = self.layers_near(points, directions).ravel()
        return _spread(index, np.concatenate((face, face)), faces, len(vertices))

    def layers_near(
        self, points: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Index of the layer just before and just behind points, counted from outside.

        Parameters
        ----------
        points : (n, 3) array, mm, world
        directions : (n, 3) array
            Unit vectors towards the outside.

        Returns
        -------
        (2, n) array
        """
        import mitsuba as mi

        direction = mi.Vector3d(*(aligned(x) for x in directions.T))
        index = np.array(
            [
                crossed_steps(
                    self.scene,
                    self.tables,
                    mi.Point3d(*(aligned(x) for x in (points + shift * directions).T)),
                    direction,
                    self.step,
                )[0]
                for shift in (WALL_STEPS * self.step, -WALL_STEPS * self.step)
            ]
        )
        index[index == 0] = self.tables.ambient
        return index


def _directions(count: int) -> NDArray[np.float64]:
    """Unit vectors spread evenly over the sphere (count, 3): a Fibonacci lattice."""
    number = np.arange(count)
    z = 1 - (2 * number + 1) / count
    azimuth = number * np.pi * (3 - np.sqrt(5))
    radius = np.sqrt(1 - z * z)
    return np.stack((radius * np.cos(azimuth), radius * np.sin(azimuth), z), axis=1)


def _wall_samples(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Points spread over all faces (n, 3), the outward normals there, and their face numbers."""
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    spacing = np.linalg.norm(np.ptp(vertices, axis=0)) / SAMPLES_PER_DIAGONAL
    # As many as the area asks for, and at least two, so that slivers are met too.
    counts = np.where(length[:, 0] > 0, 2 + length[:, 0] / spacing**2, 0).astype(np.int64)
    face = np.repeat(np.arange(len(faces)), counts)
    # A plane lattice of even spread (Roberts 2018, R2), folded into the triangle.
    u, v = (np.arange(len(face)) * step % 1 for step in (0.7548776662466927, 0.5698402909980532))
    folded = u + v > 1
    u, v = np.where(folded, 1 - u, u)[:, None], np.where(folded, 1 - v, v)[:, None]
    a, b, c = (corners[face, k] for k in range(3))
    return a + u * (b - a) + v * (c - a), normals[face], face


def _spread(
    index: NDArray[np.float64],
    face: NDArray[np.int64],
    faces: NDArray[np.int64],
    vertex_count: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Extremes over each face and the faces around it: a shell may end between two samples."""
    bounds = []
    for extreme, start in ((np.minimum, np.inf), (np.maximum, -np.inf)):
        of_face = np.full(len(faces), start)
        extreme.at(of_face, face, index)
        of_vertex = np.full(vertex_count, start)
        extreme.at(of_vertex, faces.ravel(), np.repeat(of_face, 3))
        bounds.append(extreme.reduce(of_vertex[faces], axis=1))
    return bounds[0], bounds[1]
