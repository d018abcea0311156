"""Brown and Conrady's distortion and its inverse against OpenCV and against its own derivatives."""

import cv2
import numpy as np
import pytest

from iriftrace.camera.camera import Camera
from iriftrace.camera.distortion import (
    ORDER,
    Distortion,
    distorted,
    fold_radius,
    jacobian,
    undistorted,
)
from iriftrace.camera.pose import look_at
from iriftrace.core.errors import InputError
from validation.inputs.lenses import LENSES, lens_camera

lenses = pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)


def field_points(count: int = 2000) -> np.ndarray:
    return np.random.default_rng(4).uniform(-0.35, 0.35, (count, 2))


@lenses
def test_derivatives_are_those_of_finite_differences(lens: Distortion) -> None:
    """Central differences of step 1e-5 are off by their third order, 1e-10, and rounding, 1e-11."""
    x, y = field_points().T
    step = 1e-5
    right, left = (distorted(x + s, y, lens.coefficients) for s in (step, -step))
    below, above = (distorted(x, y + s, lens.coefficients) for s in (step, -step))
    xx, xy, yy = jacobian(x, y, lens.coefficients)
    for found, (more, less) in (
        (xx, (right[0], left[0])),
        (xy, (right[1], left[1])),
        (xy, (below[0], above[0])),
        (yy, (below[1], above[1])),
    ):
        np.testing.assert_allclose(found, (more - less) / (2 * step), rtol=0, atol=1e-9)


@lenses
def test_inverse_is_exact_and_opencvs(lens: Distortion) -> None:
    """To 1e-14, which is 4e-11 px at 3650 px. OpenCV iterates a fixed point, here to its end."""
    places = field_points()
    found = undistorted(places, lens)
    again = np.stack(distorted(*found.T, lens.coefficients), axis=1)
    np.testing.assert_allclose(again, places, rtol=0, atol=1e-14)
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 1000, 1e-15)
    theirs = cv2.undistortPoints(
        places[:, None], np.eye(3), np.array(lens.coefficients), criteria=criteria
    )
    np.testing.assert_allclose(found, theirs[:, 0], rtol=0, atol=1e-11)


def test_fold_is_where_the_radius_turns_back() -> None:
    """r (1 + k1 r^2) grows up to r = 1 / sqrt(-3 k1); nothing appears beyond 2/3 of that."""
    for k1 in (-0.05, -0.3, -2.0):
        turn = 1 / np.sqrt(-3 * k1)
        assert fold_radius(Distortion(k1=k1)) == pytest.approx(turn, rel=0.01)
        assert fold_radius(Distortion(k1=k1)) <= turn
        places = np.array([(0.66 * turn, 0.0), (0.0, -0.67 * turn), (2 * turn, 0.0)])
        found = undistorted(places, Distortion(k1=k1))
        assert np.isfinite(found[0]).all()
        assert np.isnan(found[1:]).all()
    # An ever growing radius never folds, and a pole of the denominator ends the field.
    assert fold_radius(Distortion(k1=0.3)) > 300
    assert fold_radius(Distortion(k4=-4.0)) <= 0.5
    # On the x-axis p2 adds 3 p2 x^2: it turns back at x = -1 / (6 p2) on one side only.
    assert fold_radius(Distortion(p2=0.1)) == pytest.approx(1 / 0.6, rel=0.01)


def test_coefficients_come_in_opencvs_order() -> None:
    assert ORDER == ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    for count in (4, 5, 8):
        assert Distortion.of_sequence(range(1, count + 1)).coefficients == (
            *range(1, count + 1),
            *[0] * (8 - count),
        )
    assert Distortion(k3=0.5, p1=0.1).as_dict()["k3"] == 0.5
    assert Distortion().vanishes
    assert not Distortion(k6=1e-9).vanishes


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((1, 2, 3), "3 coefficients"),
        (range(14), "14 coefficients"),
        ((0, np.nan, 0, 0), "k2 = nan"),
        ((0, 0, 0, -np.inf), "p2 = -inf"),
    ],
)
def test_wrong_coefficients_are_refused(values: list[float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Distortion.of_sequence(values)


@lenses
def test_camera_projects_as_opencv_does(lens: Distortion) -> None:
    """1e-6 px are demanded; OpenCV counts pixel centres as whole numbers, 0.5 less than here."""
    camera = lens_camera(lens)
    origins, directions = camera.rays(np.random.default_rng(7).uniform(0, (2448, 2048), (3000, 2)))
    points = origins + directions * np.random.default_rng(8).uniform(20, 500, (3000, 1))
    rotation = camera.matrix[:3, :3].T
    fx, fy = camera.focal_px
    cx, cy = camera.principal_point_px
    expected, _ = cv2.projectPoints(
        points,
        cv2.Rodrigues(rotation)[0],
        -rotation @ camera.origin,
        np.array(((fx, 0, cx), (0, fy, cy), (0, 0, 1))),
        np.array(lens.coefficients),
    )
    np.testing.assert_allclose(camera.project(points), expected[:, 0], rtol=0, atol=1e-9)


@lenses
def test_rays_and_projection_are_inverse(lens: Distortion) -> None:
    """To 1e-10 px, at the picture's corners too."""
    camera = lens_camera(lens)
    pixels = np.random.default_rng(9).uniform(0, (2448, 2048), (3000, 2))
    pixels[:4] = ((0, 0), (2448, 0), (0, 2048), (2448, 2048))
    origins, directions = camera.rays(pixels)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-15)
    # At the distance of the origin from the world's centre, so that rounding counts least.
    found = camera.project(origins + 200 * directions)
    np.testing.assert_allclose(found, pixels, rtol=0, atol=1e-10)


def test_scaled_and_cropped_cameras_see_the_same() -> None:
    camera = lens_camera(LENSES["rational"])
    points = np.random.default_rng(10).uniform(-30, 30, (50, 3))
    window = camera.cropped(300, 200, 64, 48)
    np.testing.assert_allclose(
        window.project(points), camera.project(points) - (300, 200), rtol=0, atol=1e-9
    )
    np.testing.assert_allclose(
        camera.scaled(0.5).project(points) + 0.5,
        (camera.project(points) + 0.5) / 2,
        rtol=0,
        atol=1e-9,
    )
    again = Camera.from_dict(window.as_dict())
    assert again.distortion == camera.distortion
    assert again.as_dict() == window.as_dict()


def test_no_distortion_is_a_pinhole_to_the_last_bit() -> None:
    """Zero coefficients are no distortion at all."""
    zero, none = lens_camera(Distortion()), lens_camera(None)
    assert zero.distortion is None
    assert zero.lens == none.lens == "pinhole, no lens distortion"
    pixels = np.random.default_rng(11).uniform(0, 2000, (100, 2))
    np.testing.assert_array_equal(zero.rays(pixels)[1], none.rays(pixels)[1])
    assert lens_camera(LENSES["barrel"]).lens.startswith("distorted: ")


def test_pictures_that_the_lens_folds_are_refused() -> None:
    """k1 = -3 turns back at 18 degrees, inside the picture's corners, which see no direction."""
    with pytest.raises(InputError, match=r"k1 -3\) turns back inside the picture of 2448 x 2048"):
        lens_camera(Distortion(k1=-3.0))
    # Its middle is in order.
    middle = Camera(
        focal_length_mm=10.0,
        sensor_mm=(2.0, 2.0),
        resolution=(500, 500),
        distortion=Distortion(k1=-3.0),
    )
    with pytest.raises(InputError, match=r"position \(2000, 250\) px has no line of sight"):
        middle.rays([(250, 250), (2000, 250)])
    # A direction beyond the turn would appear in the picture a second time.
    far = 1 / np.sqrt(3.0)
    assert abs(distorted(far, 0.0, Distortion(k1=-3.0).coefficients)[0]) < 1e-15
    assert np.isnan(middle.project([(far * 100, 0.0, 100.0)])).all()
    np.testing.assert_allclose(middle.project([(0.0, 0.0, 100.0)]), [(249.5, 249.5)])


def test_parallel_rays_have_no_distortion() -> None:
    with pytest.raises(InputError, match="orthographic camera, for which it is not defined"):
        Camera(
            projection="orthographic",
            sensor_mm=(60, 50),
            resolution=(60, 50),
            matrix=look_at((0, -9, 0), (0, 0, 0)),
            distortion=Distortion(k1=0.1),
        )
