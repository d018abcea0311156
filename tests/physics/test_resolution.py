"""Resolution of tilted planes against closed forms, steps against brute force."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from iriftrace.camera.camera import Camera
from iriftrace.image.metrics import pose_metrics
from iriftrace.image.resolution import step_spacing
from validation.oracles.aov_by_hand import make_image, make_part, plate

FloatArray = NDArray[np.float64]
# Pixels that are not square, so that the nearest pixel is unique.
PITCH = (0.050, 0.052)
SIZE = (30, 24)
PARALLEL = Camera(
    sensor_mm=(PITCH[0] * SIZE[0], PITCH[1] * SIZE[1]), resolution=SIZE, projection="orthographic"
)
PINHOLE = Camera(
    focal_length_mm=10, sensor_mm=(PITCH[0] * SIZE[0], PITCH[1] * SIZE[1]), resolution=SIZE
)
TILTS = [
    (angle, axis)
    for angle in (0.0, 45.0, 75.0)
    for axis in ((1.0, 0.0), (0.0, 1.0), (np.sqrt(0.5), np.sqrt(0.5)))
]


def slopes(angle_deg: float, axis: tuple[float, float]) -> tuple[float, float]:
    """dz/dx and dz/dy of a plane that is tilted about a direction in the picture."""
    tangent = np.tan(np.radians(angle_deg))
    return -tangent * axis[1], tangent * axis[0]


@pytest.mark.parametrize(("angle", "axis"), TILTS)
def test_plane_in_a_parallel_camera(angle: float, axis: tuple[float, float]) -> None:
    """Steps are the same everywhere: the pitch across, the pitch times the slope along.

    Hits are float32 at 20 mm, so a step of 0.05 mm is good to 4e-6 / 0.05 at worst.
    """
    gx, gy = slopes(angle, axis)
    part = plate((2, 0, 2 * gx), (0, 2, 2 * gy), (0, 0, 20))
    metrics = pose_metrics(make_image(PARALLEL, part), part)
    px, py = PITCH
    tolerance = 1e-4 * px
    # The larger of the steps to the right and down; pixels in the last row have only the right one
    # and those in the last column only the lower one. The last pixel has none.
    width, height = SIZE
    inner, row, column = (width - 1) * (height - 1), width - 1, height - 1
    count = inner + row + column
    lateral = (inner * max(px, py) + row * px + column * py) / count
    right, down = abs(gx) * px, abs(gy) * py
    axial = (inner * max(right, down) + row * right + column * down) / count
    assert metrics.lateral_resolution_mm == pytest.approx(lateral, abs=tolerance)
    assert metrics.axial_resolution_mm == pytest.approx(axial, abs=tolerance)


@pytest.mark.parametrize(("angle", "axis"), TILTS)
def test_plane_in_a_pinhole_camera(angle: float, axis: tuple[float, float]) -> None:
    """z = D / (1 - gx u - gy v) at the picture's position (u, v), with u = x/z and v = y/z."""
    gx, gy = slopes(angle, axis)
    distance = 20.0
    part = plate((4, 0, 4 * gx), (0, 4, 4 * gy), (0, 0, distance))
    metrics = pose_metrics(make_image(PINHOLE, part), part)
    u, v = np.meshgrid(
        *((np.arange(n) + 0.5 - n / 2) * pitch / 10 for n, pitch in zip(SIZE, PITCH, strict=True))
    )
    z = distance / (1 - gx * u - gy * v)
    x, y = u * z, v * z
    lateral, axial = np.zeros_like(z), np.zeros_like(z)
    for rows, columns in ((0, 1), (1, 0)):
        here = np.s_[: z.shape[0] - rows, : z.shape[1] - columns]
        there = np.s_[rows:, columns:]
        across = np.hypot(x[there] - x[here], y[there] - y[here])
        lateral[here] = np.maximum(lateral[here], across)
        axial[here] = np.maximum(axial[here], np.abs(z[there] - z[here]))
    known = lateral > 0
    assert metrics.lateral_resolution_mm == pytest.approx(lateral[known].mean(), rel=1e-4)
    assert metrics.axial_resolution_mm == pytest.approx(axial[known].mean(), rel=1e-4, abs=1e-5)


def test_steps_from_one_patch_to_another_do_not_count() -> None:
    """Two plates side by side, one 5 mm behind the other: the jump is no resolution."""
    near, far = plate((1, 0, 0), (0, 2, 0), (-1, 0, 20)), plate((1, 0, 0), (0, 2, 0), (1, 0, 25))
    vertices = np.concatenate((near.vertices, far.vertices))
    faces = np.concatenate((near.faces, far.faces + len(near.vertices)))
    apart = make_part(vertices, faces, groups=[0, 0, 1, 1])
    metrics = pose_metrics(make_image(PARALLEL, apart), apart)
    assert metrics.axial_resolution_mm == pytest.approx(0, abs=1e-9)
    together = make_part(vertices, faces)
    jump = pose_metrics(make_image(PARALLEL, together), together).axial_resolution_mm
    # One pixel of each row but the last column's steps over the edge.
    assert jump == pytest.approx(5 * SIZE[1] / (SIZE[0] * SIZE[1] - 1), rel=1e-3)


@given(seed=st.integers(0, 10_000), holes=st.floats(0, 0.9))
def test_step_is_the_larger_one_to_the_right_and_below(seed: int, holes: float) -> None:
    """Pixel by pixel, on pictures with holes and patches."""
    rng = np.random.default_rng(seed)
    good = rng.random((6, 7)) >= holes
    patch = rng.integers(0, 2, good.shape)
    place = rng.normal(size=(*good.shape, 3))
    lateral, axial = (np.full(good.shape, np.nan) for _ in range(2))
    for row, column in np.argwhere(good):
        for there in ((row, column + 1), (row + 1, column)):
            if there[0] < 6 and there[1] < 7 and good[there] and patch[there] == patch[row, column]:
                step = place[there] - place[row, column]
                lateral[row, column] = np.fmax(lateral[row, column], np.hypot(*step[:2]))
                axial[row, column] = np.fmax(axial[row, column], abs(step[2]))
    found = step_spacing(place[good], np.flatnonzero(good), (7, 6), patch[good])
    np.testing.assert_allclose(found[0], lateral[good], rtol=1e-12)
    np.testing.assert_allclose(found[1], axial[good], rtol=1e-12)
