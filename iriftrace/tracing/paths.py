"""Whole paths of some rays of a camera, for pictures."""

from __future__ import annotations

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import FloatArray
from iriftrace.tracing.engine import choose
from iriftrace.tracing.rays import traced_as_chosen
from iriftrace.tracing.replay import limited
from iriftrace.tracing.scene import Scene

ACROSS = 7
"""Rays across the part's picture, and down."""

STOPS = 24
"""Largest number of points of a path, each of which is one more trace."""


@frozen(eq=False)
class Paths:
    """Paths of n rays: (n, k, 3) points, mm, world, and those abreast of them on straight lines."""

    bent: FloatArray
    straight: FloatArray

    @property
    def largest_offset(self) -> float:
        """Largest distance of a path from its straight line, mm."""
        return float(np.linalg.norm(self.bent - self.straight, axis=2).max(initial=0.0))


def camera_paths(scene: Scene, across: int = ACROSS) -> Paths:
    """Trace a grid of a camera's rays to the part, point by point.

    Parameters
    ----------
    scene : Scene
        Of one field; see `Scene.alone`.
    across : int
        Rays across the rectangle that holds the part in the camera's picture, and down. Those that
        miss the part, straight or refracted, are left out.
    """
    camera = scene.camera
    seen = camera.project(scene.part.vertices)
    last = np.array(camera.resolution, dtype=np.float64) - 1.0
    seen = np.clip(seen[np.isfinite(seen).all(axis=1)], 0.0, last)
    low, high = seen.min(axis=0), seen.max(axis=0)
    steps = (np.arange(across) + 0.5) / across
    u, v = np.meshgrid(*(a + steps * (b - a) for a, b in zip(low, high, strict=True)))
    start, along = camera.rays(np.stack((u.ravel(), v.ravel()), axis=1))
    traced = choose(scene, (start, along)).scene if scene.engine.free else scene
    hits = traced_as_chosen(traced, start, along)
    whole = np.isfinite(hits.straight).all(axis=1) & np.isfinite(hits.refracted).all(axis=1)
    if not whole.any():
        return Paths(np.empty((0, 2, 3)), np.empty((0, 2, 3)))
    start, along = start[whole], along[whole]
    most = int(hits.crossings[whole].max())
    name = "max_steps" if traced.compiled.engine.through_cells else "max_crossings"
    points = [start]
    for stop in np.unique(np.linspace(1, max(most, 1), min(most, STOPS)).astype(int)).tolist():
        with limited(traced, name, stop):
            points.append(traced_as_chosen(traced, start, along).last_point)
    points.append(hits.refracted[whole])
    bent = np.stack(points, axis=1)
    reach = np.einsum("nki,ni->nk", bent - start[:, None], along)
    return Paths(bent, start[:, None] + reach[..., None] * along[:, None])
