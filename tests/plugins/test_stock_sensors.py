"""Sensors of Mitsuba itself with the integrator first_hit: perspective, orthographic, others."""

import re
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

import iriftrace
from iriftrace.core.errors import InputError
from iriftrace.image.aov_image import Status
from iriftrace.plugins.film import camera_of
from validation.inputs.cameras import camera_at
from validation.inputs.small_scenes import (
    channels,
    film,
    scene,
    vector,
)

pytestmark = pytest.mark.usefixtures("variant")


def perspective(**more: Any) -> dict[str, Any]:
    """Mitsuba's own sensor with the view of small_scenes.camera()."""
    return {
        "type": "perspective",
        "fov": float(2 * np.degrees(np.arctan(0.3))),
        "fov_axis": "x",
        "near_clip": 1.0,
        "to_world": mi.ScalarTransform4f().look_at([0, -100, 0], [0, 0, 0], [0, 0, 1]),
        "film": film(),
        **more,
    }


def test_stock_perspective_sensor_gives_the_same_hits(shapes: dict[str, Any]) -> None:
    """Within single precision of its rays (1e-7 of 100 mm, over the cosine of incidence); its path
    counts from the near plane."""
    own, stock = channels(scene(shapes)), channels(scene(shapes, perspective()))
    both = (own["status.code"] == 0) & (stock["status.code"] == 0)
    assert (own["status.code"] != stock["status.code"]).sum() <= 2
    grazing = both & (own["incidence.angle"] > np.radians(80))
    clear = both & ~grazing
    for name in ("straight", "refracted"):
        np.testing.assert_allclose(vector(stock, name)[clear], vector(own, name)[clear], atol=2e-4)
    np.testing.assert_allclose(
        vector(stock, "displacement")[clear],
        vector(own, "displacement")[clear],
        atol=2e-8,
        rtol=0.01,
    )
    for axis in "XY":
        np.testing.assert_allclose(
            stock[f"shift.px.{axis}"][clear], own[f"shift.px.{axis}"][clear], atol=1e-8, rtol=0.01
        )
    _, directions = camera_at().rays()
    skipped = (1.0 / directions[:, 1]).reshape(40, 48)
    np.testing.assert_allclose(
        (own["path.length"] - stock["path.length"])[clear], skipped[clear], atol=2e-4
    )


def test_stock_orthographic_sensor_gives_parallel_rays(shapes: dict[str, Any]) -> None:
    """to_world scales the picture to +-30 mm; each hit lies behind its pixel's centre."""
    sensor = {
        "type": "orthographic",
        "to_world": mi.ScalarTransform4f().look_at([0, -100, 0], [0, 0, 0], [0, 0, 1])
        @ mi.ScalarTransform4f().scale([30, 30, 1]),
        "film": film(),
    }
    pixels = channels(scene(shapes, sensor))
    good = pixels["status.code"] == 0
    assert 150 < good.sum() < 250  # the ball's disc has 201 pixels of 1.25 mm
    columns, rows = np.meshgrid(np.arange(48), np.arange(40))
    hits = vector(pixels, "straight")
    np.testing.assert_allclose(hits[good][:, 0], (columns[good] - 23.5) * 60 / 48, atol=1e-4)
    np.testing.assert_allclose(hits[good][:, 2], (19.5 - rows[good]) * 60 / 48, atol=1e-4)
    bent = vector(pixels, "refracted")[good]
    shift = np.stack((-bent[:, 0], bent[:, 2]), axis=1) * 48 / 60
    expected = np.stack((columns[good] - 23.5, rows[good] - 19.5), axis=1) + shift
    found = np.stack((pixels["shift.px.X"], pixels["shift.px.Y"]), axis=-1)[good]
    np.testing.assert_allclose(found, expected, atol=1e-4)
    assert np.abs(found).max() > 3e-4


@pytest.mark.parametrize("sensor_type", ["perspective", "orthographic"])
def test_projection_of_stock_sensors_is_the_inverse_of_their_rays(sensor_type: str) -> None:
    """Principal point, crop window and scale have the sign that Mitsuba gives them."""
    pose = mi.ScalarTransform4f().look_at([30, -100, 20], [1, 2, 3], [0, 0, 1])
    window = film(crop_offset_x=10, crop_offset_y=5, crop_width=20, crop_height=30)
    more = (
        {"fov": 40.0, "principal_point_offset_x": 0.1, "principal_point_offset_y": -0.2}
        if sensor_type == "perspective"
        else {}
    )
    if sensor_type == "orthographic":
        pose = pose @ mi.ScalarTransform4f().scale([30, 30, 1])
    sensor = camera_of(
        mi.load_dict({"type": sensor_type, "to_world": pose, "film": window, **more})
    )
    pinhole = sensor_type == "perspective"
    assert sensor.description()["projection"] == ("pinhole" if pinhole else "orthographic")
    x, y = np.array((10.5, 29.5, 20.0)), np.array((5.5, 34.5, 17.0))
    origin, direction = sensor.rays64(mi.Float64(x), mi.Float64(y))
    found = sensor.project64(origin + 77.0 * direction)
    np.testing.assert_allclose(np.array(found[0]), x, atol=1e-4)
    np.testing.assert_allclose(np.array(found[1]), y, atol=1e-4)


@pytest.mark.parametrize("sensor_type", ["perspective", "orthographic"])
def test_a_near_plane_in_the_hot_air_is_named(shapes: dict[str, Any], sensor_type: str) -> None:
    """Rays that start there miss the shells before it: all had status 5, and other advice."""
    sensor = perspective(near_clip=82.0)
    if sensor_type == "orthographic":
        pose = sensor["to_world"] @ mi.ScalarTransform4f().scale([30, 30, 1])
        sensor = {"type": "orthographic", "near_clip": 82.0, "to_world": pose, "film": film()}
    loaded = scene(shapes, sensor)
    words = "near_clip 82 mm in front of it, and there inside the hot air.* lower near_clip"
    with pytest.raises(RuntimeError) as caught:
        mi.render(loaded)
    assert re.search(words, str(caught.value.__cause__))
    with pytest.raises(InputError, match=words):
        iriftrace.render_scene(iriftrace.from_mitsuba(loaded))
    sensor["near_clip"] = 79.0
    status = channels(scene(shapes, sensor))["status.code"]
    assert set(status.ravel()) == {Status.GOOD, Status.MISSED}


def test_sensors_without_a_picture_plane_are_refused(shapes: dict[str, Any]) -> None:
    loaded = scene(shapes, {"type": "thinlens", "aperture_radius": 1.0, "film": film()})
    with pytest.raises(InputError, match="ThinLensCamera, which has no picture plane"):
        channels(loaded)
