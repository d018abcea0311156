"""Sets of poses: parts of them, several joined, and matrices that are no poses."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from iriftrace.camera.orbit import Orbit, orbit_poses
from iriftrace.camera.pose_set import PoseSet, joined
from iriftrace.core.errors import InputError


def test_take_and_joined_keep_poses_with_their_angles():
    poses = orbit_poses(Orbit(np.zeros(3), (225.0, 190.0, 160.0)), [0.0, 10.0, 20.0], [5.0, 15.0])
    some = poses.take([4, 1])
    assert_array_equal(some.matrices, poses.matrices[[4, 1]])
    assert_array_equal(some.azimuth_deg, [10, 10])
    assert_array_equal(some.elevation_deg, [15, 5])
    assert len(poses.take([])) == 0
    assert_array_equal(poses.take(poses.azimuth_deg > 15.0).elevation_deg, [5, 15])
    assert_array_equal(poses.take(5).azimuth_deg, [20])
    both = joined([some, PoseSet(poses.matrices[:1])])
    assert_array_equal(both.matrices, poses.matrices[[4, 1, 0]])
    assert_array_equal(both.azimuth_deg, [10, 10, np.nan])
    assert len(joined([])) == 0


def test_pose_sets_cannot_be_changed_by_accident():
    matrices = np.eye(4)[None].copy()
    poses = PoseSet(matrices)
    matrices[0, 0, 3] = 5.0
    assert poses.origins[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        poses.matrices[0, 0, 3] = 1.0
    with pytest.raises(InputError, match="2 azimuths for 1 poses"):
        PoseSet(matrices, [1.0, 2.0])


def changed(row, column, value):
    matrices = np.tile(np.eye(4), (2, 1, 1))
    matrices[1, row, column] = value
    return matrices


@pytest.mark.parametrize(
    ("matrices", "message"),
    [
        (np.eye(4), "shape"),
        (np.zeros((2, 3, 4)), "shape"),
        (changed(0, 3, np.nan), "Pose 2 holds a number that is not finite"),
        (changed(0, 0, np.inf), "Pose 2 holds a number that is not finite"),
        (changed(3, 0, 7.0), r"Pose 2 does not end with the row 0 0 0 1; .* transposed\?$"),
        (changed(0, 0, 1.001), "Pose 2 is more than a rotation and a shift"),
        (changed(0, 0, 1e200), "Pose 2 is more than a rotation and a shift"),
        (changed(0, 1, 1e-3), "Pose 2 is more than a rotation and a shift"),
        (changed(2, 2, -1.0), "Pose 2 mirrors the picture"),
    ],
)
def test_what_is_no_pose(matrices, message):
    with pytest.raises(InputError, match=message):
        PoseSet(matrices)
