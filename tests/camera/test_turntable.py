"""A part on a turntable: what the camera sees is the part, turned."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from iriftrace.camera.orbit import turntable_poses
from iriftrace.camera.pose import look_at
from iriftrace.core.errors import InputError

CENTRE = np.array([3.0, -2.0, 5.0])
CAMERA = look_at((200.0, 30.0, 60.0), CENTRE)


def test_a_point_of_the_turned_part_is_where_the_turned_camera_sees_it() -> None:
    poses = turntable_poses(CAMERA, "z:0:360:30", CENTRE)
    assert len(poses) == 12
    assert len(turntable_poses(CAMERA, "z:0:90:30", CENTRE)) == 4, "both ends of less than a turn"
    np.testing.assert_allclose(poses.matrices[0], CAMERA, atol=1e-12)
    point = np.array([10.0, 20.0, 30.0])
    for degrees, matrix in zip(range(0, 360, 30), poses.matrices, strict=True):
        turned = CENTRE + Rotation.from_euler("z", degrees, degrees=True).apply(point - CENTRE)
        seen = np.linalg.inv(CAMERA) @ [*turned, 1.0]
        np.testing.assert_allclose(np.linalg.inv(matrix) @ [*point, 1.0], seen, atol=1e-9)


@pytest.mark.parametrize("text", ["z", "w:0:360:30", "z:0:360:0", "z:0:a:30", "z:10:0:5"])
def test_what_is_no_turntable_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="is not a turntable"):
        turntable_poses(CAMERA, text, CENTRE)
