"""Scenes that were made with Mitsuba itself, for the rest of the package."""

import re
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

import iriftrace
import iriftrace.plugins
from iriftrace.core.errors import InputError
from iriftrace.scenes import folder_of
from iriftrace.tracing import engine

SCENE = folder_of("cylinder") / "scene.xml"
SCALE = "0.02"


@pytest.fixture(scope="module")
def own() -> iriftrace.Scene:
    iriftrace.plugins.register()
    return iriftrace.from_mitsuba(mi.load_file(str(SCENE), optimize=False, scale=SCALE))


@pytest.mark.filterwarnings("ignore::iriftrace.IriftraceWarning")
def test_its_picture_and_rays_are_those_of_the_same_file(own: iriftrace.Scene) -> None:
    of_file = iriftrace.load_scene(SCENE, {"scale": SCALE}, engine="shells")
    one, other = (iriftrace.render_scene(scene).image for scene in (own, of_file))
    assert (one.channels["status.code"] == iriftrace.Status.GOOD).any()
    assert one.channels.keys() == other.channels.keys()
    for name, channel in one.channels.items():
        np.testing.assert_array_equal(channel, other.channels[name], err_msg=name)
    origins, directions = (rays[:50] for rays in own.camera.rays())
    hits, expected = (iriftrace.trace_rays(scene, origins, directions) for scene in (own, of_file))
    np.testing.assert_array_equal(hits.refracted, expected.refracted)
    assert own.compiled.stated.source is None
    assert own.part.vertices.shape == of_file.part.vertices.shape


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"integrator": {"type": "path"}}, "integrator PathIntegrator.*first_hit"),
        ({"integrator": {"type": "first_hit"}}, "Your mi.Scene has no sensor"),
    ],
)
def test_what_cannot_be_traced_is_refused(content: dict[str, Any], words: str) -> None:
    iriftrace.plugins.register()
    with pytest.raises(InputError, match=words):
        iriftrace.from_mitsuba(mi.load_dict({"type": "scene", **content}))


def test_a_file_is_loaded_by_another_function() -> None:
    with pytest.raises(InputError, match=r"takes a mitsuba\.Scene.*not a str; `load_scene`"):
        iriftrace.from_mitsuba("scene.xml")  # type: ignore[arg-type]


@pytest.mark.filterwarnings("ignore::iriftrace.IriftraceWarning")
def test_a_large_picture_of_parallel_rays_is_tested_as_it_is(
    own: iriftrace.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """There is no sensor of this kind with fewer pixels to test the shells with."""
    film = {"type": "hdrfilm", "width": 48, "height": 40, "rfilter": {"type": "box"}}
    sensor = {
        "type": "orthographic",
        "to_world": mi.ScalarTransform4f().look_at([150, -100, 120], [0, 0, 0], [0, 0, 1])
        @ mi.ScalarTransform4f().scale([60, 60, 1]),
        "film": {**film, "pixel_format": "luminance", "component_format": "float32"},
    }
    shapes = {shape.id(): shape for shape in own.compiled.mitsuba_scene.shapes()}
    content = {"type": "scene", "integrator": {"type": "first_hit"}, "sensor": sensor, **shapes}
    flat = iriftrace.from_mitsuba(mi.load_dict(content, optimize=False))
    expected = iriftrace.render_scene(flat)
    monkeypatch.setattr(engine, "PIXELS", 1000)
    found = iriftrace.render_scene(flat)
    assert found.metrics.engine_test == expected.metrics.engine_test is not None


TWO_DEVICES = folder_of("fringe_cylinder") / "scene.xml"


@pytest.mark.parametrize("scale", ["0.1", "0.2", "0.5"])
def test_two_devices_whose_films_mitsuba_merged_are_refused(scale: str) -> None:
    """Its optimize=True makes equal films one, which scale then shrank twice."""
    iriftrace.plugins.register()
    merged = mi.load_file(str(TWO_DEVICES), scale=scale)
    words = r"'camera' and 'projector' share one film.*optimize=False"
    with pytest.raises(InputError, match=words):
        iriftrace.from_mitsuba(merged)
    for number in (0, 1):
        with pytest.raises(RuntimeError) as caught:
            mi.render(merged, sensor=number)
        assert re.search(words, str(caught.value.__cause__))


@pytest.mark.parametrize("scale", ["0.1", "0.2", "0.5"])
def test_two_devices_are_those_of_the_same_file(scale: str) -> None:
    iriftrace.plugins.register()
    own = iriftrace.from_mitsuba(mi.load_file(str(TWO_DEVICES), optimize=False, scale=scale))
    of_file = iriftrace.load_scene(TWO_DEVICES, {"scale": scale}, engine="shells")
    assert own.second is not None
    assert of_file.second is not None
    assert own.camera.as_dict() == of_file.camera.as_dict()
    assert own.second.as_dict() == of_file.second.as_dict()
    if scale == "0.1":
        one, other = (iriftrace.measure(scene) for scene in (own, of_file))
        np.testing.assert_array_equal(one.points, other.points)


def test_a_stock_integrators_picture_is_no_corner_of_the_view() -> None:
    """The film was shrunk for another sensor after the camera had made it its own."""
    iriftrace.plugins.register()
    merged = mi.load_file(str(TWO_DEVICES), scale="0.1")
    with pytest.raises(RuntimeError) as caught:
        mi.render(merged, integrator=mi.load_dict({"type": "direct"}), spp=1)
    assert re.search(r"24 x 20 px.* optimize=False", str(caught.value.__cause__))
