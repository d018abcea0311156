"""Shells trimmed to a camera's view give that camera the same picture."""

from pathlib import Path

import numpy as np
import pytest

from iriftrace.part.part import read_part
from iriftrace.scene.load import load_scene
from iriftrace.scene.write import write_scene
from iriftrace.scenes import folder_of
from iriftrace.shells.edit import trim_to_frustum
from iriftrace.shells.files import load_shells
from iriftrace.trace.pose_image import pose_image
from validation.inputs.cameras import camera_at


@pytest.mark.usefixtures("variant")
def test_trimming_changes_no_pixel(tmp_path: Path) -> None:
    """Fewer triangles, but the same rays: none is lost, none misjudged at the new edges."""
    bundled = folder_of("cylinder")
    camera = camera_at(
        (150.0, -100.0, 120.0),
        (10.0, 0.0, 5.0),
        focal_length_mm=25.0,
        sensor_mm=(6.7, 5.6),
        resolution=(306, 256),
    )
    whole = load_shells(bundled / "shells")
    trimmed = trim_to_frustum(whole, camera, 5.0)
    assert trimmed.triangles < 0.5 * whole.triangles
    part = read_part(bundled / "part.ply")
    images = [
        pose_image(load_scene(write_scene(tmp_path / name, part, shells, camera)))
        for name, shells in (("whole", whole), ("trimmed", trimmed))
    ]
    np.testing.assert_array_equal(images[0].status, images[1].status)
    difference = images[0].vector("displacement") - images[1].vector("displacement")
    assert np.abs(difference).max() < 1e-9
