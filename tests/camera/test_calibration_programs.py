"""Calibrations of other programs: COLMAP's and librealsense's are read, others named."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from iriftrace.camera.calibration import Calibration, read_calibration
from iriftrace.core.errors import InputError, IriftraceWarning

LENS = (-0.25, 0.1, 1e-3, -2e-3)
MATRIX = [[3653.0, 0.0, 650.0], [0.0, 3657.0, 498.0], [0.0, 0.0, 1.0]]


def read(folder: Path, text: str, name: str = "camera.txt") -> Calibration:
    (folder / name).write_text(text)
    return read_calibration(folder / name)


def test_colmaps_pixels_have_their_corner_at_zero(tmp_path: Path) -> None:
    """COLMAP's own formula, u = fx x'' + cx, with the first pixel's centre at 0.5."""
    words = " ".join(map(str, LENS))
    found = read(tmp_path, f"# Camera list\n1 OPENCV 1280 1024 3653 3657 650 498 {words}\n")
    camera = found.camera(pixel_size_mm=3.45e-3, matrix=np.eye(4))
    points = np.random.default_rng(1).uniform((-50, -40, 500), (50, 40, 600), (50, 3))
    x, y = points[:, :2].T / points[:, 2]
    k1, k2, p1, p2 = LENS
    square = x * x + y * y
    radial = 1 + k1 * square + k2 * square**2
    u = 3653 * (x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x)) + 650
    v = 3657 * (y * radial + 2 * p2 * x * y + p1 * (square + 2 * y * y)) + 498
    assert_allclose(camera.project(points), np.column_stack((u, v)) - 0.5, atol=1e-8)


def test_models_of_colmap_with_one_focal_length(tmp_path: Path) -> None:
    plain = read(tmp_path, "1 SIMPLE_PINHOLE 1280 1024 3653 650.5 498.5\n")
    assert (plain.focal_px, plain.centre_px) == ((3653.0, 3653.0), (650.0, 498.0))
    assert not any(plain.distortion.coefficients)
    assert read(tmp_path, "1 RADIAL 9 9 9 4 4 0.1 0.2\n").distortion.coefficients[:2] == (0.1, 0.2)


def test_librealsenses_intrinsics(tmp_path: Path) -> None:
    values = {"width": 1280, "height": 1024, "fx": 3653, "fy": 3657, "ppx": 650, "ppy": 498}
    text = json.dumps({**values, "model": "Brown Conrady", "coeffs": [*LENS, 0.03]})
    found = read(tmp_path, text, "intrinsics.json")
    assert found.centre_px == (650.0, 498.0)
    assert found.distortion.coefficients[:5] == (*LENS, 0.03)
    inverse = {**values, "model": "distortion.inverse_brown_conrady", "coeffs": [0.1] * 5}
    with pytest.raises(InputError, match="'inverse_brown_conrady' is not the one of Brown"):
        read(tmp_path, json.dumps(inverse), "inverse.json")


def test_librealsenses_extrinsics_are_not_read_row_by_row(tmp_path: Path) -> None:
    """Named in every layout; as the refusal says how to write it, the pose is read.

    A camera at (-55, -382.694, 173.046) mm that looks at the part, turned about x.
    """
    lens = {"width": 1280, "height": 1024, "fx": 3653, "fy": 3657, "ppx": 650, "ppy": 498}
    lens |= {"model": "Brown Conrady", "coeffs": [0.0] * 5}
    down, ahead = -0.412014352, -0.911177356
    by_rows = [[1.0, 0.0, 0.0], [0.0, down, ahead], [0.0, -ahead, down]]
    pose = {"rotation": np.transpose(by_rows).ravel().tolist(), "translation": [0.055, 0.0, 0.42]}
    listed = (
        ' Intrinsic of "Color" / 1280x1024\n  Width: \t1280\n  PPX: \t650\n\n'
        ' Extrinsic from "Depth" To "Color" :\n Rotation Matrix:\n   1 0 0\n'
    )
    flat, nested = {**lens, **pose}, {"intrinsics": lens, "extrinsics": pose}
    for text in (json.dumps(flat), json.dumps({**pose, **lens}), json.dumps(nested), listed):
        with pytest.raises(InputError, match=r"RealSense .* column by column .* in metres"):
            read(tmp_path, text)
    right = {**lens, "R": by_rows, "T": pose["translation"], "length_unit": "m"}
    matrix = read(tmp_path, json.dumps(right)).matrix
    assert matrix is not None
    assert_allclose(matrix[:3, 3], (-55.0, -382.694, 173.046), atol=1e-3)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1 PINHOLE 9 9 9 9 4 4\n2 PINHOLE 9 9 9 9 4 4\n", "lists 2 cameras of COLMAP"),
        ("1 OPENCV_FISHEYE 9 9 9 9 4 4 0 0 0 0\n", "'opencv_fisheye' is not the one of Brown"),
        ("1 PINHOLE 9 9 9 9\n", "4 numbers for the camera model PINHOLE instead of 6"),
        ("# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ\n", "of COLMAP and lists images"),
        ("<calibration><projection>frame</projection></calibration>", "of Agisoft Metashape"),
        ('{"Calibration": {"cameras": [{"ptr_wrapper": {}}]}}', "of calib.io's Calibrator"),
        ("fc = [ 3653 ; 3657 ];", "of Bouguet's toolbox"),
        ("MATLAB 5.0 MAT-file\0\0", "is a binary file"),
    ],
)
def test_what_is_not_read_is_named(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read(tmp_path, text)


def test_zivids_intrinsics(tmp_path: Path) -> None:
    """As its SDK saves them, without the resolution, which is added as the refusal says."""
    text = (
        "__version__:\n  serializer: 1\n  data: 1\n"
        "CameraIntrinsics:\n"
        "  CameraMatrix:\n    CX: 650\n    CY: 498\n    FX: 3653\n    FY: 3657\n"
        "  Distortion:\n    K1: -0.25\n    K2: 0.1\n    K3: 0.03\n    P1: 0.001\n    P2: -0.002\n"
    )
    with pytest.raises(InputError, match="image_width and image_height are missing"):
        read(tmp_path, text)
    found = read(tmp_path, f"{text}image_width: 1280\nimage_height: 1024\n")
    assert (found.focal_px, found.centre_px) == ((3653.0, 3657.0), (650.0, 498.0))
    assert found.distortion.coefficients[:5] == (*LENS, 0.03)


def plain(**changes: Any) -> str:
    values = {"K": MATRIX, "D": [*LENS, 0.0], "width": 1280, "height": 1024}
    return json.dumps({**values, **changes})


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"K": np.transpose(MATRIX).tolist()}, r"column by column \(transposed\)"),
        ({"K": [[16, 0, 2.2], [0, 16, 1.8], [0, 0, 1]]}, "16 px for pictures 1280 px wide"),
        ({"K": [[2.8, 0, 0.5], [0, 3.5, 0.5], [0, 0, 1]]}, "2.8 px for pictures 1280 px wide"),
        ({"width": 9, "height": 6}, "3653 px for pictures 9 px wide"),  # corners of a board
        ({"K": [[3653, 0, 9.5], [0, 3657, -7], [0, 0, 1]]}, "counted from their middle"),
        ({"width": 1024, "height": 1280}, "is the middle of pictures 1280 px wide"),
    ],
)
def test_matrices_of_other_units_or_orders(
    tmp_path: Path, changes: dict[str, Any], said: str
) -> None:
    with pytest.raises(InputError, match=said):
        read(tmp_path, plain(**changes))


def test_a_matrix_of_another_resolution_is_noticed(tmp_path: Path) -> None:
    with pytest.warns(IriftraceWarning, match="outside the pictures of 640 x 512 px"):
        read(tmp_path, plain(width=640, height=512))
    with pytest.warns(IriftraceWarning, match="the middle of pictures of about 1300 x 996 px"):
        read(tmp_path, plain(width=2560, height=2048))
