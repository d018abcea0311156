"""Calibrations of two cameras: lenses, R and T, and motions that cannot be."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from iriftrace.camera.calibration import StereoCalibration
from iriftrace.camera.pose import look_at
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.calibration import read_stereo_calibration
from validation.inputs import stereo_files as rig


def _assert_the_rig(found: StereoCalibration, coefficients: tuple[np.ndarray, ...]) -> None:
    assert_allclose(found.rotation, rig.ROTATION, rtol=0, atol=1e-12)
    assert_allclose(found.translation_mm, rig.TRANSLATION, rtol=0, atol=1e-9)
    for camera, matrix, lens in zip(
        (found.first, found.second), rig.MATRICES, coefficients, strict=True
    ):
        assert_allclose(camera.focal_px, (matrix[0, 0], matrix[1, 1]), rtol=1e-15)
        assert_allclose(camera.centre_px, matrix[:2, 2], rtol=1e-15)
        assert camera.resolution == rig.SIZE
        assert camera.distortion.coefficients == (*lens, 0, 0, 0)
        assert camera.matrix is None


@pytest.mark.parametrize("ending", ["yaml", "xml", "json"])
@pytest.mark.parametrize("names", rig.NAMES)
def test_names_and_formats_of_opencv(tmp_path: Path, names: str, ending: str) -> None:
    found = read_stereo_calibration(rig.opencv(tmp_path / f"stereo.{ending}", names))
    _assert_the_rig(found, rig.COEFFICIENTS)
    assert found.length_unit == "mm"
    assert found.baseline_mm == pytest.approx(np.linalg.norm(rig.TRANSLATION))


def test_both_cameras_project_as_opencv_does(tmp_path: Path) -> None:
    """R2 = R R1 and t2 = R t1 + T, with OpenCV's own projection of points of the world."""
    found = read_stereo_calibration(rig.opencv(tmp_path / "stereo.yaml"))
    pose = look_at((100.0, -500.0, 200.0), (0.0, 0.0, 0.0))
    inverse = np.linalg.inv(pose)
    turns = (inverse[:3, :3], rig.ROTATION @ inverse[:3, :3])
    shifts = (inverse[:3, 3], rig.ROTATION @ inverse[:3, 3] + rig.TRANSLATION)
    points = np.random.default_rng(1).uniform(-20, 20, (100, 3))
    for number, calibration in enumerate(found.placed(pose)):
        expected, _ = cv2.projectPoints(
            points,
            cv2.Rodrigues(turns[number])[0],
            shifts[number],
            rig.MATRICES[number],
            rig.COEFFICIENTS[number],
        )
        camera = calibration.camera(pixel_size_mm=3.45e-3)
        assert_allclose(camera.project(points), expected[:, 0], rtol=0, atol=1e-6)


def test_the_unit_of_the_translation(tmp_path: Path) -> None:
    metres = rig.opencv(tmp_path / "m.yaml", T=1e-3 * rig.TRANSLATION)
    with pytest.raises(InputError, match=r"0\.2326 mm apart where T is in mm"):
        read_stereo_calibration(metres)
    _assert_the_rig(read_stereo_calibration(metres, length_unit="m"), rig.COEFFICIENTS)


def test_the_unit_that_a_file_states(tmp_path: Path) -> None:
    inches = rig.opencv(tmp_path / "in.yaml", T=rig.TRANSLATION / 25.4, units="inch")
    _assert_the_rig(read_stereo_calibration(inches), rig.COEFFICIENTS)
    assert read_stereo_calibration(inches, length_unit="cm").length_unit == "cm"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"R": None}, "R and T from camera 1 to camera 2 are missing"),
        ({"R": np.array((1.1, 20.0, 3.0))}, "in degrees or no rotation vector"),
        ({"R": -np.eye(3)}, "stretches or mirrors"),
        ({"M2": None}, "has not two cameras of .*its names are image_width"),
        ({"D2": None}, "camera 2: distortion_coefficients is missing"),
        ({"image_width": None, "image_height": None}, "image_width and image_height are missing"),
        ({"M3": np.eye(3), "D3": np.zeros(5)}, "more than two cameras"),
        ({"T": np.zeros(3)}, "0 mm apart"),
        ({"rvec": np.zeros(3), "tvec": np.ones(3)}, "R and rvec are names of one value"),
        ({"T": np.eye(4)}, "T has 16 numbers instead of 3"),
        ({"fisheye_model": 1}, "the lens model 'fisheye'"),
        ({"xi2": 1.2}, r"camera 2: the lens model 'omnidirectional \(xi\)'"),
    ],
)
def test_wrong_files(tmp_path: Path, changes: dict[str, object], message: str) -> None:
    path = rig.opencv(tmp_path / "stereo.yaml", **changes)
    with pytest.raises(InputError, match=message) as caught:
        read_stereo_calibration(path)
    assert str(path) in str(caught.value)
    assert caught.value.code.startswith("calibration.")


def test_lens_models_that_are_not_modelled(tmp_path: Path) -> None:
    for name, value in {"distortion_model": "equidistant", "camera_model": "omni"}.items():
        with pytest.raises(InputError, match=f"camera 1: the lens model '{value}'"):
            read_stereo_calibration(rig.kalibr(tmp_path / "camchain.yaml", **{name: value}))


def test_cameras_calibrated_one_by_one(tmp_path: Path) -> None:
    """Their projections have no baseline; poses of their own are those of two calibrations."""
    left, _ = rig.ros(tmp_path)
    with pytest.raises(InputError, match="have no baseline"):
        read_stereo_calibration(left, left)
    values = {"camera_matrix": rig.MATRICES[0].tolist(), "D": [0.0] * 4, "image_size": [640, 480]}
    single = tmp_path / "single.json"
    single.write_text(json.dumps(values | {"rvec": [0, 0, 1], "tvec": [0, 0, 9]}))
    for files in ((single,), (single, single), (left, single)):
        with pytest.raises(InputError, match=r"has one camera; .* poses of their own one by one"):
            read_stereo_calibration(*files)
    with pytest.raises(InputError, match="3 files are given"):
        read_stereo_calibration(left, left, left)


def test_a_projector_has_its_own_size(tmp_path: Path) -> None:
    """A value with a number is that camera's, one without is that of both."""
    size = {"image_width2": 1024, "image_height2": 768}
    path = rig.opencv(tmp_path / "a.yaml", **size)
    found = read_stereo_calibration(path)
    assert (found.first.resolution, found.second.resolution) == (rig.SIZE, (1024, 768))


INVERSE = {"R": rig.ROTATION.T, "T": -rig.ROTATION.T @ rig.TRANSLATION}
(M1, M2), (D1, D2) = rig.MATRICES, rig.COEFFICIENTS
RECTIFIED = dict(
    zip(
        ("R1", "R2", "P1", "P2"),
        cv2.stereoRectify(M1, D1, M2, D2, rig.SIZE, rig.ROTATION, rig.TRANSLATION[:, None])[:4],
        strict=True,
    )
)


@pytest.mark.parametrize("names", rig.NAMES)
def test_an_inverse_motion_is_refused(tmp_path: Path, names: str) -> None:
    found = read_stereo_calibration(rig.opencv(tmp_path / "a.yaml", names, **RECTIFIED))
    assert_allclose(found.translation_mm, rig.TRANSLATION)
    path = rig.opencv(tmp_path / "b.yaml", names, **RECTIFIED, **INVERSE)
    with pytest.raises(InputError, match=r"R and T contradict its .* lead from camera 2 to camera"):
        read_stereo_calibration(path)


@pytest.mark.parametrize(
    "changes",
    [
        {"R": rig.ROTATION.T},
        {"T": -rig.ROTATION.T @ rig.TRANSLATION},
        {"T": -rig.TRANSLATION},
    ],
)
def test_another_motion_is_refused(tmp_path: Path, changes: dict[str, np.ndarray]) -> None:
    """A transposed R; the place of camera 2 in place of T; T of the other sign."""
    path = rig.opencv(tmp_path / "a.yaml", **RECTIFIED, **changes)
    with pytest.raises(InputError, match="contradict its R1, R2, P1 and P2; export"):
        read_stereo_calibration(path)


def test_projections_without_a_baseline_contradict_nothing(tmp_path: Path) -> None:
    """As those of cameras that were calibrated one by one, before their motion was found."""
    alone = RECTIFIED | {"P2": RECTIFIED["P1"]}
    found = read_stereo_calibration(rig.opencv(tmp_path / "a.yaml", **alone))
    assert_allclose(found.translation_mm, rig.TRANSLATION)


def _of_opencv(path: Path, rotation: np.ndarray) -> Path:
    lens = {
        f"{name}{k}": value.tolist()
        for k in (1, 2)
        for name, value in (("M", rig.MATRICES[k - 1]), ("D", rig.COEFFICIENTS[k - 1]))
    }
    motion = {"R": rotation.tolist(), "T": rig.TRANSLATION.tolist(), "image_size": rig.SIZE}
    path.write_text(json.dumps(lens | motion))
    return path


def test_axes_that_cannot_be_of_a_sensor(tmp_path: Path) -> None:
    assert_allclose(
        read_stereo_calibration(_of_opencv(tmp_path / "s.json", rig.ROTATION)).rotation,
        rig.ROTATION,
        atol=1e-12,
    )
    with pytest.warns(IriftraceWarning, match="lead apart by"):
        read_stereo_calibration(_of_opencv(tmp_path / "transposed.json", rig.ROTATION.T))
    with pytest.warns(IriftraceWarning, match=r"meet 2\d\.\d mm in front .* size of a square"):
        read_stereo_calibration(rig.opencv(tmp_path / "squares.yaml", T=rig.TRANSLATION / 25.0))
    degrees = np.array([0.03, 3.0, -0.05])
    with pytest.raises(InputError, match=r"172 degrees apart, .* rotation vector in degrees"):
        read_stereo_calibration(_of_opencv(tmp_path / "degrees.json", degrees))


@pytest.mark.parametrize(
    ("translation", "side"),
    [
        ((-200.0, 5.0, 40.0), "to the right of"),
        ((200.0, 5.0, 40.0), "to the left of"),
        ((5.0, -200.0, 40.0), "below"),
        ((5.0, 200.0, 40.0), "above"),
    ],
)
def test_where_camera_2_stands(
    tmp_path: Path, translation: tuple[float, float, float], side: str
) -> None:
    matrix, lens = [[3650, 0, 1223.5], [0, 3650, 1023.5], [0, 0, 1]], [0, 0, 0, 0, 0]
    values = {"M1": matrix, "M2": matrix, "D1": lens, "D2": lens, "R": np.eye(3).tolist()}
    size = {"image_width": 2448, "image_height": 2048}
    path = tmp_path / "stereo.json"
    path.write_text(json.dumps({**values, **size, "T": translation}))
    assert read_stereo_calibration(path).side == side
