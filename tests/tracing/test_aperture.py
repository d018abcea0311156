"""Rays over a lens through plane layers of hot air, whose shift is a closed form of the angle."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import iriftrace
from iriftrace.camera.camera import Camera
from iriftrace.core.errors import InputError
from iriftrace.scenes import folder_of
from iriftrace.scenes.closed_forms import slab_shift_um
from iriftrace.tracing.aperture import aperture_effect
from iriftrace.tracing.hot_air import HotAir
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.scene import Scene
from validation.inputs.cameras import camera_at
from validation.inputs.shell_fields import scaled

HEIGHT_MM = 150.0
F_NUMBER = 2.0
RMS_MM = 10.0 / F_NUMBER / 2.0 / math.sqrt(2.0)
"""Root mean square distance of the lens's points from its centre."""

pytestmark = pytest.mark.usefixtures("variant")


@pytest.fixture(scope="module")
def slab() -> Scene:
    return load_scene(folder_of("slab") / "scene.xml")


def above(**more: Any) -> Camera:
    """A camera that looks straight down at the plate, within 2 degrees."""
    return camera_at(
        (0.0, 0.0, HEIGHT_MM),
        up=(1.0, 0.0, 0.0),
        sensor_mm=(0.5, 0.5),
        resolution=(200, 200),
        **more,
    )


def test_a_shift_that_is_linear_in_the_angle_blurs_without_a_bias(slab: Scene) -> None:
    """The blur is the derivative of the shift by the angle times the lens's rms angle."""
    camera = above()
    found = aperture_effect(slab, F_NUMBER, camera=camera, focus_mm=HEIGHT_MM, pixels=200)
    slope_mm = 1e-3 * slab_shift_um(1.0) / math.tan(math.radians(1.0))
    px_per_mm = camera.focal_px[0] / HEIGHT_MM
    expected = slope_mm * RMS_MM / HEIGHT_MM * px_per_mm
    np.testing.assert_allclose(found.blur, expected, rtol=0.02)
    assert np.linalg.norm(found.bias, axis=1).max() < 0.01 * expected
    np.testing.assert_allclose(found.defocus, 0.0, atol=1e-6)
    assert (found.cut, len(found.pixel)) == (0, 200)
    # The pinhole's own shift is that of each pixel's angle.
    offset = (found.pixel - camera.principal_point_px) / camera.focal_px
    np.testing.assert_allclose(found.shift, -offset * slope_mm * px_per_mm, atol=0.02 * expected)


@pytest.mark.filterwarnings("ignore:fewer than 4 rays")
def test_bias_and_blur_of_a_slanted_view_are_those_of_the_closed_form(slab: Scene) -> None:
    """By Gauss's rule over the lens, for the pixel in the middle of the picture."""
    camera = camera_at(
        (130.0, 0.0, 75.0), up=(0.0, 0.0, 1.0), sensor_mm=(1e-3, 1e-3), resolution=(1, 1)
    )
    distance = math.hypot(130.0, 75.0)
    found = aperture_effect(slab, 1.0, camera=camera, focus_mm=distance, samples=64, pixels=1)
    nodes, weights = np.polynomial.legendre.leggauss(12)
    radius = 5.0 * np.sqrt((nodes + 1.0) / 2.0)
    turn = 2.0 * math.pi * np.arange(24) / 24
    places = np.array([(r * math.cos(a), r * math.sin(a)) for r in radius for a in turn])
    weight = np.repeat(weights / 2.0 / len(turn), len(turn))
    start = camera.origin + places @ camera.matrix[:3, :2].T
    across = -start[:, :2]  # the plane in focus meets the plate at the origin
    tangent = np.linalg.norm(across, axis=1) / start[:, 2]
    moved = 1e-3 * np.array([slab_shift_um(math.degrees(math.atan(t))) for t in tangent])
    hits = np.zeros((len(start), 3))
    hits[:, :2] = moved[:, None] * across / np.linalg.norm(across, axis=1)[:, None]
    shifts = camera.project(np.zeros((1, 3))) - camera.project(hits)
    centre_mm = 1e-3 * slab_shift_um(math.degrees(math.atan(130.0 / 75.0)))
    pinhole = camera.project(np.zeros((1, 3))) - camera.project([[-centre_mm, 0.0, 0.0]])
    mean = weight @ shifts
    blur = math.sqrt(weight @ np.square(shifts - mean).sum(axis=1))
    np.testing.assert_allclose(found.shift, pinhole, rtol=0.02, atol=1e-6)
    drawn = iriftrace.render_scene(slab, camera=camera).image
    pixel = [drawn.channels[f"shift.px.{axis}"][0, 0] for axis in "XY"]
    np.testing.assert_allclose(found.shift[0], pixel, rtol=1e-3, atol=1e-6)
    bias = mean - pinhole[0]
    np.testing.assert_allclose(found.bias[0], bias, atol=0.05 * np.linalg.norm(bias))
    np.testing.assert_allclose(found.blur, blur, rtol=0.04)
    assert abs(found.bias).max() > 1e-3 * abs(found.shift).max()


def test_without_hot_air_only_what_is_out_of_focus_is_blurred(slab: Scene) -> None:
    cold = HotAir(shells=scaled(slab.air.states[0].shells, -1.0))
    scene = Scene(slab.part, cold, above(), engine="shells")
    sharp = aperture_effect(scene, F_NUMBER, focus_mm=HEIGHT_MM, pixels=50)
    for values in (sharp.shift, sharp.bias, sharp.blur, sharp.defocus):
        np.testing.assert_allclose(values, 0.0, atol=1e-6)
    before = aperture_effect(scene, F_NUMBER, focus_mm=100.0, pixels=50)
    expected = RMS_MM * (1.0 / 100.0 - 1.0 / HEIGHT_MM) * above().focal_px[0]
    np.testing.assert_allclose(before.defocus, expected, rtol=1e-3)
    np.testing.assert_allclose(before.blur, 0.0, atol=1e-6)


def test_the_lens_is_focused_in_the_middle_of_the_interval(slab: Scene) -> None:
    camera = above(focus_mm=(140.0, 160.0))
    found = aperture_effect(slab, 4.0, camera=camera, pixels=10).as_dict()
    assert found["focus_mm"] == HEIGHT_MM
    assert found["pixels"] == 10
    assert found["defocus_px"]["median"] == pytest.approx(0.0, abs=1e-6)


def test_without_an_interval_the_lens_is_focused_on_the_parts_middle(slab: Scene) -> None:
    camera = above()
    found = aperture_effect(slab, 4.0, camera=camera, pixels=10)
    assert found.focus_mm == pytest.approx(camera.origin[2] - slab.part.centre[2])


@pytest.mark.parametrize(
    ("options", "code"),
    [
        ({"f_number": 0.0}, "aperture.not_positive"),
        ({"f_number": 4.0, "focus_mm": -1.0}, "camera.focus_distance"),
        ({"f_number": 4.0, "focus_mm": 150.0, "samples": 5}, "aperture.samples"),
    ],
)
def test_wrong_values_are_refused(slab: Scene, options: dict[str, Any], code: str) -> None:
    focus = {"focus_mm": 150.0} if options["f_number"] == 0.0 else {}
    with pytest.raises(InputError) as error:
        aperture_effect(slab, camera=above(), **{**focus, **options})
    assert error.value.code == code
