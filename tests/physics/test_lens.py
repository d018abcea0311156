"""Measurements through a distorting lens: shifts, areas, files."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from attrs import evolve

from iriftrace.camera.distortion import Distortion
from iriftrace.image.metrics import pose_metrics
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.write import write_scene
from validation.inputs.cameras import camera_at
from validation.inputs.lenses import LENSES, lens_camera
from validation.inputs.shell_fields import sphere_field
from validation.inputs.small_scenes import (
    camera,
    channels,
    nested_spheres,
    part,
    scene,
    sphere,
    vector,
)
from validation.oracles.aov_by_hand import make_image, make_part, plate

lenses = pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)


@pytest.mark.usefixtures("variant")
@pytest.mark.parametrize("lens", [None, *LENSES.values()], ids=["pinhole", *LENSES])
def test_shift_is_that_of_a_finite_difference_reprojection(
    tmp_path: Path, lens: Distortion | None
) -> None:
    """Minus the projection's derivative, by central differences, times the displacement.

    The air is weak, so that second orders count less than 1 %; the silhouette's steep rays apart.
    """
    air = nested_spheres(tmp_path, (20.0, 16.0, 13.0), (1.000272, 1.00025, 1.00022, 1.0002))
    shapes = {"part": part(tmp_path, sphere(10.0)), **air}
    pixels = channels(scene(shapes, camera(**({} if lens is None else lens.as_dict()))))
    described = camera_at(distortion=lens)
    good = pixels["status.code"] == 0
    at, moved = (vector(pixels, name)[good] for name in ("straight", "displacement"))
    centres = np.stack(np.meshgrid(np.arange(48), np.arange(40)), axis=-1)[good]
    # Rays of the sensor are those of the NumPy camera.
    np.testing.assert_allclose(described.project(at), centres, atol=5e-5)
    stretch = 1e3
    there, back = (described.project(at + s * stretch * moved) for s in (1, -1))
    expected = -(there - back) / (2 * stretch)
    found = np.stack((pixels["shift.px.X"], pixels["shift.px.Y"]), axis=-1)[good]
    size = np.linalg.norm(expected, axis=1)
    error = np.linalg.norm(found - expected, axis=1)
    assert np.median(error / size) < 1e-3
    assert (error < 0.01 * size + 1e-9).mean() > 0.95
    if lens is not None:
        # A pinhole camera would see shifts that differ by percents.
        there, back = (camera_at().project(at + s * stretch * moved) for s in (1, -1))
        pinhole = -(there - back) / (2 * stretch)
        assert np.max(np.linalg.norm(pinhole - expected, axis=1) / size) > 0.002


@lenses
def test_plate_that_leaves_the_picture_is_covered_as_far_as_it_is_seen(lens: Distortion) -> None:
    """Footprints tile what the picture shows; its border, seen without distortion, bounds the area.

    Pixels of 28 mrad: the solid angle at their centres is off by 1e-3 at most.
    """
    view = evolve(lens_camera(lens), matrix=np.eye(4)).scaled(0.02)
    width, height = view.resolution
    sheet = plate((60, 0, 0), (0, 60, 0), (0, 0, 60))
    metrics = pose_metrics(make_image(view, sheet), sheet)
    n = 400
    border = [
        *((width * k / n, 0) for k in range(n)),
        *((width, height * k / n) for k in range(n)),
        *((width - width * k / n, height) for k in range(n)),
        *((0, height - height * k / n) for k in range(n)),
    ]
    _, directions = view.rays(border)
    x, y, _ = (60 * directions / directions[:, 2:]).T
    seen = 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
    assert metrics.coverage_area == pytest.approx(seen / 120**2, rel=1e-3)


@pytest.mark.usefixtures("variant")
def test_scene_file_keeps_the_lens(tmp_path: Path) -> None:
    """Every coefficient comes back exactly, and the results say that the picture is distorted."""
    view = lens_camera(LENSES["rational"])
    stack = contour_shells(sphere_field(6), layers=2)
    box = trimesh.creation.box((3, 3, 3))
    body = make_part(box.vertices, box.faces)
    loaded = load_scene(write_scene(tmp_path, body, stack, view))
    assert loaded.camera.distortion == view.distortion
    pinhole = load_scene(write_scene(tmp_path, body, stack, lens_camera(None)))
    assert pinhole.camera.distortion is None
    assert '"k1"' not in (tmp_path / "scene.xml").read_text()
