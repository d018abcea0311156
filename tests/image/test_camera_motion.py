"""A small motion of the camera, got back from what it shifts in the picture."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from iriftrace.camera.camera import Camera
from iriftrace.camera.distortion import Distortion
from iriftrace.camera.pose import look_at
from iriftrace.core.errors import InputError
from iriftrace.measuring.camera_motion import fit_camera_motion, interaction_matrix
from validation.inputs.lenses import LENSES, lens_camera

MOTION = np.array((4e-3, -3e-3, 6e-3, 2e-5, -3e-5, 5e-5))
"""mm and rad: a few um and tens of urad, as a tripod drifts while a part is heated."""


def points(count: int, seed: int = 1) -> np.ndarray:
    """On the upper half of a ball of 30 mm about the origin."""
    direction = np.random.default_rng(seed).normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return 30 * direction * np.where(direction[:, 2:] < 0, -1, 1)


def moved(camera: Camera, motion: np.ndarray) -> Camera:
    """Exactly, not to first order."""
    step = np.eye(4)
    step[:3, :3] = Rotation.from_rotvec(motion[3:]).as_matrix()
    step[:3, 3] = motion[:3]
    return camera.at(camera.matrix @ step)


def shifts_of(camera: Camera, where: np.ndarray, motion: np.ndarray) -> np.ndarray:
    return moved(camera, motion).project(where) - camera.project(where)


@pytest.mark.parametrize("lens", [None, *LENSES.values()], ids=["pinhole", *LENSES])
def test_interaction_matrix_is_the_derivative_of_the_projection(lens: Distortion | None) -> None:
    """Central differences by 1e-3 mm and 1e-5 rad: off by their square and 1e-12 px of rounding."""
    camera, where = lens_camera(lens), points(50)
    found = interaction_matrix(camera, where)
    for column, step in enumerate((1e-3,) * 3 + (1e-5,) * 3):
        unit = np.zeros(6)
        unit[column] = step
        expected = (shifts_of(camera, where, unit) - shifts_of(camera, where, -unit)) / (2 * step)
        np.testing.assert_allclose(found[:, :, column], expected, rtol=1e-6, atol=1e-11 / step)


def test_interaction_matrix_of_parallel_rays() -> None:
    camera = Camera(
        projection="orthographic",
        sensor_mm=(60, 50),
        resolution=(600, 400),
        matrix=look_at((150, -100, 120), (0, 0, 0)),
    )
    where = points(50)
    found = interaction_matrix(camera, where)
    np.testing.assert_array_equal(found[:, :, 2], 0)
    np.testing.assert_allclose(
        np.einsum("nij,j->ni", found, MOTION), shifts_of(camera, where, MOTION), atol=1e-5
    )
    with pytest.raises(InputError, match="do not determine the motion of the camera"):
        fit_camera_motion(camera, where, found @ MOTION)


@pytest.mark.parametrize("lens", [None, LENSES["barrel"]], ids=["pinhole", "barrel"])
def test_exact_motion_comes_back(lens: Distortion | None) -> None:
    """Without noise only the second order of the motion is left, 1e-5 of it."""
    camera, where = lens_camera(lens), points(300)
    found = fit_camera_motion(camera, where, shifts_of(camera, where, MOTION))
    got = np.concatenate((found.translation_mm, found.rotation_rad))
    np.testing.assert_allclose(got, MOTION, rtol=2e-3)
    assert found.rms_before_px > 0.1
    assert found.rms_after_px < 1e-4
    assert found.explained > 0.999999


def test_uncertainty_is_the_scatter_of_repeated_measurements() -> None:
    """Of 200 noisy measurements the normalised errors have mean 0 and mean square 1 in each of the
    six numbers, to three of their own deviations; the residual's deviation is the noise's."""
    camera, where, noise, count = lens_camera(None), points(100), 0.02, 200
    exact = shifts_of(camera, where, MOTION)
    rng = np.random.default_rng(2)
    errors, rest = np.empty((count, 6)), np.empty(count)
    for k in range(count):
        found = fit_camera_motion(camera, where, exact + rng.normal(0, noise, exact.shape))
        got = np.concatenate((found.translation_mm, found.rotation_rad))
        errors[k] = (got - MOTION) / found.deviations
        rest[k] = found.rms_after_px
        assert found.used.all()
    assert np.abs(errors.mean(axis=0)).max() < 3.5 / np.sqrt(count)
    assert np.abs((errors**2).mean(axis=0) - 1).max() < 3.5 * np.sqrt(2 / count)
    # Six of 200 numbers are fitted away.
    assert rest.mean() == pytest.approx(noise * np.sqrt(2 * 194 / 200), rel=0.01)


def test_outliers_do_not_pull() -> None:
    """Every twentieth point is off by pixels, as at silhouettes; they are told and left out."""
    camera, where = lens_camera(None), points(400)
    rng = np.random.default_rng(3)
    shifts = shifts_of(camera, where, MOTION) + rng.normal(0, 0.01, (400, 2))
    off = np.arange(400) % 20 == 0
    shifts[off] += rng.choice((-1, 1), (20, 2)) * rng.uniform(1, 8, (20, 2))
    found = fit_camera_motion(camera, where, shifts)
    np.testing.assert_array_equal(found.used, ~off)
    got = np.concatenate((found.translation_mm, found.rotation_rad))
    assert (np.abs(got - MOTION) < 4 * found.deviations).all()


def test_points_that_do_not_tell_motions_apart() -> None:
    camera = lens_camera(None)
    line = np.outer(np.linspace(-20, 20, 50), (1.0, 0.5, 0.2))
    with pytest.raises(InputError, match="do not determine the motion"):
        fit_camera_motion(camera, line, np.zeros((50, 2)))
    with pytest.raises(InputError, match="3 points do not determine"):
        fit_camera_motion(camera, points(3), np.zeros((3, 2)))


def test_no_shift_is_no_motion() -> None:
    found = fit_camera_motion(lens_camera(None), points(20), np.zeros((20, 2)))
    np.testing.assert_array_equal(found.translation_mm, 0)
    assert found.explained == 0.0
    assert found.used.all()
