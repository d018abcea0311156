"""The real scene against an independent tracer: float64 NumPy, brute force over all triangles."""

from __future__ import annotations

import numpy as np
import pytest

from iriftrace.render import trace_rays
from iriftrace.scene import load_scene
from iriftrace.scenes import folder_of
from tests.numpy_tracer import NumpyTracer

RAYS = 600
EDGE_MM = 1e-4
"""Closer to an edge than this, single precision may pick the neighbouring triangle."""


@pytest.mark.usefixtures("variant")
def test_random_rays_of_the_real_scene_agree() -> None:
    """Random rays from all around, aimed at the part; hits within 1e-6 mm, crossings all equal."""
    xml = folder_of("cylinder") / "scene.xml"
    scene = load_scene(xml, {"normals": "facet"})
    random = np.random.default_rng(20251121)
    start = random.normal(size=(RAYS, 3))
    start *= 260 / np.linalg.norm(start, axis=1, keepdims=True)
    aim = random.uniform(-1, 1, size=(RAYS, 3)) * (80, 10, 10)
    direction = (aim - start) / np.linalg.norm(aim - start, axis=1, keepdims=True)
    found = trace_rays(scene, start, direction)

    tracer = NumpyTracer(xml)
    endings = [tracer.trace(o, d) for o, d in zip(start, direction, strict=True)]
    assert [e.crossings for e in endings] == found.crossings.tolist()
    hit = np.array([e.point is not None for e in endings])
    np.testing.assert_array_equal(hit, found.refracted_face >= 0)
    clear = hit & (np.array([e.edge_distance for e in endings]) > EDGE_MM)
    assert clear.sum() >= 500
    expected = np.array([e.point for e, ok in zip(endings, clear, strict=True) if ok])
    error = np.linalg.norm(found.refracted[clear] - expected, axis=1)
    assert error.max() < 1e-6
