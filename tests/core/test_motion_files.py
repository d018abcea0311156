"""Facts in motion files besides their numbers: direction, missing numbers, scales, encodings."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.core.mesh.transform import parse_transform, read_motion, stated_to_camera

MOTION = parse_transform("rotate x 31, rotate z 77, translate 10 -20 30")
ROWS = "\n".join(" ".join(map(repr, row)) for row in MOTION.tolist()) + "\n"


@pytest.mark.parametrize(
    "said",
    [
        "part to camera",
        "from the part's frame to the camera's",
        "world -> cam",
        "object coordinates to camera 1",
        "R_gripper2cam",
        "T_cam_world",
        "w2c",
        "T_cw",
        "reference to measured",
        "part pose in the camera frame",
        "pose of the board in camera 1",
    ],
)
def test_a_motion_that_says_to_lead_back_is_refused(tmp_path: Path, said: str) -> None:
    file = tmp_path / "motion.txt"
    file.write_text(f"# {said}\n{ROWS}")
    with pytest.raises(
        InputError, match="take points the other way, from the camera's frame; write"
    ):
        read_motion(file)


@pytest.mark.parametrize("said", ["cam2gripper", "T_wc", "camera 1 to part", "scan to CAD", "c2w"])
def test_the_direction_of_motions_may_be_stated(tmp_path: Path, said: str) -> None:
    file = tmp_path / "motion.txt"
    file.write_text(f"# {said}; distance from part to camera: 300\n{ROWS}")
    assert_allclose(read_motion(file), MOTION)
    assert not stated_to_camera(said)


@pytest.mark.parametrize("encoding", ["utf-16", "cp1252"])
def test_encodings_of_motion_files(tmp_path: Path, encoding: str) -> None:
    file = tmp_path / "motion.txt"
    file.write_text(f"# Länge, unit: m\n{ROWS}", encoding=encoding)
    assert_allclose(parse_transform(str(file))[:3, 3], 1e3 * MOTION[:3, 3])


def test_a_missing_number_is_refused() -> None:
    with pytest.raises(InputError, match="not finite"):
        parse_transform(ROWS.replace("-20.0", "nan"))


def test_a_scale_that_is_no_change_of_units_is_warned_of() -> None:
    """As of an alignment with scale, which would change the part's size."""
    scaled = MOTION @ np.diag((1.002, 1.002, 1.002, 1.0))
    with pytest.warns(IriftraceWarning, match=r"scales lengths by 1\.002, .* align without scale"):
        parse_transform(" ".join(map(repr, scaled.ravel().tolist())))
