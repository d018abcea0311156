"""Poses are data: the second one of a scene runs the kernels of the first."""

import pytest

from bench.pose import kernels_of_second_pose
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene


@pytest.mark.parametrize("engine", ["shells", "cells"])
@pytest.mark.usefixtures("variant")
def test_the_second_pose_needs_no_kernel_of_its_own(engine: str) -> None:
    """Compared by hash, since kernels on disk from an earlier run are not compiled again.

    The first pose of a scene makes tables in between, which must not make its kernels others.
    """
    scene = load_scene(folder_of("cylinder") / "scene.xml", {"scale": 0.1}, engine=engine)
    assert kernels_of_second_pose(scene) == 0
