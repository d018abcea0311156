"""A part with notches, for tests that need more than a convex body."""

from __future__ import annotations

import numpy as np

from iriftrace.part.part import Part, part_of_mesh


def gear(teeth: int = 6, outer: float = 12.0, inner: float = 8.0, width: float = 8.0) -> Part:
    """A spur gear with straight flanks about the z axis, mm."""
    count = 4 * teeth
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    radius = np.where(np.arange(count) % 4 < 2, outer, inner)
    ring = np.column_stack((radius * np.cos(angle), radius * np.sin(angle), np.zeros(count)))
    half = np.array((0.0, 0.0, width / 2.0))
    vertices = np.concatenate((ring - half, ring + half, [-half, half]))
    here = np.arange(count)
    following = (here + 1) % count
    below, above = np.full(count, 2 * count), np.full(count, 2 * count + 1)
    faces = np.concatenate(
        [
            np.column_stack(columns)
            for columns in (
                (here, following, following + count),
                (here, following + count, here + count),
                (following, here, below),
                (here + count, following + count, above),
            )
        ]
    )
    return part_of_mesh(vertices, faces, name="gear")
