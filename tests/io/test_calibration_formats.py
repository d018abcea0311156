"""Formats of calibrations by a file of each; what is of none of them is refused."""

import gzip
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from iriftrace.camera.calibration import Calibration, StereoCalibration
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.calibration import read_calibration, read_stereo_calibration
from iriftrace.io.calibration_formats import FORMATS
from validation.inputs import stereo_files as rig
from validation.inputs.calibration_files import COEFFICIENTS, MATRIX, plain

DATA = Path(__file__).parents[1] / "data" / "calibrations"
SINGLE = ["opencv_camera.yml", "opencv_camera.xml", "opencv_camera.json", "opencv_2.4_camera.yml"]
SINGLE += ["ros_left.yaml", "ros_camera_info_left.yaml", "matlab_intrinsics.json"]
PAIRS = {
    ("ros_left.yaml", "ros_right.yaml"): "m",
    ("ros_camera_info_left.yaml", "ros_camera_info_right.yaml"): "m",
    ("kalibr_camchain.yaml",): "m",
    ("matlab_stereo.json",): "cm",
    ("matlab_r2022b_stereo.json",): "cm",
}


def assert_lens(found: Calibration, number: int, coefficients: np.ndarray) -> None:
    matrix = rig.MATRICES[number]
    assert_allclose(found.focal_px, (matrix[0, 0], matrix[1, 1]), rtol=1e-15)
    assert_allclose(found.centre_px, matrix[:2, 2], rtol=1e-15)
    assert found.resolution == rig.SIZE
    assert found.distortion.coefficients == (*coefficients, 0, 0, 0)
    assert found.matrix is None


def assert_rig(found: StereoCalibration, lenses: tuple[np.ndarray, ...]) -> None:
    assert_allclose(found.rotation, rig.ROTATION, rtol=0, atol=1e-12)
    assert_allclose(found.translation_mm, rig.TRANSLATION, rtol=0, atol=1e-9)
    for number, camera in enumerate((found.first, found.second)):
        assert_lens(camera, number, lenses[number])


@pytest.mark.parametrize("name", SINGLE)
def test_one_camera(name: str) -> None:
    found = read_calibration(DATA / name)
    assert_lens(found, 0, rig.COEFFICIENTS[0])
    assert found.views == (2 if name.startswith("opencv_camera") else 0)


@pytest.mark.parametrize(("names", "unit"), PAIRS.items())
def test_two_cameras(names: tuple[str, ...], unit: str) -> None:
    """The first of Kalibr's lens models has four coefficients."""
    found = read_stereo_calibration(*(DATA / name for name in names))
    assert_rig(found, rig.FOUR if "kalibr" in names[0] else rig.COEFFICIENTS)
    assert found.length_unit == unit


def test_intrinsics_and_extrinsics_of_opencv(tmp_path: Path) -> None:
    """R and T next to the R1, R2, P1 and P2 of the pair; the size of the pictures is added."""
    outer = DATA / "opencv_extrinsics.yml"
    text = (DATA / "opencv_intrinsics.yml").read_text()
    (tmp_path / "intrinsics.yml").write_text(text)
    with pytest.raises(InputError, match="image_width and image_height are missing"):
        read_stereo_calibration(tmp_path / "intrinsics.yml", outer)
    (tmp_path / "intrinsics.yml").write_text(f"{text}image_width: 1280\nimage_height: 1024\n")
    assert_rig(read_stereo_calibration(tmp_path / "intrinsics.yml", outer), rig.COEFFICIENTS)


def test_each_file_has_a_source_and_each_format_a_file() -> None:
    files = {path.name for path in DATA.iterdir()} - {"README.md"}
    assert all(f"`{name}`" in (DATA / "README.md").read_text() for name in files)
    read = {*SINGLE, *(name for names in PAIRS for name in names)}
    assert files == read | {"opencv_intrinsics.yml", "opencv_extrinsics.yml"}
    assert {name.split("_")[0] for name in read} == {one.name.casefold() for one in FORMATS}


def test_a_chain_of_one_camera(tmp_path: Path) -> None:
    chain = rig.kalibr(tmp_path / "a.yaml").read_text()
    (tmp_path / "b.yaml").write_text(chain.split("cam1:")[0])
    assert_lens(read_calibration(tmp_path / "b.yaml"), 0, rig.FOUR[0])
    with pytest.raises(InputError, match="is of two cameras"):
        read_calibration(tmp_path / "a.yaml")
    (tmp_path / "c.yaml").write_text(f"{chain}cam2: {chain.split('cam1:')[0].split(':', 1)[1]}")
    with pytest.raises(InputError, match="more than two cameras"):
        read_stereo_calibration(tmp_path / "c.yaml")


def test_matlabs_struct_of_all_properties(tmp_path: Path) -> None:
    """Older versions state the focal lengths next to the matrix; a skew is refused."""
    values = json.loads((DATA / "matlab_stereo.json").read_text())["CameraParameters1"]
    more = {"FocalLength": [3653.8, 3657.25], "PrincipalPoint": [651.5, 499.0], "Skew": 0}
    path = tmp_path / "a.json"
    path.write_text(json.dumps(values | more | {"RotationVectors": [[0.1, 0.2, 0.3]]}))
    assert_lens(read_calibration(path), 0, rig.COEFFICIENTS[0])
    path.write_text(json.dumps(values | more | {"Skew": 2.0}))
    with pytest.raises(InputError, match="skew 2"):
        read_calibration(path)


REALSENSE = {"width": 1280, "height": 1024, "ppx": 650, "ppy": 498, "fx": 3653, "fy": 3657}
EXTRINSICS = {"rotation": np.eye(3).ravel().tolist(), "translation": [0.055, 0.0, 0.42]}
LISTED = (
    ' Intrinsic of "Color" / 1280x1024\n  Width: \t1280\n  PPX: \t650\n\n'
    ' Extrinsic from "Depth" To "Color" :\n Rotation Matrix:\n   1 0 0\n'
)
ZIVID = "CameraIntrinsics:\n  CameraMatrix:\n    CX: 650\n    CY: 498\n    FX: 3653\n    FY: 3657\n"


@pytest.mark.parametrize(
    ("text", "program"),
    [
        (json.dumps(REALSENSE), "RealSense"),
        (json.dumps({**REALSENSE, **EXTRINSICS}), "RealSense .*column by column.* in m"),
        (json.dumps({"intrinsics": REALSENSE, "extrinsics": EXTRINSICS}), "RealSense"),
        (LISTED, "RealSense"),
        ("# Camera list\n1 OPENCV 1280 1024 3653 3657 650 498 0.1 0.1 0 0\n", "COLMAP"),
        ("# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ\n", "COLMAP"),
        (ZIVID, "Zivid"),
        ("[LEFT_CAM_HD]\nfx=700\n", "ZED"),
        ("Focus:foc: 0.012;\n", "HALCON"),
        ("fc = [ 3653 ; 3657 ];", "Bouguet"),
        ("<calibration><projection>frame</projection></calibration>", "Metashape"),
    ],
)
def test_other_programs_are_named_with_what_to_write(
    tmp_path: Path, text: str, program: str
) -> None:
    (tmp_path / "a.txt").write_text(text)
    for read in (read_calibration, read_stereo_calibration):
        with pytest.raises(
            InputError, match=f"format of .*{program}.* write OpenCV's YAML: camera_m"
        ):
            read(tmp_path / "a.txt")


def test_a_pose_of_realsense_written_as_the_refusal_says(tmp_path: Path) -> None:
    """A camera at (-55, -382.694, 173.046) mm that looks at the part, turned about x."""
    down, ahead = -0.412014352, -0.911177356
    by_rows = [[1.0, 0.0, 0.0], [0.0, down, ahead], [0.0, -ahead, down]]
    pose = {"R": by_rows, "T": [0.055, 0.0, 0.42], "length_unit": "m"}
    matrix = read_calibration(plain(tmp_path / "a.json", **pose)).matrix
    assert matrix is not None
    assert_allclose(matrix[:3, 3], (-55.0, -382.694, 173.046), atol=1e-3)


def without(*names: str, **more: Any) -> Callable[[Path], Path]:
    """OpenCV's names as lists, some of them removed."""
    return lambda folder: plain(folder / "a.json", **dict.fromkeys(names), **more)


@pytest.mark.parametrize(
    "write",
    [
        without("camera_matrix"),
        without("camera_matrix", K=MATRIX.tolist(), R=np.eye(3).tolist(), T=[0, 0, 1]),
        without("camera_matrix", mtx=MATRIX.tolist(), dist=COEFFICIENTS.tolist()),
        without("camera_matrix", fx=3653.0, fy=3657.0, cx=1209.0, cy=1030.0),
        without("camera_matrix", camera={"camera_matrix": MATRIX.tolist()}),
        without("camera_matrix", cameras=[{"camera_matrix": MATRIX.tolist()}]),
    ],
)
def test_names_of_no_format_are_refused_with_what_there_is(
    tmp_path: Path, write: Callable[[Path], Path]
) -> None:
    path = write(tmp_path)
    with pytest.raises(InputError) as caught:
        read_calibration(path)
    message = str(caught.value)
    assert all(name in message for name in json.loads(path.read_text()))
    assert "write OpenCV's YAML: camera_matrix" in message


@pytest.mark.parametrize("name", ["K1", "cameraMatrixLeft", "mtxL", "cam_K"])
def test_names_of_two_cameras_of_no_format_are_refused(tmp_path: Path, name: str) -> None:
    path = rig.opencv(tmp_path / "a.json")
    path.write_text(path.read_text().replace("M1", name))
    with pytest.raises(InputError, match=f"its names are .*{name}.* M1, D1, M2 and D2"):
        read_stereo_calibration(path)


@pytest.mark.parametrize(
    ("name", "other", "value"),
    [
        ("camera_matrix", "cameraMatrix", MATRIX.tolist()),
        ("image_width", "Image_Width", 2448),
        ("distortion_coefficients", "distCoeffs", COEFFICIENTS.tolist()),
    ],
)
def test_a_value_has_one_name(tmp_path: Path, name: str, other: str, value: object) -> None:
    path = plain(tmp_path / "a.json", **{other: value})
    with pytest.raises(InputError, match=f"{name} and {other} are names of one value"):
        read_calibration(path)


@pytest.mark.parametrize("name", ["K", "k", "size"])
def test_names_of_other_things_count_for_nothing(tmp_path: Path, name: str) -> None:
    """A coefficient of something else, or the size of a board."""
    found = read_calibration(plain(tmp_path / "a.json", **{name: [11, 8]}))
    assert (found.focal_px, found.resolution) == ((3653.8, 3657.25), (2448, 2048))


@pytest.mark.parametrize(
    "name",
    ["extrinsics", "camera_pose", "T_wc", "R_c2w", "transform_matrix", "quaternion", "rvecs"],
)
def test_a_pose_that_is_not_read_is_named(tmp_path: Path, name: str) -> None:
    path = plain(tmp_path / "a.json", **{name: np.eye(4).tolist()})
    with pytest.warns(IriftraceWarning, match=f"{name}, which is not read as the camera's pose"):
        assert read_calibration(path).matrix is None


@pytest.mark.parametrize("name", ["ros_left.yaml", "matlab_intrinsics.json"])
def test_only_opencvs_files_have_a_pose(tmp_path: Path, name: str) -> None:
    """One that was added to another is in no declared unit, and named."""
    text, path = (DATA / name).read_text().rstrip().rstrip("}"), tmp_path / name
    pose = ', "rvec": [0, 0, 0], "tvec": [0, 0, 1]}' if "json" in name else "\ntvec: [0, 0, 1]\n"
    path.write_text(text + pose)
    with pytest.warns(IriftraceWarning, match="tvec, which is not read as the camera's pose"):
        assert read_calibration(path).matrix is None


@pytest.mark.parametrize("name", ["length_unit", "unit", "units"])
def test_the_unit_that_a_file_states(tmp_path: Path, name: str) -> None:
    pose = {"rvec": [0, 0, 0], "tvec": [0, 0, 0.4]}
    matrix = read_calibration(plain(tmp_path / "a.json", **pose, **{name: "meters"})).matrix
    assert matrix is not None
    assert matrix[2, 3] == pytest.approx(-400.0)
    path = plain(tmp_path / "a.json", **pose, **{name: "furlong"})
    with pytest.raises(InputError, match="unit 'furlong' is not known here; give the unit"):
        read_calibration(path)
    matrix = read_calibration(path, length_mm=25.4).matrix
    assert matrix is not None
    assert matrix[2, 3] == pytest.approx(-0.4 * 25.4)


def test_a_packed_calibration_is_named(tmp_path: Path) -> None:
    """OpenCV's FileStorage writes calibration.yml.gz, too."""
    path = tmp_path / "a.yml.gz"
    path.write_bytes(gzip.compress(plain(tmp_path / "a.json").read_bytes()))
    with pytest.raises(InputError, match=r"is a binary file\); give .* unpacked"):
        read_calibration(path)
