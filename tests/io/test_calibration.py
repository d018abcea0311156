"""Cameras of calibrations that OpenCV itself writes, and what is wrong with others."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.calibration import read_calibration
from validation.inputs.calibration_files import (
    COEFFICIENTS,
    MATRIX,
    RVEC,
    TVEC,
    plain,
    written_by_opencv,
)


@pytest.mark.parametrize("name", ["camera.yaml", "camera.yml", "camera.xml", "camera.json"])
def test_camera_of_opencvs_file_projects_as_opencv_does(tmp_path: Path, name: str) -> None:
    """The whole way from the file to pixels, with the pose; 1e-6 px are demanded."""
    path = written_by_opencv(tmp_path / name, rvec=RVEC, tvec=TVEC)
    calibration = read_calibration(path)
    camera = calibration.camera(pixel_size_mm=2.74e-3)
    assert camera.resolution == (2448, 2048)
    points = np.random.default_rng(1).uniform(-40, 40, (500, 3))
    expected, _ = cv2.projectPoints(points, RVEC, TVEC, MATRIX, COEFFICIENTS)
    expected = expected[:, 0]
    inside = ((expected > 0) & (expected < camera.resolution)).all(axis=1)
    assert inside.sum() > 300
    np.testing.assert_allclose(camera.project(points)[inside], expected[inside], rtol=0, atol=1e-8)
    # Back: rays through OpenCV's pixels meet the points.
    origins, directions = camera.rays(expected[inside])
    along = np.einsum("ij,ij->i", points[inside] - origins, directions)
    np.testing.assert_allclose(
        origins + along[:, None] * directions, points[inside], rtol=0, atol=1e-9
    )


def test_pixel_size_sets_lengths_but_no_ray(tmp_path: Path) -> None:
    """Pixels of 2.74 um: the lens is one, so their height is 2.74 um times fx / fy."""
    calibration = read_calibration(plain(tmp_path / "camera.json"))
    one, other = (
        calibration.camera(pixel_size_mm=size, matrix=np.eye(4)) for size in (2.74e-3, 0.1)
    )
    assert one.focal_length_mm == pytest.approx(3653.8 * 2.74e-3)
    assert one.pixel_pitch_mm == pytest.approx((2.74e-3, 2.74e-3 * 3653.8 / 3657.25))
    pixels = [(0.5, 0.5), (2000.5, 99.5)]
    np.testing.assert_allclose(one.rays(pixels)[1], other.rays(pixels)[1], rtol=0, atol=1e-15)
    for size in (0, 2.74, float("nan")):
        with pytest.raises(InputError, match=rf"Pixel size is {size} mm"):
            calibration.camera(pixel_size_mm=size)


def test_the_calibrations_pose_is_kept_or_said_to_be_missing(tmp_path: Path) -> None:
    placed = read_calibration(written_by_opencv(tmp_path / "placed.yaml", rvec=RVEC, tvec=TVEC))
    assert placed.matrix is not None
    own = placed.camera(pixel_size_mm=2.74e-3)
    np.testing.assert_array_equal(own.matrix, placed.matrix)
    given = placed.camera(pixel_size_mm=2.74e-3, matrix=np.eye(4))
    np.testing.assert_array_equal(given.matrix, np.eye(4))
    lens = read_calibration(plain(tmp_path / "camera.json"))
    with pytest.warns(IriftraceWarning, match=r"has no pose, so its camera is at"):
        np.testing.assert_array_equal(lens.camera(pixel_size_mm=2.74e-3).matrix, np.eye(4))


def test_poses(tmp_path: Path) -> None:
    """World to camera, as rotation vector or matrix, or one view; a translation may be in m."""
    rotation = cv2.Rodrigues(RVEC)[0]
    centre = -rotation.T @ TVEC
    for values in (
        {"rvec": RVEC, "tvec": TVEC},
        {"R": rotation, "T": TVEC},
        {"extrinsic_parameters": np.concatenate((RVEC, TVEC))[None]},
    ):
        path = written_by_opencv(tmp_path / "camera.yaml", **values)
        for unit in (1.0, 1000.0):
            matrix = read_calibration(path, length_mm=unit).matrix
            assert matrix is not None
            np.testing.assert_allclose(matrix[:3, :3], rotation.T, atol=1e-12)
            np.testing.assert_allclose(matrix[:3, 3], unit * centre, atol=1e-9 * unit)
    several = written_by_opencv(tmp_path / "camera.yaml", extrinsic_parameters=np.zeros((13, 6)))
    assert read_calibration(several).matrix is None
    assert read_calibration(several).views == 13


def test_more_coefficients_than_are_modelled(tmp_path: Path) -> None:
    """Thin prisms and tilt must be zero; eight coefficients are all that is left then."""
    zero = plain(tmp_path / "a.json", distortion_coefficients=[0.02] * 8 + [0.0] * 6)
    assert read_calibration(zero).distortion.coefficients == (0.02,) * 8
    prism = plain(tmp_path / "b.json", distortion_coefficients=[0.1] * 8 + [1e-3, 0, 0, 0])
    with pytest.raises(InputError, match="12 distortion coefficients with thin prism or tilt"):
        read_calibration(prism)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"camera_matrix": None}, "other names than .* write OpenCV's YAML: camera_matrix"),
        ({"camera_matrix": [1, 2, 3]}, "camera_matrix has 3 numbers instead of 9"),
        ({"camera_matrix": "large"}, "camera_matrix has entries that are not finite numbers"),
        ({"camera_matrix": {"rows": 3}}, "camera_matrix has entries that are not finite numbers"),
        ({"camera_matrix": [10**400] * 9}, "camera_matrix has entries that are not finite numbers"),
        ({"camera_matrix": [[9, 0, 1], [0, 9, 1], [0, 1, 1]]}, "is not a camera matrix"),
        ({"camera_matrix": [[-9, 0, 1], [0, 9, 1], [0, 0, 1]]}, "is not a camera matrix"),
        ({"camera_matrix": [[9, 0.1, 1], [0, 9, 1], [0, 0, 1]]}, "skew 0.1"),
        ({"distortion_coefficients": None}, r"distortion_coefficients is missing; add \[k1, k2"),
        ({"distortion_coefficients": [1, 2]}, "distortion of 2 coefficients"),
        ({"image_width": None}, "image_width is missing"),
        ({"image_height": 20.5}, "2448 x 20.5 px, but pixels are whole"),
        ({"image_height": 0}, "2448 x 0 px, but pixels are whole"),
        ({"image_width": None, "image_height": None}, "image_width and image_height are missing"),
        ({"distortion_model": "equidistant"}, "lens model 'equidistant'"),
        ({"distortion_model": "omni"}, "lens model 'omni'"),
        ({"distortion_model": "none"}, "lens model is 'none', but it has distortion coeff"),
        ({"fisheye_model": 1}, "lens model 'fisheye'"),
        ({"xi": [[1.2]]}, r"lens model 'omnidirectional \(xi\)'"),
        ({"rvec": [0, 0, 1], "R": [0, 0, 1], "tvec": [0, 0, 1]}, "rvec and R are names of one"),
        ({"rvec": [[1, 0, 0], [0, 1, 0], [0, 0, -1]], "tvec": [0, 0, 1]}, "stretches or mirrors"),
        ({"R": [[2, 0, 0], [0, 2, 0], [0, 0, 2]], "t": [0, 0, 1]}, "stretches or mirrors"),
        ({"rvec": [0, 0, 1]}, "only one of rvec and tvec"),
        ({"rvec": [114.3, 0, 0], "tvec": [0, 0, 1]}, "in degrees or no rotation vector"),
        ({"extrinsic_parameters": [[0, 90, 0, 0, 0, 1]]}, "in degrees or no rotation vector"),
        ({"distortion_model": "radtan", "distortion_coefficients": [0.1] * 5}, "file has 5"),
        ({"rvec": [0, 1], "tvec": [0, 0, 1]}, "rvec has 2 numbers instead of 3 or 9"),
    ],
)
def test_wrong_files_are_refused(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    path = plain(tmp_path / "camera.json", **changes)
    with pytest.raises(InputError, match=message) as caught:
        read_calibration(path)
    assert str(path) in str(caught.value)


def test_a_rounded_rotation_becomes_the_nearest_one(tmp_path: Path) -> None:
    """Four decimals are rounding, two are none; a rotation vector of degrees is refused."""
    exact = cv2.Rodrigues(RVEC)[0]
    path = plain(tmp_path / "c.json", R=exact.round(4).tolist(), T=[0, 0, 1])
    with pytest.warns(IriftraceWarning, match="rounded to few digits.*uncertain by about"):
        matrix = read_calibration(path).matrix
    assert matrix is not None
    np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(matrix[:3, :3], exact.T, rtol=0, atol=1e-4)
    path = plain(tmp_path / "c.json", R=exact.round(2).tolist(), T=[0, 0, 1])
    with pytest.raises(InputError, match=r"stretches or mirrors .lengths change"):
        read_calibration(path)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"camera_matrix": MATRIX.T.tolist()}, r"column by column \(transposed\)"),
        ({"camera_matrix": [[16, 0, 2], [0, 16, 1.8], [0, 0, 1]]}, "16 px for pictures 2448 px"),
        ({"camera_matrix": [[1.5, 0, 0.5], [0, 1.8, 0.5], [0, 0, 1]]}, "1.5 px for pictures 2448"),
        ({"image_width": 9, "image_height": 6}, "3654 px for pictures 9 px wide"),
        ({"camera_matrix": [[3653, 0, 9.5], [0, 3657, -7], [0, 0, 1]]}, "from their middle"),
        ({"image_width": 2048, "image_height": 2448}, "is the middle of pictures 2448 px wide"),
    ],
)
def test_matrices_of_other_units_or_orders(
    tmp_path: Path, changes: dict[str, Any], said: str
) -> None:
    """Transposed, in mm or widths, with the corners of a board, counted from the middle, turned."""
    with pytest.raises(InputError, match=said):
        read_calibration(plain(tmp_path / "a.json", **changes))


def test_a_matrix_of_another_resolution_is_noticed(tmp_path: Path) -> None:
    path = plain(tmp_path / "a.json", image_width=1224, image_height=1024)
    with pytest.warns(IriftraceWarning, match="outside the pictures of 1224 x 1024 px"):
        read_calibration(path)
    path = plain(tmp_path / "a.json", image_width=4896, image_height=4096)
    with pytest.warns(IriftraceWarning, match="the middle of pictures of about 2419 x 2060 px"):
        read_calibration(path)


@pytest.mark.parametrize(
    "model", ["plumb_bob", "Plumb Bob", "rational_polynomial", "radtan", "radial-tangential"]
)
def test_four_coefficients_are_those_of_a_named_lens_model(tmp_path: Path, model: str) -> None:
    four = COEFFICIENTS[:4].tolist()
    path = plain(tmp_path / "a.json", distortion_coefficients=four, distortion_model=model)
    assert read_calibration(path).distortion.coefficients[:4] == tuple(four)
    path = plain(tmp_path / "a.json", distortion_coefficients=four)
    with pytest.warns(IriftraceWarning, match="read as k1, k2, p1, p2. If they are .* fisheye"):
        assert read_calibration(path).distortion.coefficients[:4] == tuple(four)
    read_calibration(plain(tmp_path / "a.json", distortion_coefficients=four, fisheye_model=0))


def test_no_coefficients_of_no_model(tmp_path: Path) -> None:
    for zeros in ([0, 0, 0, 0], [], None):
        path = plain(tmp_path / "a.json", distortion_model="none", distortion_coefficients=zeros)
        assert not any(read_calibration(path).distortion.coefficients)


def test_a_rotation_vector_of_more_than_half_a_turn_is_warned_of(tmp_path: Path) -> None:
    path = plain(tmp_path / "a.json", rvec=[0.5, 4.5, 0.2], tvec=[0, 0, 500])
    with pytest.warns(IriftraceWarning, match="by more than half a turn, .* if it is in degrees"):
        read_calibration(path)
