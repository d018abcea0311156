"""Calibration files as OpenCV itself writes them, and what is wrong with others."""

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from iriftrace.camera.calibration import read_calibration
from iriftrace.core.errors import InputError, IriftraceWarning
from validation.inputs.calibration_files import (
    COEFFICIENTS,
    MATRIX,
    PLAIN,
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


def test_old_header_plain_lists_and_other_names(tmp_path: Path) -> None:
    """%YAML:1.0 (before OpenCV 5) is not YAML; ROS writes mappings without a tag."""
    new = written_by_opencv(tmp_path / "new.yaml").read_text()
    assert new.startswith("%YAML 1.2")
    files = {
        "old.yaml": new.replace("%YAML 1.2", "%YAML:1.0"),
        "ros.yaml": "image_width: 2448\nimage_height: 2048\ncamera_name: narrow\n"
        f"camera_matrix:\n  rows: 3\n  cols: 3\n  data: {MATRIX.ravel().tolist()}\n"
        "distortion_model: plumb_bob\n"
        f"distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: {COEFFICIENTS.tolist()}\n"
        "rectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n",
        "short.yaml": f"K: {MATRIX.tolist()}\nD: {COEFFICIENTS.tolist()}\nwidth: 2448\n"
        "height: 2048\n",
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
        found = read_calibration(tmp_path / name)
        assert found.focal_px == (3653.8, 3657.25)
        assert found.centre_px == (1209.5, 1030.0)
        assert found.distortion.coefficients == (*COEFFICIENTS, 0, 0, 0)
        assert found.matrix is None


def test_a_camera_info_message_has_no_pose(tmp_path: Path) -> None:
    """R of ROS is the rectification; ROS 2 writes small letters, and `echo` a line at the end."""
    unit = np.eye(3).ravel().tolist()
    for names in ("DKRP", "dkrp"):
        values = (COEFFICIENTS.tolist(), MATRIX.ravel().tolist(), unit, [1.0] * 12)
        lines = [f"{name}: {value}" for name, value in zip(names, values, strict=True)]
        lines += ["width: 2448", "height: 2048", "distortion_model: plumb_bob", "---"]
        (tmp_path / "info.yaml").write_text("\n".join(lines) + "\n")
        found = read_calibration(tmp_path / "info.yaml")
        assert found.focal_px == (3653.8, 3657.25)
        assert found.matrix is None


def test_names_of_opencv_2_4_without_blanks(tmp_path: Path) -> None:
    matrix = f"   rows:3\n   cols:3\n   dt:d\n   data:{MATRIX.ravel().tolist()}"
    coefficients = f"   rows:4\n   cols:1\n   dt:d\n   data:{COEFFICIENTS[:4].tolist()}"
    (tmp_path / "old.yml").write_text(
        '%YAML:1.0\ncalibration_Time:"Mon 12:30"\nimage_Width:2448\nimage_Height:2048\n'
        f"Camera_Matrix:!!opencv-matrix\n{matrix}\n"
        f"Distortion_Coefficients:!!opencv-matrix\n{coefficients}\n"
    )
    with pytest.warns(IriftraceWarning, match="read as k1, k2, p1, p2. If they are .* fisheye"):
        found = read_calibration(tmp_path / "old.yml")
    assert found.resolution == (2448, 2048)
    assert found.distortion.coefficients[:4] == tuple(COEFFICIENTS[:4])


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
        ({"camera_matrix": None}, "camera_matrix is missing"),
        ({"camera_matrix": [1, 2, 3]}, "camera_matrix has 3 numbers instead of 9"),
        ({"camera_matrix": "large"}, "camera_matrix has entries that are not finite numbers"),
        ({"camera_matrix": {"rows": 3}}, "camera_matrix has the entries rows instead of numbers"),
        ({"camera_matrix": [[9, 0, 1], [0, 9, 1], [0, 1, 1]]}, "is not a camera matrix"),
        ({"camera_matrix": [[-9, 0, 1], [0, 9, 1], [0, 0, 1]]}, "is not a camera matrix"),
        ({"camera_matrix": [[9, 0.1, 1], [0, 9, 1], [0, 0, 1]]}, "skew 0.1"),
        ({"distortion_coefficients": None}, "write distortion_coefficients"),
        ({"distortion_coefficients": [1, 2]}, "distortion of 2 coefficients"),
        ({"image_width": None}, "image_width is missing"),
        ({"image_height": 20.5}, "image_height is 20.5"),
        ({"image_height": 0}, "image_height is 0"),
        ({"distortion_model": "equidistant"}, "lens model 'equidistant'"),
        ({"fisheye_model": 1}, "fisheye model, which is not modelled"),
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


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "neither YAML, XML nor JSON"),
        ("a: [1, 2", "neither YAML, XML nor JSON"),
        ("a: !!python/object/apply:os.getcwd []", "neither YAML, XML nor JSON"),
        ("just words", "holds no named values"),
        ("<?xml version='1.0'?><opencv_storage/>", "camera_matrix is missing"),
        ("<?xml version='1.0'?><calibration><f>3650</f></calibration>", "and not OpenCV's <opencv"),
        ("<?xml version='1.0'?><opencv_storage>", "neither YAML, XML nor JSON"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><opencv_storage/>", "entities, which no calibration"),
        ("a: 1\n---\na: 2\n", "2 documents instead of one"),
        ("", "holds no named values"),
        # As OpenCV's stereo example writes it.
        ("M1: [1]\nD1: [0]\nM2: [1]\nD2: [0]", r"two cameras .M2.; read it with .*--stereo-cal"),
        (" " * 5_000_000, "more than any camera needs"),
    ],
    ids=lambda value: value[:20],
)
def test_files_that_are_something_else(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "camera.yaml").write_text(text)
    with pytest.raises(InputError, match=message):
        read_calibration(tmp_path / "camera.yaml")
    with pytest.raises(InputError, match="cannot read the calibration"):
        read_calibration(tmp_path / "gone.yaml")
    (tmp_path / "camera.yaml").write_bytes(b"\x80\x00")
    with pytest.raises(InputError, match="is a binary file; give YAML"):
        read_calibration(tmp_path / "camera.yaml")


def test_aliases_are_read_unless_they_stand_for_too_much(tmp_path: Path) -> None:
    """PyYAML writes lists that occur twice as aliases; ten lines may be ten billion numbers."""
    values = PLAIN | {"also": PLAIN["distortion_coefficients"]}
    (tmp_path / "twice.yaml").write_text(text := yaml.safe_dump(values))
    assert "*id001" in text
    found = read_calibration(tmp_path / "twice.yaml")
    assert found.distortion.coefficients == (*COEFFICIENTS, 0, 0, 0)
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]" for k in range(1, 10)]
    for text, fault in (
        ("\n".join([*lines, "camera_matrix: *a9"]), "aliases stand for more than 4,000,000"),
        ("camera_matrix: &a [1, *a]", "alias to a value that contains the alias"),
    ):
        (tmp_path / "bomb.yaml").write_text(text)
        with pytest.raises(InputError, match=fault):
            read_calibration(tmp_path / "bomb.yaml")


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
    "changes",
    [
        *({name: COEFFICIENTS.tolist()} for name in ("distCoef", "dist_coeff", "Distortion", "D")),
        {"kc": COEFFICIENTS.tolist(), "fisheye_model": 0},
        {"D": COEFFICIENTS[:4].tolist(), "distortion_model": "radtan"},
        {"D": COEFFICIENTS[:4].tolist(), "distortion_model": "radial-tangential"},
    ],
)
def test_other_names_of_the_distortion_and_its_model(
    tmp_path: Path, changes: dict[str, Any]
) -> None:
    path = plain(tmp_path / "c.json", **{"distortion_coefficients": None, **changes})
    assert read_calibration(path).distortion.coefficients[:4] == tuple(COEFFICIENTS[:4])


def test_no_zeros_are_advised_where_the_distortion_has_another_name(tmp_path: Path) -> None:
    path = plain(tmp_path / "c.json", distortion_coefficients=None, lens_distortion=[0.1], k1=0.1)
    with pytest.raises(InputError, match="lens_distortion, k1") as caught:
        read_calibration(path)
    assert "0, 0" not in str(caught.value)


def test_a_camera_of_matlab(tmp_path: Path) -> None:
    """Rows times matrices, rows before columns, and the first pixel's centre at (1, 1)."""
    k1, k2, p1, p2, k3 = COEFFICIENTS.tolist()
    of_matlab = MATRIX + np.outer((1.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    for names in ({"IntrinsicMatrix": of_matlab.T.tolist()}, {"K": of_matlab.tolist()}):
        values = {"RadialDistortion": [k1, k2, k3], "TangentialDistortion": [p1, p2]}
        path = tmp_path / "camera.json"
        path.write_text(json.dumps(values | names | {"ImageSize": [2048, 2448]}))
        found = read_calibration(path)
        assert found.focal_px == (3653.8, 3657.25)
        assert found.centre_px == (1209.5, 1030.0)
        assert found.resolution == (2448, 2048)
        assert found.distortion.coefficients == (*COEFFICIENTS, 0, 0, 0)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_camera_of_single_numbers(tmp_path: Path, encoding: str) -> None:
    """fx, fy, cx, cy, k1 ... as RealSense and COLMAP users write them; also by PowerShell."""
    names = dict(zip(("k1", "k2", "p1", "p2", "k3"), COEFFICIENTS.tolist(), strict=True))
    values = {"fx": 3653.8, "fy": 3657.25, "cx": 1208.5, "cy": 1029.0, **names}
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(values | {"width": 2448, "height": 2048}), encoding=encoding)
    found = read_calibration(path)
    assert (found.focal_px, found.centre_px) == ((3653.8, 3657.25), (1208.5, 1029.0))
    assert found.distortion.coefficients == (*COEFFICIENTS, 0, 0, 0)
    path.write_text(json.dumps({"fx": 3653.8, "k1": 0.1, "width": 2448, "height": 2048}))
    with pytest.raises(InputError, match="camera_matrix is missing"):
        read_calibration(path)
