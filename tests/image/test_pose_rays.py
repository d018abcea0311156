"""The rays that count, against the plain formulas for one vector at a time."""

import numpy as np
import pytest

from iriftrace.camera.camera import Camera
from iriftrace.camera.pose import look_at
from iriftrace.image.aov_image import Status
from iriftrace.image.displacement import displacement_map, shift_map
from iriftrace.image.rays import bending, rays_that_count
from validation.oracles.aov_by_hand import make_image, plate

WALL = plate((8, 3, 0), (0, 1, 9), (0, 0, 0))
POSE = look_at((20, -60, 15), (0, 0, 0))
CAMERAS = [
    Camera(focal_length_mm=10, sensor_mm=(6, 4), resolution=(60, 40), matrix=POSE),
    Camera(sensor_mm=(24, 16), resolution=(60, 40), matrix=POSE, projection="orthographic"),
]


@pytest.mark.parametrize("camera", CAMERAS)
def test_rays_are_those_of_the_image(camera: Camera) -> None:
    rng = np.random.default_rng(7)
    vector = rng.normal(size=(40, 60, 3)) * 1e-3
    status = rng.choice([Status.GOOD, Status.INDEX_MISMATCH, Status.OUT_OF_FOCUS], size=(40, 60))
    image = make_image(
        camera, WALL, displacement=vector, shift=rng.normal(size=(40, 60, 2)), status=status
    )
    for include in ((0,), (0, 5)):
        rays = rays_that_count(image, include)
        good = np.isin(image.status, include)
        assert 100 < good.sum() < good.size
        np.testing.assert_array_equal(rays.pixels, np.flatnonzero(good))
        np.testing.assert_array_equal(rays.face + 1, image.channels["part.face"][good])
        hits = image.vector("straight", good)
        np.testing.assert_allclose(rays.position.T, camera.to_camera(hits), rtol=1e-13, atol=1e-12)
        np.testing.assert_allclose(rays.distance, image.channels["path.length"][good], rtol=1e-6)
        np.testing.assert_array_equal(rays.incidence, image.channels["incidence.angle"][good])

        found = bending(image, rays)
        split, shift = displacement_map(image, include), shift_map(image, include)
        across, along = (found[f"displacement_{way}_mm"] for way in ("lateral", "axial"))
        np.testing.assert_array_equal(found["displacement_mm"], split.norm[good])
        np.testing.assert_allclose(across, split.lateral[good], rtol=1e-12)
        np.testing.assert_allclose(along, np.abs(split.axial[good]), rtol=1e-9, atol=1e-18)
        np.testing.assert_allclose(found["shift_px"], np.linalg.norm(shift.pixels[good], axis=1))
