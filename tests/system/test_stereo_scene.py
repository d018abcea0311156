"""Scenes of a stereo sensor: its one calibration and the motion of its cloud place both cameras."""

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from failing import Failing

from iriftrace.camera.pose import look_at
from iriftrace.cli import main
from iriftrace.tracing.load import load_scene
from validation.inputs import stereo_files as rig
from validation.inputs.hot_block import HotBlock

POSE = look_at((-70.0, -380.0, 240.0), (0.0, 0.0, 0.0))
"""Camera 1 to the part, as an alignment of the cloud to the part gives it."""

Printed = pytest.CaptureFixture[str]


def motion(folder: Path) -> Path:
    np.savetxt(folder / "motion.txt", POSE, fmt="%.17g")
    return folder / "motion.txt"


def separate(folder: Path) -> list[str]:
    """A file for each camera with the pose that the motion and R, T give it."""
    turns, shifts = [POSE[:3, :3].T], [-POSE[:3, :3].T @ POSE[:3, 3]]
    turns.append(rig.ROTATION @ turns[0])
    shifts.append(rig.ROTATION @ shifts[0] + rig.TRANSLATION)
    words = []
    for number, option in enumerate(("", "second-")):
        path = folder / f"camera{number + 1}.json"
        values = {
            "camera_matrix": rig.MATRICES[number].tolist(),
            "distortion_coefficients": rig.COEFFICIENTS[number].tolist(),
            "image_size": rig.SIZE,
            "R": turns[number].tolist(),
            "T": shifts[number].tolist(),
        }
        path.write_text(json.dumps(values))
        words += [f"--{option}calibration={path}", f"--{option}pixel-size=3.45 um"]
    return [*words, "--system=stereo"]


def test_one_file_gives_the_scene_of_two(hot: HotBlock, tmp_path: Path, capsys: Printed) -> None:
    words = ["scene", str(hot.field), str(hot.part), "--layers=1"]
    given = [
        f"--stereo-calibration={rig.opencv(tmp_path / 'stereo.yaml')}",
        f"--cloud-to-part={motion(tmp_path)}",
        "--pixel-size=3.45 um",
    ]
    stereo, two = tmp_path / "stereo" / "scene.xml", tmp_path / "two" / "scene.xml"
    assert main([*words, "-o", str(stereo), *given]) == 0
    said = capsys.readouterr().out
    assert "baseline 232.56 mm (T read in mm), 20.1 deg between the axes" in said
    assert main([*words, "-o", str(two), *separate(tmp_path)]) == 0
    assert stereo.read_text() == two.read_text()
    scene = load_scene(stereo)
    assert scene.second_id == "camera_2"
    np.testing.assert_allclose(scene.camera.matrix, POSE, rtol=0, atol=1e-11)
    assert np.linalg.norm(scene.second.origin - POSE[:3, 3]) == pytest.approx(
        np.linalg.norm(rig.TRANSLATION), abs=1e-9
    )


def test_without_the_motion_camera_1_is_placed(hot: HotBlock, tmp_path: Path) -> None:
    """The sensor as a whole, where its first camera is."""
    xml = tmp_path / "scene" / "scene.xml"
    words = ["scene", hot.field, hot.part, "--layers=1", "-o", xml, "--origin=-70,-380,240"]
    given = [f"--stereo-calibration={rig.opencv(tmp_path / 'stereo.xml')}", "--pixel-size=3.45um"]
    assert main([*map(str, words), *given]) == 0
    scene = load_scene(xml)
    np.testing.assert_allclose(scene.camera.matrix, POSE, atol=1e-12)
    relative = np.linalg.inv(scene.second.matrix) @ scene.camera.matrix
    np.testing.assert_allclose(relative[:3, 3], rig.TRANSLATION, atol=1e-9)


RIG = "--stereo-calibration={rig}"
WRONG = [
    (RIG, "give the width of a pixel"),
    ("--cloud-to-part={motion}", "--cloud-to-part places the cameras of a"),
    (
        f"{RIG} --calibration={{rig}}",
        "--calibration is given, but a stereo calibration describes both",
    ),
    (
        f"{RIG} --cloud-to-part={{motion}} --origin=1,2,3",
        "--origin is given, but the motion of the cloud pl",
    ),
    (
        f"{RIG} --focal-length='16 mm'",
        "focal length is 16 mm, but the calibration states it as well",
    ),
    (
        f"{RIG} --cloud-to-part={{away}} --pixel-size=3um",
        "it sees nothing of the part; give the unit of T",
    ),
    (
        f"{RIG} --cloud-to-part=gone.txt --pixel-size=3um",
        "transform's file gone.txt does not exist",
    ),
    ("--calibration={rig} --pixel-size=3um", "of two cameras; .*--stereo-calibration"),
]


@pytest.mark.parametrize(("options", "words"), WRONG)
def test_wrong_options(
    fails: Failing, hot: HotBlock, tmp_path: Path, options: str, words: str
) -> None:
    np.savetxt(tmp_path / "away.txt", POSE @ np.diag((1.0, -1.0, -1.0, 1.0)))
    names = {
        "rig": rig.opencv(tmp_path / "stereo.yaml"),
        "motion": motion(tmp_path),
        "away": tmp_path / "away.txt",
    }
    given = shlex.split(options.format(**names))
    message = fails("scene", hot.field, hot.part, "-o", "out/scene.xml", "--layers=1", *given)
    assert re.search(words, message)
