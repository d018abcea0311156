"""The camera in plain NumPy: frames, projection, solid angles, wrong input."""

import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from iriftrace.camera.camera import Camera
from iriftrace.camera.pose import look_at
from iriftrace.core.errors import InputError

PAPER: dict[str, Any] = {
    "focal_length_mm": 10.0,
    "sensor_mm": (6.7, 5.6),
    "resolution": (2448, 2048),
}
COORDINATE = st.floats(-500, 500)
POINT = st.tuples(COORDINATE, COORDINATE, COORDINATE)


def paper(**more: Any) -> Camera:
    return Camera(**{**PAPER, **more})


def test_horizontal_camera_has_z_up_and_its_right_at_the_right() -> None:
    """Looking along +y: right is +x, down is -z; a point right and above is right and above."""
    matrix = look_at((0, -100, 0), (0, 0, 0))
    np.testing.assert_allclose(matrix[:3, :3].T, ((1, 0, 0), (0, 0, -1), (0, 1, 0)), atol=1e-15)
    x, y = paper(matrix=matrix).project([(5.0, 0.0, 3.0)])[0]
    assert x > 1224
    assert y < 1024


@given(POINT, POINT)
def test_look_at_is_a_rigid_motion_that_points_at_its_target(
    origin: tuple[float, ...], target: tuple[float, ...]
) -> None:
    if math.dist(origin, target) < 1e-3:
        return
    camera = paper(matrix=look_at(origin, target))
    rotation = camera.matrix[:3, :3]
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-9)
    assert np.linalg.det(rotation) == pytest.approx(1)
    np.testing.assert_array_equal(camera.origin, origin)
    local = camera.to_camera([target])[0]
    np.testing.assert_allclose(local, (0, 0, math.dist(origin, target)), atol=1e-8)
    # The picture does not lean: its horizontal direction is horizontal in the world.
    assert abs(camera.matrix[2, 0]) < 1e-9


def test_vertical_camera_takes_y_for_up_and_another_up_turns_the_picture() -> None:
    for sign in (1, -1):
        matrix = look_at((0, 0, 100 * sign), (0, 0, 0))
        np.testing.assert_allclose(matrix[:3, 1:3].T, ((0, -1, 0), (0, 0, -sign)), atol=1e-15)
    matrix = look_at((0, -100, 0), (0, 0, 0), (1, 0, 0))
    np.testing.assert_allclose(matrix[:3, 1], (-1, 0, 0), atol=1e-15)


@pytest.mark.parametrize(
    ("origin", "target", "message"),
    [
        ((1, 2, 3), (1, 2, 3), r"same point \[1\.0, 2\.0, 3\.0\]"),
        ((1, 2, math.nan), (0, 0, 0), "not finite"),
        ((1, 2, 3), (0, math.inf, 0), "not finite"),
    ],
)
def test_poses_without_a_line_of_sight_are_refused(
    origin: tuple[float, ...], target: tuple[float, ...], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        look_at(origin, target)


def test_pixel_centres_and_pitch() -> None:
    """Pixel i covers [i - 0.5, i + 0.5): 2.7369 x 2.7344 um, the corner pixel's ray by hand."""
    camera = paper()
    np.testing.assert_allclose(
        np.multiply(camera.pixel_pitch_mm, 1e3), (2.736928, 2.734375), atol=1e-6
    )
    np.testing.assert_allclose(camera.focal_px, (10e3 / 2.7369281, 10e3 / 2.734375), rtol=1e-7)
    assert camera.pixel_area_mm2 == pytest.approx(6.7 * 5.6 / (2448 * 2048))
    small = paper(resolution=(4, 2))
    origins, directions = small.rays()
    assert directions.shape == origins.shape == (8, 3)
    first = np.array((-1.5 * 6.7 / 4, -0.5 * 5.6 / 2, 10.0))
    np.testing.assert_allclose(directions[0], first / np.linalg.norm(first), atol=1e-15)
    # Row by row: the second ray is one pixel to the right.
    np.testing.assert_allclose(small.project(directions[:2] * 7), ((0, 0), (1, 0)), atol=1e-12)


@given(POINT, st.floats(0, 2448), st.floats(0, 2048), st.floats(1, 1e4))
def test_rays_and_projection_are_inverse(
    origin: tuple[float, ...], x: float, y: float, distance: float
) -> None:
    if math.dist(origin, (1, 2, 3)) < 1e-3:
        return
    pose = look_at(origin, (1, 2, 3))
    for camera in (
        paper(matrix=pose, principal_point_px=(1200.0, 1111.0)),
        Camera(projection="orthographic", sensor_mm=(60, 50), resolution=(2448, 2048), matrix=pose),
    ):
        origins, directions = camera.rays([(x, y)])
        found = camera.project(origins + distance * directions)[0]
        np.testing.assert_allclose(found, (x, y), atol=1e-6)


def test_points_behind_the_camera_have_no_image() -> None:
    camera = paper(matrix=look_at((0, -100, 0), (0, 0, 0)))
    found = camera.project([(0, -101, 0), (0, -99, 0)])
    assert np.isnan(found[0]).all()
    np.testing.assert_allclose(found[1], (1223.5, 1023.5))


def test_orthographic_camera_sees_lengths() -> None:
    camera = Camera(
        projection="orthographic",
        sensor_mm=(60.0, 50.0),
        resolution=(600, 250),
        matrix=look_at((0, -100, 0), (0, 0, 0)),
    )
    np.testing.assert_allclose(
        camera.project([(1.0, 0.0, 0.0), (1.0, 77.0, -2.0)]), ((309.5, 124.5), (309.5, 134.5))
    )
    origins, directions = camera.rays()
    np.testing.assert_array_equal(directions, np.tile((0, 1, 0), (150_000, 1)))
    np.testing.assert_allclose(origins[0], (-29.95, -100, 24.9), atol=1e-12)
    assert camera.pixel_area_mm2 == pytest.approx(0.02)
    with pytest.raises(InputError, match="orthographic: it can be rendered where its scene has it"):
        camera.check_movable()


def test_scaled_camera_sees_the_same() -> None:
    camera = paper(principal_point_px=(1199.75, 999.5), focus_mm=(50, 250))
    half = camera.scaled(0.5)
    assert half.resolution == (1224, 1024)
    assert half.principal_point_px == (599.625, 499.5)
    assert (half.sensor_mm, half.focus_mm) == (camera.sensor_mm, camera.focus_mm)
    point = [(3.0, 4.0, 100.0)]
    np.testing.assert_allclose(
        2 * (half.project(point) + 0.5), camera.project(point) + 0.5, atol=1e-9
    )
    assert paper().scaled(1e-9).resolution == (1, 1)
    for scale in (0, -1, math.nan, math.inf):
        with pytest.raises(InputError, match=f"scale is {scale}"):
            paper().scaled(scale)
    with pytest.raises(InputError, match=r"over 2\^31 pixels a side; give a smaller one"):
        paper().scaled(1e9)


def test_dictionary_round_trip_through_json() -> None:
    """Every value comes back exactly; an unlimited focus is null, since JSON knows no infinity."""
    pose = look_at((150, -100, 120), (1, 2, 3))
    for camera in (
        paper(matrix=pose, principal_point_px=(1.5, 2.5), focus_mm=(50, 250)),
        paper(matrix=pose),
        Camera(projection="orthographic", sensor_mm=(60, 50), resolution=(6, 5), matrix=pose),
    ):
        text = json.dumps(camera.as_dict(), allow_nan=False)
        again = Camera.from_dict(json.loads(text))
        assert again.as_dict() == camera.as_dict()
        np.testing.assert_array_equal(again.matrix, camera.matrix)
        assert again.focus_mm == camera.focus_mm


@pytest.mark.parametrize(
    "changes",
    [
        {"focus_mm": None},
        {"focus_mm": "near"},
        {"sensor_mm": {"width": 1}},
        {"matrix": "none"},
        {"resolution": ["a", "b"]},
        {"focal_length_mm": "twenty"},
        {"distortion": {"k9": 1}},
        None,
    ],
)
def test_values_of_a_damaged_file_are_refused(changes: dict[str, Any] | None) -> None:
    with pytest.raises(InputError, match="missing or misspelt"):
        Camera.from_dict(changes and {**paper().as_dict(), **changes})


def test_at_moves_only_the_pose() -> None:
    camera = paper(focus_mm=(50, 250))
    moved = camera.at(look_at((1, 2, 3), (4, 5, 6)))
    np.testing.assert_array_equal(moved.origin, (1, 2, 3))
    assert {**moved.as_dict(), "matrix": None} == {**camera.as_dict(), "matrix": None}
    with pytest.raises(ValueError, match="read-only"):
        moved.matrix[0, 0] = 2


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"focal_length_mm": 0}, "Focal length is 0.0 mm"),
        ({"focal_length_mm": -1}, "Focal length is -1.0 mm"),
        ({"focal_length_mm": math.inf}, "Focal length is inf mm"),
        ({"sensor_mm": (0, 5)}, "Sensor size is 0.0 x 5.0 mm"),
        ({"sensor_mm": (6, math.nan)}, "Sensor size is 6.0 x nan mm"),
        ({"resolution": (0, 10)}, "Resolution is 0 x 10 pixels"),
        ({"focus_mm": (250, 50)}, "Focus interval 250.0 to 50.0 mm is empty"),
        ({"focus_mm": (-1, 50)}, "Focus interval -1.0 to 50.0 mm"),
        ({"focus_mm": (50, 50)}, "Focus interval 50.0 to 50.0 mm is empty"),
        ({"projection": "fisheye"}, "Unknown projection 'fisheye'"),
        ({"matrix": np.diag((1, 1, -1, 1))}, "not a rigid motion"),
        ({"matrix": np.diag((2, 2, 2, 1))}, "not a rigid motion"),
        ({"matrix": np.eye(3)}, "not a rigid motion"),
        ({"matrix": np.full((4, 4), np.nan)}, "not a rigid motion"),
    ],
)
def test_wrong_values_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        paper(**changes)


def test_a_cropped_camera_sees_the_same_points_in_its_window() -> None:
    pose = look_at((150.0, -100.0, 120.0), (0.0, 0.0, 0.0))
    camera = paper(resolution=(1224, 1024), principal_point_px=(600.0, 500.0), matrix=pose)
    window = camera.cropped(300, 200, 64, 48)
    points = [(1.0, 2.0, 3.0), (-20.0, 5.0, 0.0)]
    np.testing.assert_allclose(
        window.project(points), camera.project(points) - (300, 200), rtol=0, atol=1e-9
    )
