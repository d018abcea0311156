"""Scenes whose camera comes from a calibration of OpenCV, or has a lens distortion typed in."""

import json
import re
import shlex
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
import xarray as xr
from failing import Failing

from iriftrace.cli import main
from iriftrace.io.exr import read_exr
from iriftrace.tracing.load import load_scene
from validation.inputs.hot_block import HotBlock

MATRIX = np.array(((400.0, 0.0, 61.0), (0.0, 402.0, 48.5), (0.0, 0.0, 1.0)))
COEFFICIENTS = np.array((-0.3, 0.2, 1e-3, -2e-3, 0.0))
RVEC, TVEC = np.array((2.2, 0.1, -0.2)), np.array((0.0, 1.0, 100.0))


def calibration(folder: Path, **more: np.ndarray) -> Path:
    path = folder / "camera.yaml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 120)
    storage.write("image_height", 100)
    storage.write("camera_matrix", MATRIX)
    storage.write("distortion_coefficients", COEFFICIENTS)
    for name, value in more.items():
        storage.write(name, value)
    storage.release()
    return path


def test_calibration_goes_through_to_the_results(
    hot: HotBlock, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Pixels of the rendered hits are where OpenCV projects the hits to; results say it."""
    path, xml = calibration(tmp_path, rvec=RVEC, tvec=TVEC), tmp_path / "scene" / "scene.xml"
    words = ["scene", hot.field, hot.part, "-o", xml, "--layers=3", "--calibration", path]
    assert main([*map(str, words), "--pixel-size=5 um", "--scale=1"]) == 0
    assert "Lens distortion k1 -0.3, k2 0.2, p1 0.001, p2 -0.002." in capsys.readouterr().out
    assert main(["render", str(xml)]) == 0
    image = read_exr(xml.with_suffix(".exr"))
    assert image.header["assumptions"]["camera"].startswith("distorted: pinhole with Brown-Conrady")
    camera = image.camera
    assert camera.focal_length_mm == pytest.approx(400 * 0.005)
    good = image.status == 0
    assert good.sum() > 500
    hits, _ = cv2.projectPoints(image.vector("straight", good), RVEC, TVEC, MATRIX, COEFFICIENTS)
    row, column = np.nonzero(good)
    # OpenCV's (0, 0) is the first pixel's centre; hits are rounded to float32.
    np.testing.assert_allclose(hits[:, 0], np.stack((column, row), axis=1), rtol=0, atol=1e-4)
    metrics = json.loads(xml.with_suffix(".json").read_text())
    assert metrics["camera"]["distortion"]["k1"] == -0.3


def test_origin_takes_the_place_of_the_files_pose(hot: HotBlock, tmp_path: Path) -> None:
    path, xml = calibration(tmp_path, rvec=RVEC, tvec=TVEC), tmp_path / "scene" / "scene.xml"
    words = ["scene", hot.field, hot.part, "-o", xml, "--layers=1", "--calibration", path]
    assert main([*map(str, words), "--pixel-size=5 um", "--origin=60,-45,70"]) == 0
    assert 'origin="60.0, -45.0, 70.0"' in xml.read_text()


def test_distortion_may_be_typed_in(
    hot: HotBlock, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    xml = tmp_path / "scene" / "scene.xml"
    words = ["scene", hot.field, hot.part, "-o", xml, "--layers=1", "--distortion=-0.1,0.02,1e-3,0"]
    assert main([*map(str, words)]) == 0
    written = re.findall(r'<float name="([kp]\d)" value="(.*?)"', xml.read_text())
    assert written == [("k1", "-0.1"), ("k2", "0.02"), ("p1", "0.001")]
    # A distortion holds for the focal length that it was measured with.
    words = ["sweep", xml, "-o", tmp_path / "a.nc", "--azimuth=0:90:2", "--focal-length=8,10"]
    assert main([*map(str, words)]) == 2
    assert "lens distortion was calibrated at 10 mm" in capsys.readouterr().err


def test_views_of_a_board_are_no_pose(
    hot: HotBlock, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = calibration(tmp_path, extrinsic_parameters=np.zeros((7, 6)))
    words = ["scene", hot.field, hot.part, "-o", tmp_path / "scene.xml", "--layers=1"]
    assert main([*map(str, words), f"--calibration={path}", "--pixel-size=5um"]) == 0
    assert "has 7 views of a calibration board" in capsys.readouterr().err


def test_a_pose_in_another_unit_is_refused(fails: Failing, hot: HotBlock, tmp_path: Path) -> None:
    """With a thousandth of its distance the camera is in the part; with a thousand times it, the
    part is a point.
    """
    path = calibration(tmp_path, rvec=RVEC, tvec=1e-3 * np.asarray(TVEC))
    words = ["scene", hot.field, hot.part, "-o", "out/scene.xml", "--layers=1"]
    options = [f"--calibration={path}", "--pixel-size=5 um"]
    assert "sees nothing of the part" in (message := fails(*words, *options))
    assert "--calibration-length-unit" in message
    assert main([*map(str, words), *options, "--calibration-length-unit=m"]) == 0
    far = calibration(tmp_path, rvec=RVEC, tvec=TVEC)
    options = [f"--calibration={far}", "--pixel-size=5 um", "--calibration-length-unit=m"]
    assert "less than 10 pixels large" in fails(*words, *options)


GIVEN = "--calibration={file} --pixel-size=3um"
WRONG = [
    ("--calibration={file}", "--pixel-size"),
    ("--calibration={file} --pixel-size=0", "Pixel size is 0.*--pixel-size"),
    ("--pixel-size=3um", "belongs to a calibration"),
    ("--calibration=gone.yaml --pixel-size=3um", "gone.yaml"),
    (f"{GIVEN} --focal-length=8mm", "leave one .*--focal-length"),
    (f"{GIVEN} --distortion=0,0,0,0", "leave one .*--distortion"),
    (f"{GIVEN} --calibration-length-unit=furlong", "furlong.*--calibration-length-unit"),
    ("--distortion=1,2,3", "3 coefficients"),
    ("--distortion=a,b,c,d", "numbers separated by .*--distortion"),
    ("--distortion=-3,0,0,0", "turns back inside the picture"),
]


@pytest.mark.parametrize(("options", "words"), WRONG)
def test_wrong_options(
    fails: Failing, hot: HotBlock, tmp_path: Path, options: str, words: str
) -> None:
    path = calibration(tmp_path)
    output = ("-o", "out/scene.xml", "--layers=1")
    message = fails("scene", hot.field, hot.part, *output, *shlex.split(options.format(file=path)))
    assert re.search(words, message)


def with_calibration(hot: HotBlock, folder: Path) -> Path:
    """The hot block's scene, in which the sensor reads a calibration beside it."""
    shutil.copytree(hot.scene.parent, folder)
    text = (folder / "scene.xml").read_text()
    start, end = text.index('<float name="focal_length"'), text.index('<float name="focus_near"')
    named = (
        '<string name="calibration" value="camera.yaml"/> <float name="pixel_size" value=".05"/>'
    )
    (folder / "scene.xml").write_text(text[:start] + named + text[end:])
    calibration(folder)
    return folder / "scene.xml"


def test_a_scene_reads_its_calibration_and_no_other(
    hot: HotBlock, tmp_path: Path, fails: Failing
) -> None:
    """Mitsuba alone would take one from the current folder where the scene's is missing."""
    xml = with_calibration(hot, tmp_path / "scene")
    assert main(["render", str(xml), "-o", "out.exr", "--no-figures"]) == 0
    camera = read_exr("out.exr").camera
    assert camera.focal_length_mm == pytest.approx(400 * 0.05)
    assert camera.distortion is not None
    (xml.parent / "camera.yaml").rename(tmp_path / "camera.yaml")
    refusal = fails("render", xml, "-o", "out2.exr")
    assert refusal.startswith("camera.yaml is not next to ")
    assert refusal.code == "file.missing"
    (tmp_path / "camera.yaml").unlink()
    refusal = fails("render", xml, "-o", "out2.exr")
    assert f"{tmp_path / 'camera.yaml'}" in refusal
    assert refusal.code == "scene.unreadable"


def test_a_scene_reads_its_field_and_no_other(
    hot: HotBlock, tmp_path: Path, fails: Failing
) -> None:
    shutil.copytree(hot.scene.parent, tmp_path / "scene")
    xml = tmp_path / "scene" / "scene.xml"
    start, rest = xml.read_text().split('<integrator type="first_hit">')
    xml.write_text(start + '<integrator type="gradient_path"/>' + rest.split("</integrator>")[1])
    text = xml.read_text()
    unused = [line for line in text.splitlines() if re.search('"(normals|bending)"', line)]
    xml.write_text("\n".join(line for line in text.splitlines() if line not in unused))
    assert main(["render", str(xml), "-o", "out.exr", "--no-figures"]) == 0
    (xml.parent / "field.npz").rename(tmp_path / "field.npz")
    refusal = fails("render", xml, "-o", "out2.exr")
    assert refusal.startswith("field.npz is not next to ")
    assert refusal.code == "file.missing"


def test_poses_of_a_sweep_see_the_films_crop_window(hot: HotBlock, tmp_path: Path) -> None:
    xml = with_calibration(hot, tmp_path / "scene")
    window = {"crop_offset_x": 30, "crop_offset_y": 20, "crop_width": 50, "crop_height": 40}
    lines = "".join(f'<integer name="{name}" value="{px}"/>' for name, px in window.items())
    xml.write_text(
        xml.read_text().replace('<film type="hdrfilm">', f'<film type="hdrfilm">{lines}')
    )
    whole = load_scene(with_calibration(hot, tmp_path / "whole"))
    part = load_scene(xml)
    assert part.camera.resolution == (50, 40)
    np.testing.assert_allclose(
        part.camera.rays([(0, 0), (49, 39)])[1],
        whole.camera.rays([(30, 20), (79, 59)])[1],
        atol=1e-15,
    )
    words = ["--azimuth=0:0:1", "--elevation=30:30:1", "-o", str(tmp_path / "sweep.nc")]
    assert main(["sweep", str(xml), *words]) == 0
    with xr.open_dataset(tmp_path / "sweep.nc") as dataset:
        assert dataset["rays_launched"].values.tolist() == [2000]
