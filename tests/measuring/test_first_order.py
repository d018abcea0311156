"""Errors to first order: plane layers by the formula, and the exact solver on a real field."""

import numpy as np
import pytest

from iriftrace.camera.camera import Camera
from iriftrace.core.mesh.triangles import unit_vectors
from iriftrace.measuring.features.fit import fit_feature
from iriftrace.measuring.two_devices.devices import Sensor
from iriftrace.measuring.two_devices.first_order import first_order_error, first_order_size
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.rays import trace_rays
from validation.inputs.cameras import camera_at

J_MM = 2.5e-3
"""Integral of n0 - n over the height of the layers."""


def device(slope: float) -> Camera:
    """A camera 300 mm above the origin, at x = slope x 300 mm, whose columns run along y."""
    return camera_at((300.0 * slope, 0.0, 300.0), up=(0.0, 1.0, 0.0), resolution=(120, 100))


def offset(slope: float) -> np.ndarray:
    """Of the line with x = slope z at z = 0: Snell's law moves it by J t (1 + t^2) along x."""
    line = np.array((slope, 0.0, 1.0)) / np.hypot(slope, 1.0)
    moved = np.array((J_MM * slope * (1.0 + slope**2), 0.0, 0.0))
    return (moved - line * (line @ moved))[None]


@pytest.mark.parametrize("system", ["fringe", "stereo", "laser"])
@pytest.mark.parametrize(("tc", "tp"), [(-0.3, 0.3), (0.0, 0.6), (0.4, 1.2)])
def test_plane_layers(system: str, tc: float, tp: float) -> None:
    """Depth J (1 + tc^2 + tc tp + tp^2), lateral -J tc tp (tc + tp), whatever the sensor."""
    sensor = Sensor.of(device(tc), device(tp), system)
    error = first_order_error(sensor, np.zeros((1, 3)), offset(tc), offset(tp))
    expected = (-J_MM * tc * tp * (tc + tp), 0.0, -J_MM * (1 + tc**2 + tc * tp + tp**2))
    assert error[0] == pytest.approx(expected, abs=1e-12)


@pytest.mark.usefixtures("variant")
def test_the_exact_solver_differs_in_the_second_order_alone() -> None:
    """On the bundled cylinder, where two devices err by micrometres."""
    scene = load_scene(folder_of("fringe_cylinder") / "scene.xml", {"scale": 0.05})
    scan = measure(scene)
    offsets = []
    for one in (scene.camera, scene.second):
        sight = unit_vectors(scan.true - one.origin)
        moved = trace_rays(scene, np.broadcast_to(one.origin, sight.shape), sight).displacement
        offsets.append(sight * np.einsum("ij,ij->i", sight, moved)[:, None] - moved)
    known = np.isfinite(offsets[0] + offsets[1]).all(axis=1)
    sensor = Sensor.of(scene.camera, scene.second, "fringe", scan.phase)
    found = first_order_error(sensor, scan.true[known], *(o[known] for o in offsets))
    left = np.linalg.norm(found - scan.error[known], axis=1)
    size = np.linalg.norm(scan.error[known], axis=1)
    assert known.mean() > 0.98
    assert np.median(left) < 0.01 * np.median(size)
    assert np.quantile(left, 0.95) < 0.05 * np.median(size)


@pytest.mark.parametrize("kind", ["cylinder", "sphere"])
def test_a_diameter_to_first_order_is_that_of_the_fit(kind: str) -> None:
    """On an arc, where small errors along it change the diameter by more than themselves."""
    rng = np.random.default_rng(3)
    angle, height = rng.uniform(-0.8, 0.8, 500), rng.uniform(-1.0, 1.0, 500)
    normal = np.stack((np.cos(angle), np.sin(angle), 0 * angle), axis=1)
    if kind == "sphere":
        normal = np.stack((np.cos(angle), np.sin(angle), height), axis=1)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
    points = np.array((3.0, -2.0, 1.0)) + 13.5 * normal
    if kind == "cylinder":
        points[:, 2] += 20.0 * height
    error = 1e-5 * (normal * np.cos(3 * angle)[:, None] + rng.normal(size=points.shape))
    fitted = fit_feature(points + error, kind).size_mm
    assert fitted is not None
    found = first_order_size(points, normal, error, np.ones(500))
    assert found == pytest.approx(fitted - 27.0, rel=1e-3)
    assert abs(found) > 1e-5
