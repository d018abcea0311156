"""Hits as Dr.Jit arrays: the numbers of pictures and bundles, for both kinds of scenes."""

import warnings
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import iriftrace
from iriftrace.core.errors import InputError, IriftraceWarning
from validation.inputs.small_scenes import ball_in_shells, camera

pytestmark = pytest.mark.usefixtures("variant")


@pytest.fixture
def scene(tmp_path: Path) -> mi.Scene:
    content = {"type": "scene", "integrator": {"type": "first_hit"}, "sensor": camera()}
    return mi.load_dict({**content, **ball_in_shells(tmp_path)}, optimize=False)


def test_pixels_have_the_numbers_of_the_picture(scene: mi.Scene) -> None:
    hits = iriftrace.hits(scene)
    channels = np.array(mi.render(scene))
    names = [field.name for field in scene.sensors()[0].film().bitmap().struct_()]
    rows = channels.reshape(-1, len(names))[np.array(hits.ray)]
    found: dict[str, Any] = {
        "straight.Y": hits.straight.y,
        "refracted.X": hits.refracted.x,
        "displacement.Z": hits.displacement.z,
        "shift.px.X": hits.shift_px[0],
        "shift.px.Y": hits.shift_px[1],
        "incidence.angle": hits.incidence,
        "status.code": hits.status,
    }
    for name, values in found.items():
        np.testing.assert_array_equal(np.float32(values), rows[:, names.index(name)])
    assert len(rows) > 100
    assert np.abs(rows[:, names.index("shift.px.X")]).max() > 0


def test_rays_have_the_numbers_of_trace_rays(scene: mi.Scene) -> None:
    origins = np.array([(1.0, -100.0, 2.0), (3.0, -100.0, -2.0), (80.0, -100.0, 0.0)])
    rays = mi.Point3d(origins.T), mi.Vector3d(0, 1, 0)
    expected = iriftrace.trace_rays(
        iriftrace.from_mitsuba(scene), origins, np.tile((0.0, 1.0, 0.0), (3, 1))
    )
    for of in (scene, iriftrace.from_mitsuba(scene)):
        hits = iriftrace.hits(of, rays)
        assert np.array(hits.ray).tolist() == [0, 1]
        np.testing.assert_array_equal(np.array(hits.refracted).T, expected.refracted[:2])
        np.testing.assert_array_equal(np.array(hits.face), expected.face[:2])
        np.testing.assert_array_equal(np.array(hits.refracted_face), expected.refracted_face[:2])
        assert hits.shift_px is None


def test_a_scene_is_traced_as_mi_traverse_has_changed_it(scene: mi.Scene) -> None:
    before = np.array(iriftrace.hits(scene).displacement)
    parameters = mi.traverse(scene)
    for k in (1, 2, 3):
        for name in (f"shell_{k}.bsdf.ext_ior", f"shell_{k}.bsdf.int_ior"):
            parameters[name] = 1.0 + 2.0 * (parameters[name] - 1.0)
    parameters.update()
    after = np.array(iriftrace.hits(scene).displacement)
    np.testing.assert_allclose(after, 2 * before, rtol=0, atol=1e-3 * np.abs(before).max())


def test_hits_are_attached_to_the_rays_that_are_given(scene: mi.Scene) -> None:
    """The straight hit on a face moves along it with the ray."""
    moved = mi.Float64(0.0)
    dr.enable_grad(moved)
    origin = mi.Point3d(1.0, -100.0, 2.0) + mi.Vector3d(moved, 0, 0)
    hits = iriftrace.hits(scene, (origin, mi.Vector3d(0, 1, 0)))
    dr.backward(hits.straight.x)
    assert float(dr.grad(moved)[0]) == pytest.approx(1.0, abs=1e-12)


def test_no_hit_is_an_error(scene: mi.Scene) -> None:
    with pytest.raises(InputError, match="No ray hits the part"):
        iriftrace.hits(scene, (mi.Point3d(0, -100, 0), mi.Vector3d(0, -1, 0)))


def test_mitsubas_own_integrators_take_the_calibrated_camera() -> None:
    """They name the arguments of its rays."""
    lit = mi.load_dict(
        {
            "type": "scene",
            "sensor": camera(),
            "part": {"type": "sphere", "radius": 10.0},
            "lamp": {"type": "constant"},
        }
    )
    with warnings.catch_warnings():  # of shells, which other tests have loaded
        warnings.simplefilter("ignore", IriftraceWarning)
        picture = np.array(mi.render(lit, integrator=mi.load_dict({"type": "prb"}), spp=4))
    assert np.isfinite(picture).all()
    assert picture.max() > 0
