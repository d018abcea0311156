"""Calibrations that state another direction, another camera or a missing number."""

import gzip
import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from iriftrace.camera.calibration import read_calibration
from iriftrace.camera.stereo import read_stereo_calibration
from iriftrace.core.errors import InputError, IriftraceWarning
from validation.inputs import stereo_files as rig
from validation.inputs.calibration_files import plain

POSE = {"R": np.eye(3).tolist(), "T": [0.0, 0.0, 500.0]}
PAIR = {"R": rig.ROTATION.tolist(), "T": rig.TRANSLATION.tolist()}


@pytest.mark.parametrize(
    "said", ["camera to world", "T_wc", "c2w", "camera -> board", "camera's pose in world"]
)
def test_a_pose_that_says_to_lead_from_the_camera_is_refused(tmp_path: Path, said: str) -> None:
    path = plain(tmp_path / "a.json", **POSE, note=said)
    with pytest.raises(InputError, match=f"says {said!r}, but its pose is read as leading from"):
        read_calibration(path)
    assert read_calibration(plain(tmp_path / "a.json", note=said)).matrix is None
    path = plain(tmp_path / "a.json", **POSE, note="world to camera, T_cw")
    np.testing.assert_allclose(read_calibration(path).matrix[:3, 3], (0.0, 0.0, -500.0))


@pytest.mark.parametrize("name", ["T_wc", "R_c2w", "transform_matrix", "quaternion", "rvecs"])
def test_further_poses_that_are_not_read_are_named(tmp_path: Path, name: str) -> None:
    path = plain(tmp_path / "a.json", **{name: np.eye(4).tolist()})
    with pytest.warns(IriftraceWarning, match=f"{name}, which is not read as the camera's pose"):
        assert read_calibration(path).matrix is None


@pytest.mark.parametrize(
    "said", ["from camera 2 to camera 1", "right to left", "cam1_to_cam0", "right camera -> left"]
)
def test_a_pair_that_says_to_lead_back_is_refused(tmp_path: Path, said: str) -> None:
    path = rig.opencv(tmp_path / "a.yaml")
    text = path.read_text()
    path.write_text(f"{text}# {said}\n")
    with pytest.raises(InputError, match="read as leading from camera 1 to camera 2; invert"):
        read_stereo_calibration(path)
    path.write_text(f"{text}# camera 1 to camera 2, left to right, at a ratio of 2 to 1\n")
    assert read_stereo_calibration(path).baseline_mm > 200.0


@pytest.mark.parametrize("name", ["{}_12", "{}_lr", "{}21"])
def test_names_of_a_motion_whose_direction_differs_are_not_read(tmp_path: Path, name: str) -> None:
    path = rig.opencv(tmp_path / "a.yaml")
    motion = {name.format(key): value for key, value in PAIR.items()}
    lenses = path.read_text().split("R:")[0]
    path.write_text(f"{lenses}\n{yaml.safe_dump(motion)}")
    with pytest.raises(InputError, match=r"x2 = R x1 \+ T, since .* may lead back"):
        read_stereo_calibration(path)


def test_two_spellings_of_a_size_have_the_same_number(tmp_path: Path) -> None:
    width = json.loads(plain(tmp_path / "a.json").read_text())["image_width"]
    assert read_calibration(plain(tmp_path / "a.json", Image_Width=width)).resolution[0] == width
    with pytest.raises(InputError, match="image_width and Image_Width are different"):
        read_calibration(plain(tmp_path / "a.json", Image_Width=width // 2))
    path = rig.opencv(tmp_path / "a.yaml")
    path.write_text(f"{path.read_text()}\nimage_width2: 640\n")
    with pytest.raises(InputError, match="camera 2: image_width and imagewidth are different"):
        read_stereo_calibration(path)


@pytest.mark.parametrize("name", ["xi", "shear"])
def test_numbers_of_other_cameras_are_refused(tmp_path: Path, name: str) -> None:
    """xi of cv2.omnidir, also as a matrix of one number, of one or of two cameras."""
    for value in (1.2, [[1.2]]):
        with pytest.raises(InputError, match=r"has the (xi|skew) 1\.2, which is not modelled"):
            read_calibration(plain(tmp_path / "a.json", **{name: value}))
    path = rig.opencv(tmp_path / "a.yaml")
    path.write_text(f"{path.read_text()}\n{name}2: 1.2\n")
    with pytest.raises(InputError, match=r"camera 2: the camera matrix has the (xi|skew) 1\.2"):
        read_stereo_calibration(path)


@pytest.mark.parametrize("name", ["distortion_coefficients", "tvec"])
def test_a_missing_number_is_refused(tmp_path: Path, name: str) -> None:
    values = {"rvec": [0.0, 0.0, 0.0], "tvec": [0.0, 0.0, 500.0]}
    values[name] = [0.0, 0.0, -9999.0]
    with pytest.raises(InputError, match=f"{name} has entries that are not finite .* or -9999"):
        read_calibration(plain(tmp_path / "a.json", **values))


def test_a_packed_calibration_is_named(tmp_path: Path) -> None:
    """OpenCV's FileStorage writes calibration.yml.gz, too."""
    path = tmp_path / "a.yml.gz"
    path.write_bytes(gzip.compress(plain(tmp_path / "a.json").read_bytes()))
    with pytest.raises(InputError, match=r"is a binary file; .* \(unpacked, if it is packed\)"):
        read_calibration(path)


def test_a_fault_of_one_of_two_files_names_the_file(tmp_path: Path) -> None:
    lens = {"fx": 3653.0, "fy": 3657.0, "cx": 650.0, "cy": 498.0, "k1": -0.1, "k2": 0.1, "b1": 1.0}
    paths = [tmp_path / name for name in ("left.yaml", "right.yaml")]
    for path in paths:
        path.write_text(yaml.safe_dump(lens))
    with pytest.raises(InputError, match=r"left\.yaml: it has b1"):
        read_stereo_calibration(*paths)


@pytest.mark.parametrize("kind", ["division", "inverse", "telecentric", "line-scan", "fisheye"])
def test_a_lens_model_next_to_the_coefficients_is_read(tmp_path: Path, kind: str) -> None:
    for lens in ({"distortion": {"type": kind, "k1": -0.1, "p1": 0.0}}, {"camera_type": kind}):
        path = plain(tmp_path / "a.json", **lens)
        values = json.loads(path.read_text())
        if "distortion" in lens:
            del values["distortion_coefficients"]
        path.write_text(json.dumps(values))
        with pytest.raises(InputError, match=f"'{kind}' is another lens model"):
            read_calibration(path)


@pytest.mark.parametrize("model", ["Plumb Bob", "Brown-Conrady", "radial tangential"])
def test_blanks_and_hyphens_in_names_of_models_do_not_count(tmp_path: Path, model: str) -> None:
    four = [-0.1, 0.1, 0.001, 0.001]
    path = plain(tmp_path / "a.json", distortion_model=model, distortion_coefficients=four)
    assert read_calibration(path).distortion.coefficients[:4] == tuple(four)


def test_coefficients_of_no_model_are_refused(tmp_path: Path) -> None:
    path = plain(tmp_path / "a.json", distortion_model="none")
    with pytest.raises(InputError, match="lens model is 'none', but it has distortion coeff"):
        read_calibration(path)
    path = plain(tmp_path / "a.json", distortion_model="none", distortion_coefficients=[0, 0, 0, 0])
    assert not any(read_calibration(path).distortion.coefficients)


def test_a_pose_that_was_added_to_matlabs_parameters_is_read(tmp_path: Path) -> None:
    """R and T as OpenCV's, in the unit that MATLAB states."""
    content = {
        "FocalLength": [3650.0, 3651.0],
        "PrincipalPoint": [1224.5, 1024.5],
        "ImageSize": [2048, 2448],
        "RadialDistortion": [-0.08, 0.11],
        "TangentialDistortion": [0.0004, -0.0002],
        "WorldUnits": "meters",
    }
    (tmp_path / "a.json").write_text(json.dumps({**content, **POSE, "T": [0.0, 0.0, 0.5]}))
    found = read_calibration(tmp_path / "a.json").matrix
    np.testing.assert_allclose(found[:3, 3], (0.0, 0.0, -500.0))


@pytest.mark.parametrize("name", ["T_unit", "unit_tvec", "translation_units", "pose_unit"])
def test_names_of_the_unit(tmp_path: Path, name: str) -> None:
    """Next to a unit of pixels, and in the mapping of R and T."""
    unit = {"units": "px", name: "cm"}
    found = read_calibration(plain(tmp_path / "a.json", **POSE, **unit)).matrix
    np.testing.assert_allclose(found[:3, 3], (0.0, 0.0, -5000.0))
    path = rig.opencv(tmp_path / "a.yaml")
    lenses = path.read_text().split("R:")[0]
    path.write_text(f"{lenses}\n{yaml.safe_dump({'extrinsics': {**PAIR, **unit}})}")
    found = read_stereo_calibration(path).translation_mm
    np.testing.assert_allclose(found, 10.0 * rig.TRANSLATION)
