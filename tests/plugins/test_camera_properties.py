"""The sensor calibrated_camera with a calibration of OpenCV in the place of numbers."""

from pathlib import Path
from typing import Any

import cv2
import mitsuba as mi
import numpy as np
import pytest

from iriftrace.camera.pose import look_at
from validation.inputs.calibration_files import (
    COEFFICIENTS,
    MATRIX,
    RVEC,
    TVEC,
    plain,
    written_by_opencv,
)
from validation.inputs.small_scenes import camera, film

pytestmark = pytest.mark.usefixtures("variant")

PAPER_FILM = {"width": 2448, "height": 2048}
POSE = ((150.0, -100.0, 120.0), (3.0, -2.0, 1.0))
PIXEL = 2.74e-3
CALIBRATED = f"""<scene version="3.0.0">
    <sensor type="calibrated_camera">
        <string name="calibration" value="camera.yaml"/>
        <float name="pixel_size" value="{PIXEL}"/>
        <float name="focus_near" value="50"/>
        <float name="scale" value="0.25"/>
        <film type="hdrfilm">
            <integer name="width" value="2448"/>
            <integer name="height" value="2048"/>
        </film>
    </sensor>
</scene>
"""


@pytest.mark.parametrize("name", ["camera.yaml", "camera.json"])
def test_calibration_beside_the_scene_projects_as_opencv_does(tmp_path: Path, name: str) -> None:
    """From OpenCV's file, named in a scene's XML, to its own pixels; 1e-6 px are demanded."""
    written_by_opencv(tmp_path / name, rvec=RVEC, tvec=TVEC)
    (tmp_path / "scene.xml").write_text(CALIBRATED.replace("camera.yaml", name))
    sensor = mi.load_file(str(tmp_path / "scene.xml")).sensors()[0]
    assert tuple(sensor.film().size()) == (612, 512)
    assert sensor.description()["focus_mm"] == [50.0, None]
    assert sensor.description()["focal_length_mm"] == pytest.approx(MATRIX[0, 0] * PIXEL)
    points = np.random.default_rng(1).uniform(-40, 40, (500, 3))
    expected, _ = cv2.projectPoints(points, RVEC, TVEC, MATRIX, COEFFICIENTS)
    expected = (expected[:, 0] + 0.5) * 0.25
    inside = ((expected > 0) & (expected < (612, 512))).all(axis=1)
    assert inside.sum() > 300
    x, y, in_front = sensor.project64(mi.Point3d(*points[inside].T))
    assert np.array(in_front).all()
    np.testing.assert_allclose(np.stack((x, y), axis=1), expected[inside], rtol=0, atol=1e-8)


def from_file(path: Path, **more: Any) -> Any:
    properties = {"calibration": str(path), "pixel_size": PIXEL, "film": film(**PAPER_FILM), **more}
    return mi.load_dict({"type": "calibrated_camera", **properties})


def test_pose_of_the_scene_comes_before_that_of_the_calibration(tmp_path: Path) -> None:
    path = written_by_opencv(tmp_path / "camera.yaml", rvec=RVEC, tvec=TVEC / 1000)
    own = np.array(from_file(path, length_unit="m").description()["matrix"])
    np.testing.assert_allclose(own[:3, :3].T, cv2.Rodrigues(RVEC)[0], atol=1e-12)
    np.testing.assert_allclose(-own[:3, :3].T @ own[:3, 3], TVEC, atol=1e-9)
    pose = mi.ScalarTransform4d().look_at(*POSE, [0, 0, 1])
    moved = np.array(from_file(path, to_world=pose).description()["matrix"])
    np.testing.assert_allclose(moved, look_at(*POSE), atol=1e-12)
    with pytest.raises(RuntimeError, match='"length_unit" is that of the pose'):
        from_file(path, to_world=pose, length_unit="m")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"focal_length": 10.0}, '"calibration" says "focal_length" too'),
        ({"k3": 0.0}, '"calibration" says "k3" too'),
        ({"film": film(612, 512)}, "of 2448 x 2048 pixels, but the film has 612 x 512"),
        ({"calibration": 3.0}, '"calibration" is 3.0; write <string'),
        ({"calibration": "nowhere.yaml"}, "no file .*nowhere.yaml"),
        ({"pixel_size": 0.0}, "Pixel size is 0 mm"),
        ({"length_unit": "furlong"}, "'furlong' is not a length unit"),
        ({"pixel_size": 2.74}, "Pixel size is 2.74 mm"),
        ({"calibration": "."}, '"calibration" names the folder'),
    ],
)
def test_wrong_calibrations_are_refused(
    tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    path = written_by_opencv(tmp_path / "camera.yaml", rvec=RVEC, tvec=TVEC)
    with pytest.raises(RuntimeError, match=message):
        from_file(path, **changes)


def test_what_belongs_to_a_calibration_and_what_it_needs(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match='"pixel_size" belongs to a calibration'):
        mi.load_dict(camera(pixel_size=PIXEL))
    path = plain(tmp_path / "camera.json")
    properties = {"type": "calibrated_camera", "calibration": str(path)}
    properties["film"] = film(**PAPER_FILM)
    with pytest.raises(RuntimeError, match="knows lengths in pixels only"):
        mi.load_dict(properties)
    with pytest.raises(RuntimeError, match=r"needs a pose, and .*camera.json has none; add"):
        from_file(path)
    board = written_by_opencv(tmp_path / "board.yaml", extrinsic_parameters=np.zeros((13, 6)))
    with pytest.raises(RuntimeError, match="has 13 views of a calibration board, which are none"):
        from_file(board)
