"""Names of coefficients, poses and MATLAB's intrinsics in calibrations that are nearly OpenCV's."""

import json
from pathlib import Path

import numpy as np
import pytest

from iriftrace.camera.calibration import read_calibration
from iriftrace.camera.stereo import read_stereo_calibration
from iriftrace.core.errors import InputError, IriftraceWarning
from validation.inputs.calibration_files import COEFFICIENTS, MATRIX, plain

COEFFICIENTS_BY_NAME = dict(zip(("k1", "k2", "p1", "p2", "k3"), COEFFICIENTS.tolist(), strict=True))


@pytest.mark.parametrize(
    "lens", [COEFFICIENTS_BY_NAME, {"distortion_coefficients": COEFFICIENTS_BY_NAME}]
)
def test_coefficients_by_their_names_next_to_a_camera_matrix(
    tmp_path: Path, lens: dict[str, object]
) -> None:
    path = plain(tmp_path / "a.json", **({"distortion_coefficients": None} | lens))
    read = read_calibration(path).distortion.coefficients
    assert read[:5] == tuple(COEFFICIENTS.tolist())


def test_k1_to_k4_alone_are_not_read_as_brown_conrady(tmp_path: Path) -> None:
    lens = {"k1": 0.1, "k2": 0.01, "k3": 0.0, "k4": 0.0}
    path = plain(tmp_path / "a.json", distortion_coefficients=None, **lens)
    with pytest.raises(InputError, match="distortion_coefficients is missing"):
        read_calibration(path)


@pytest.mark.parametrize("name", ["skew", "b2", "s1", "tau_x", "p3", "k4", "t1"])
def test_numbers_of_lenses_that_are_not_modelled_are_refused(tmp_path: Path, name: str) -> None:
    """k4 of the rational model has k5 and k6 next to it."""
    lens = {**COEFFICIENTS_BY_NAME, name: 0.5}
    for changes in (lens, {"distortion_coefficients": lens}):
        path = plain(tmp_path / "a.json", **({"distortion_coefficients": None} | changes))
        with pytest.raises(InputError, match=rf"has {name} = 0\.5, which is not modelled"):
            read_calibration(path)
    rational = {**COEFFICIENTS_BY_NAME, "k4": 0.5, "k5": 0.0, "k6": 0.0, "skew": 0}
    path = plain(tmp_path / "a.json", distortion_coefficients=rational)
    assert read_calibration(path).distortion.coefficients[5:] == (0.5, 0.0, 0.0)


@pytest.mark.parametrize("name", ["radial2", "tangential1"])
def test_names_of_two_programs_are_not_mixed(tmp_path: Path, name: str) -> None:
    """The coefficient under the other name was 0."""
    lens = {**COEFFICIENTS_BY_NAME, name: 0.11}
    path = plain(tmp_path / "a.json", **({"distortion_coefficients": None} | lens))
    with pytest.raises(InputError, match=f"next to k1 it has {name}, which is not known"):
        read_calibration(path)


@pytest.mark.parametrize("name", ["model", "lens_type", "projection"])
def test_another_lens_model_under_any_name_is_refused(tmp_path: Path, name: str) -> None:
    path = plain(tmp_path / "a.json", **{name: "fisheye"})
    with pytest.raises(InputError, match=f"its {name} 'fisheye' is another lens model"):
        read_calibration(path)


@pytest.mark.parametrize("name", ["skew", "alpha_c"])
def test_a_skew_outside_the_matrix_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=r"has the skew 0\.5"):
        read_calibration(plain(tmp_path / "a.json", **{name: 0.5}))
    assert read_calibration(plain(tmp_path / "a.json", **{name: 0.0})).focal_px[0] > 0


def test_a_named_order_of_the_coefficients_is_refused(tmp_path: Path) -> None:
    path = plain(tmp_path / "a.json", order=["k1", "k2", "k3", "p1", "p2"])
    with pytest.raises(InputError, match="in the order k1, k2, k3, p1, p2; write them in OpenCV's"):
        read_calibration(path)
    path = plain(tmp_path / "a.json", order=["k1", "k2", "p1", "p2", "k3"])
    assert read_calibration(path).distortion.coefficients[:5] == tuple(COEFFICIENTS.tolist())


def test_a_list_of_cameras(tmp_path: Path) -> None:
    camera = json.loads(plain(tmp_path / "a.json").read_text())
    alone = read_calibration(tmp_path / "a.json")
    for content in ({"cameras": [camera]}, [camera]):
        (tmp_path / "b.json").write_text(json.dumps(content))
        assert read_calibration(tmp_path / "b.json").distortion == alone.distortion
    motion = {"R": [0, 0, 0], "T": [-100, 0, 0]}
    (tmp_path / "b.json").write_text(json.dumps({"cameras": [camera, camera], **motion}))
    assert read_stereo_calibration(tmp_path / "b.json").baseline_mm == 100.0
    with pytest.raises(InputError, match="it is of two cameras"):
        read_calibration(tmp_path / "b.json")


@pytest.mark.parametrize("ending", ["yaml", "xml"])
def test_single_numbers_in_any_notation(tmp_path: Path, ending: str) -> None:
    values = {"fx": "3.65e3", "fy": "365e1", "cx": "1210", "cy": "1.03E3", "k1": "-8e-2"}
    values |= {"k2": "0.11", "p1": "4e-4", "image_width": "2448", "image_height": "2048"}
    path = tmp_path / f"a.{ending}"
    if ending == "yaml":
        path.write_text("".join(f"{name}: {value}\n" for name, value in values.items()))
    else:
        words = "".join(f"<{name}>{value}</{name}>" for name, value in values.items())
        path.write_text(f"<opencv_storage>{words}</opencv_storage>")
    found = read_calibration(path)
    assert (found.focal_px, found.centre_px) == ((3650.0, 3650.0), (1210.0, 1030.0))
    assert found.distortion.coefficients[:4] == (-0.08, 0.11, 4e-4, 0.0)


def test_a_rotation_vector_of_more_than_half_a_turn_is_warned_of(tmp_path: Path) -> None:
    path = plain(tmp_path / "a.json", rvec=[0.5, 4.5, 0.2], tvec=[0, 0, 500])
    with pytest.warns(IriftraceWarning, match="by more than half a turn, .* if it is in degrees"):
        read_calibration(path)


@pytest.mark.parametrize("k3", [0.2, 0.0])
def test_a_k3_in_the_place_of_p1_is_noticed(tmp_path: Path, k3: float) -> None:
    other_order = [-0.08, 0.11, k3, 0.0004, -0.0002]
    path = plain(tmp_path / "a.json", distortion_coefficients=other_order)
    with pytest.warns(IriftraceWarning, match="if its coefficients are k1, k2, k3, p1, p2"):
        read_calibration(path)


@pytest.mark.parametrize("name", ["extrinsics", "extrinsic_matrix", "camera_pose", "T_world_cam"])
def test_a_pose_that_is_not_read_is_named(tmp_path: Path, name: str) -> None:
    path = plain(tmp_path / "a.json", **{name: np.eye(4).tolist()})
    with pytest.warns(IriftraceWarning, match=f"{name}, which is not read as the camera's pose"):
        assert read_calibration(path).matrix is None


def test_camera_intrinsics_of_matlab(tmp_path: Path) -> None:
    """Focal length and principal point apart; two radial coefficients are not a fisheye lens's."""
    content = {
        "FocalLength": [3650.0, 3651.0],
        "PrincipalPoint": [1224.5, 1024.5],
        "ImageSize": [2048, 2448],
        "RadialDistortion": [-0.08, 0.11],
        "TangentialDistortion": [0.0004, -0.0002],
        "Skew": 0,
    }
    path = tmp_path / "a.json"
    path.write_text(json.dumps(content))
    calibration = read_calibration(path)
    assert calibration.focal_px == (3650.0, 3651.0)
    assert calibration.centre_px == (1223.5, 1023.5)
    path.write_text(json.dumps(content | {"Skew": 2.0}))
    with pytest.raises(InputError, match="skew 2"):
        read_calibration(path)


def test_remarks_in_windows_encoding_may_state_the_unit(tmp_path: Path) -> None:
    content = plain(tmp_path / "a.json", rvec=[0, 0, 0], tvec=[0, 0, 0.4]).read_text()
    path = tmp_path / "a.yaml"
    path.write_bytes(f"# Prüfstand, unit: m\n{content}".encode("cp1252"))
    matrix = read_calibration(path).matrix
    assert matrix is not None
    assert matrix[2, 3] == pytest.approx(-400.0)


TWICE = {
    "yaml": "camera: {K: [1], K: [2]}",
    "json": '{"a": {"K": [1], "K": [2]}}',
    "xml": "<opencv_storage><K>1</K><K>2</K></opencv_storage>",
}


@pytest.mark.parametrize("ending", TWICE)
def test_a_name_that_is_there_twice_is_refused(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"a.{ending}"
    path.write_text(TWICE[ending])
    with pytest.raises(InputError, match="has K twice; leave out the one that is not meant"):
        read_calibration(path)


def test_the_size_of_a_board_is_not_that_of_pictures(tmp_path: Path) -> None:
    none = {"image_width": None, "image_height": None}
    path = plain(tmp_path / "a.json", imageSize=[2448, 2048], size=[11, 8], **none)
    assert read_calibration(path).resolution == (2448, 2048)
    path = plain(tmp_path / "b.json", camera_matrix=None, k=0.04, M=MATRIX.tolist())
    assert read_calibration(path).focal_px == (3653.8, 3657.25)


@pytest.mark.parametrize("name", ["K", "cameraMatrix"])
def test_two_names_of_one_value_have_the_same_numbers(tmp_path: Path, name: str) -> None:
    read_calibration(plain(tmp_path / "a.json", **{name: MATRIX.tolist()}))
    path = plain(tmp_path / "b.json", **{name: (MATRIX + np.eye(3)).tolist()})
    with pytest.raises(InputError, match=f"camera_matrix and {name} are different"):
        read_calibration(path)


def test_a_unit_that_is_not_known_is_refused(tmp_path: Path) -> None:
    path = plain(tmp_path / "a.json", rvec=[0, 0, 0], tvec=[0, 0, 1], unit="furlong")
    with pytest.raises(InputError, match="unit 'furlong' is not known here; give the unit"):
        read_calibration(path)
    matrix = read_calibration(path, length_mm=25.4).matrix
    assert matrix is not None
    assert matrix[2, 3] == pytest.approx(-25.4)


def test_a_matrix_of_other_named_numbers_is_refused(tmp_path: Path) -> None:
    path = plain(tmp_path / "a.json", camera_matrix={"f": 3650, "x": 9, "y": 9})
    with pytest.raises(InputError, match="camera_matrix has the entries f, x, y instead of"):
        read_calibration(path)
