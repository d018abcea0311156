"""Distances to the nearest neighbour of tilted planes, and against brute force."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from iriftrace.camera.camera import Camera
from validation.oracles.aov_by_hand import make_image, plate
from validation.paper.nearest import nearest_resolution, nearest_spacing

# Pixels that are not square, so that the nearest pixel is unique.
PITCH = (0.050, 0.052)
SIZE = (30, 24)
PARALLEL = Camera(
    sensor_mm=(PITCH[0] * SIZE[0], PITCH[1] * SIZE[1]), resolution=SIZE, projection="orthographic"
)


@pytest.mark.parametrize("angle_deg", [0.0, 45.0, 75.0])
@pytest.mark.parametrize("axis", [(1.0, 0.0), (0.0, 1.0), (np.sqrt(0.5), np.sqrt(0.5))])
def test_plane_in_a_parallel_camera(angle_deg: float, axis: tuple[float, float]) -> None:
    """Steps to all pixels are the same everywhere, so the shortest one is the nearest neighbour."""
    tangent = np.tan(np.radians(angle_deg))
    gx, gy = -tangent * axis[1], tangent * axis[0]
    image = make_image(PARALLEL, plate((2, 0, 2 * gx), (0, 2, 2 * gy), (0, 0, 20)))
    px, py = PITCH
    tolerance = 1e-4 * px
    steps = np.array([(i * px, j * py) for i in range(-9, 10) for j in range(-9, 10) if i or j])
    depth = steps @ (gx, gy)
    in_space = np.argmin((steps**2).sum(axis=1) + depth**2)
    in_plane = np.argmin((steps**2).sum(axis=1))
    for dimensions, nearest in ((3, in_space), (2, in_plane)):
        # At the border the nearest neighbour may be missing; that concerns few points.
        lateral, axial = nearest_resolution(image, dimensions)
        border = 0.0 if dimensions == 2 or abs(gx * gy) < 1e-9 else 0.06
        assert lateral == pytest.approx(np.hypot(*steps[nearest]), rel=border, abs=tolerance)
        assert axial == pytest.approx(
            abs(depth[nearest]), rel=0, abs=tolerance + border * np.hypot(px, py) * 4
        )


@settings(max_examples=40)
@given(
    seed=st.integers(0, 10_000),
    roughness=st.floats(0, 3),
    holes=st.floats(0, 0.95),
    parallel=st.booleans(),
)
def test_nearest_spacing_finds_the_nearest_point(
    seed: int, roughness: float, holes: float, parallel: bool
) -> None:
    """Rough, steep and sparse surfaces, where the nearest point is not the next pixel's."""
    rng = np.random.default_rng(seed)
    width, height = 17, 13
    camera = Camera(
        focal_length_mm=10,
        sensor_mm=(width * 0.1, height * 0.13),
        resolution=(width, height),
        projection="orthographic" if parallel else "pinhole",
    )
    good = rng.random((height, width)) >= holes
    if good.sum() < 2:
        good[0, :2] = True
    origins, directions = (rays[good.ravel()] for rays in camera.rays())
    slope = rng.normal(size=2) * 2
    depth = 15 + roughness * rng.random(len(directions))
    distance = depth / np.maximum(0.2, 1 - directions[:, :2] @ slope)
    points = origins + distance[:, None] * directions
    lateral, axial = nearest_spacing(points, 3)
    offset = points[:, None] - points[None]
    squared = np.where(np.eye(len(points), dtype=bool), np.inf, (offset**2).sum(axis=2))
    np.testing.assert_allclose(np.hypot(lateral, axial), np.sqrt(squared.min(axis=1)), rtol=1e-12)
    lateral, _ = nearest_spacing(points, 2)
    across = np.where(np.eye(len(points), dtype=bool), np.inf, (offset[..., :2] ** 2).sum(axis=2))
    np.testing.assert_allclose(lateral, np.sqrt(across.min(axis=1)), rtol=1e-12)


def test_equal_points_are_each_others_nearest() -> None:
    points = np.array([[0.0, 0, 10], [0, 0, 10], [3, 0, 10]])
    np.testing.assert_allclose(nearest_spacing(points, 2)[0], [0, 0, 3])
