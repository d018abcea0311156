"""The sensor calibrated_camera against the pinhole's closed form and iriftrace.Camera."""

from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
import trimesh
from attrs import evolve

from iriftrace.camera.camera import Camera
from iriftrace.camera.distortion import Distortion
from iriftrace.camera.pose import look_at
from iriftrace.plugins.calibrated_camera import sensor_of
from iriftrace.plugins.kernels.vertex_table import aligned, aligned_rows
from validation.inputs.lenses import LENSES, lens_camera
from validation.inputs.small_scenes import camera, channels, film, part, scene, vector

pytestmark = pytest.mark.usefixtures("variant")

SENSOR_MM = (6.7, 5.6)
PAPER = {"focal_length": 10.0, "sensor_width": SENSOR_MM[0], "sensor_height": SENSOR_MM[1]}
PAPER_FILM = {"width": 2448, "height": 2048}
POSE = ((150.0, -100.0, 120.0), (3.0, -2.0, 1.0))
DESCRIBED = Camera(
    focal_length_mm=10.0,
    sensor_mm=SENSOR_MM,
    resolution=(2448, 2048),
    principal_point_px=(1209.5, 1030.5),
    matrix=look_at(*POSE),
)


def loaded(origin: Any = POSE[0], target: Any = POSE[1], **more: Any) -> Any:
    return mi.load_dict(camera(origin, target, **{"film": film(**PAPER_FILM), **PAPER, **more}))


def rays(sensor: Any, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    positions = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
    origin, direction = sensor.rays64(*(mi.Float64(aligned(p)) for p in positions.T))
    return np.array(origin).T, np.array(direction).T


def projected(sensor: Any, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    columns = aligned_rows(np.asarray(points, dtype=np.float64))
    x, y, in_front = sensor.project64(mi.Point3d(*columns))
    return np.stack((np.array(x), np.array(y)), axis=1), np.array(in_front)


PIXELS = np.array(
    [(0.5, 0.5), (2447.5, 0.5), (0.5, 2047.5), (2447.5, 2047.5), (1224.0, 1024.0), (700.5, 99.5)]
)


@pytest.mark.parametrize("scale", [0.5, 0.25, 2.0])
def test_scale_changes_the_pixels_not_the_view(scale: float) -> None:
    """The film is resized; the same place of the sensor sees the same direction."""
    whole = loaded(principal_point_x=1200.25, principal_point_y=1030.5)
    sensor = loaded(principal_point_x=1200.25, principal_point_y=1030.5, scale=scale)
    assert tuple(sensor.film().size()) == (2448 * scale, 2048 * scale)
    assert tuple(sensor.film().crop_size()) == (2448 * scale, 2048 * scale)
    _, expected = rays(whole, PIXELS)
    _, directions = rays(sensor, PIXELS * scale)
    np.testing.assert_allclose(directions, expected, atol=1e-15)


def test_scale_rounds_to_whole_pixels() -> None:
    sensor = loaded(scale=0.3, film=film(11, 7))
    assert tuple(sensor.film().size()) == (3, 2)
    assert sensor.description()["sensor_mm"] == [6.7, 5.6]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"focal_length": 0.0}, "Focal length is 0.0 mm"),
        ({"focal_length": -10.0}, "Focal length is -10.0 mm"),
        ({"focal_length": "10"}, "\"focal_length\" is '10', not a number"),
        ({"sensor_width": 0.0}, "Sensor size is 0.0 x 5.6 mm"),
        ({"sensor_height": float("nan")}, '"sensor_height" is nan'),
        ({"focus_near": 250.0, "focus_far": 50.0}, "Focus interval 250.0 to 50.0 mm is empty"),
        ({"focus_near": -1.0}, "Focus interval -1.0 to inf mm"),
        ({"scale": 0.0}, "scale is 0.0"),
        ({"scale": "0.5s"}, "\"scale\" is '0.5s', not a number"),
        (
            {"scale": 0.5, "film": film(64, 48, crop_width=8, crop_height=8)},
            "The film has a crop window.*use either",
        ),
        ({"fov": 40.0}, "unreferenced property"),
    ],
)
def test_wrong_parameters_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(RuntimeError, match=message):
        loaded(**changes)


def test_missing_focal_length_is_named() -> None:
    with pytest.raises(RuntimeError, match='"focal_length" is missing'):
        mi.load_dict({"type": "calibrated_camera", "sensor_width": 6.7, "sensor_height": 5.6})


def test_scaling_pose_is_refused() -> None:
    with pytest.raises(RuntimeError, match="not a rigid motion"):
        loaded(to_world=mi.ScalarTransform4d().scale([1, 1, 2]))


def test_pose_is_read_in_double_precision() -> None:
    """In single precision an origin of 1234.56789 mm is off by 5e-5 mm."""
    origin = (1234.56789012345, -987.654321098765, 111.222333444555)
    found, _ = rays(loaded(origin, (0.0, 0.0, 0.0)), PIXELS[:1])
    np.testing.assert_array_equal(found[0], origin)


def test_it_equals_the_numpy_camera() -> None:
    """The description it gives makes a Camera with the same rays, and back through sensor_of.

    The sensor counts from the film's edge, the camera from the first pixel's centre.
    """
    described = evolve(DESCRIBED, focus_mm=(50.0, 250.0))
    sensor = loaded(
        principal_point_x=1210.0, principal_point_y=1031.0, focus_near=50.0, focus_far=250.0
    )
    for found in (sensor, sensor_of(described)):
        assert Camera.from_dict(found.description()).focus_mm == (50.0, 250.0)
        np.testing.assert_allclose(
            Camera.from_dict(found.description()).matrix, described.matrix, atol=1e-14
        )
        origins, directions = rays(found, PIXELS)
        expected = described.rays(PIXELS - 0.5)
        np.testing.assert_allclose(origins, expected[0], atol=1e-12)
        np.testing.assert_allclose(directions, expected[1], atol=1e-14)
        points = expected[0] + 170 * expected[1]
        pixels, _ = projected(found, points)
        np.testing.assert_allclose(pixels - 0.5, described.project(points), atol=1e-9)


def test_single_precision_rays_agree() -> None:
    """sample_ray serves other integrators: positions from 0 to 1 over the film."""
    sensor = loaded()
    positions = PIXELS / (2448, 2048)
    for sample in (sensor.sample_ray, sensor.sample_ray_differential):
        ray, weight = sample(0.0, 0.5, mi.Point2f(*positions.T), mi.Point2f(0.5), mi.Mask(True))
        origins, directions = rays(sensor, PIXELS)
        np.testing.assert_allclose(np.array(ray.o).T, np.broadcast_to(origins, (6, 3)), atol=2e-5)
        np.testing.assert_allclose(np.array(ray.d).T, directions, atol=1e-6)
        np.testing.assert_allclose(np.array(weight), 1)


def test_crop_window_shows_a_part_of_the_whole_picture() -> None:
    """Positions 0..1 go over the window, and rays64 keeps counting from the sensor's edge."""
    window = film(
        **PAPER_FILM, crop_offset_x=600, crop_offset_y=300, crop_width=200, crop_height=100
    )
    sensor, whole = loaded(film=window), loaded()
    ray, _ = sensor.sample_ray(0.0, 0.5, mi.Point2f(0.5025, 0.505), mi.Point2f(0.5), mi.Mask(True))
    _, expected = rays(whole, np.array([(700.5, 350.5)]))
    np.testing.assert_allclose(np.array(ray.d).T, expected, atol=1e-6)
    np.testing.assert_array_equal(rays(sensor, PIXELS)[1], rays(whole, PIXELS)[1])


def test_traverse_moves_the_camera_and_keeps_its_lens() -> None:
    """Another pose without another scene, also through the scene's own parameters."""
    sensor = loaded(k1=-0.2)
    loaded_scene = mi.load_dict({"type": "scene", "sensor": sensor})
    elsewhere = ((20.0, 300.0, -5.0), (1.0, 0.0, 2.0))
    parameters = mi.traverse(loaded_scene)
    key = next(key for key in parameters.keys() if key.endswith("to_world"))
    parameters[key] = mi.Transform4d().look_at(*elsewhere, [0, 0, 1])
    parameters.update()
    expected = rays(loaded(*elsewhere, k1=-0.2), PIXELS)
    found = rays(loaded_scene.sensors()[0], PIXELS)
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-13)
    np.testing.assert_allclose(
        loaded_scene.sensors()[0].description()["matrix"], look_at(*elsewhere), atol=1e-13
    )


def cubes(*centres: tuple[float, float, float]) -> trimesh.Trimesh:
    """Small cubes as one mesh; face f belongs to cube f // 12."""
    return trimesh.util.concatenate(
        [
            trimesh.creation.box((4, 4, 4), transform=trimesh.transformations.translation_matrix(c))
            for c in centres
        ]
    )


@pytest.mark.parametrize("heading_deg", [0, 90, 200])
def test_up_is_up_and_right_is_right_in_the_rendered_picture(
    tmp_path: Path, heading_deg: float
) -> None:
    """A horizontal camera: row 0 of the picture is world +z, the last column its right hand."""
    heading = np.radians(heading_deg)
    forward = np.array((np.cos(heading), np.sin(heading), 0.0))
    right = np.array((np.sin(heading), -np.cos(heading), 0.0))
    centres = [tuple(c) for c in (15 * np.array((0, 0, 1)), 20 * right, (0.0, 0.0, 0.0))]
    pixels = channels(
        scene({"part": part(tmp_path, cubes(*centres))}, camera(tuple(-100 * forward), (0, 0, 0)))
    )
    cube = np.where(pixels["part.face"] > 0, (pixels["part.face"] - 1) // 12, -1)
    middle = [np.argwhere(cube == k).mean(axis=0) for k in range(3)]
    above, beside, centre = middle
    # The picture is 48 x 40 pixels of 60 x 50 mm at the cubes' distance.
    np.testing.assert_allclose(centre, (19.5, 23.5), atol=0.6)
    np.testing.assert_allclose(above - centre, (-15 * 40 / 50, 0), atol=0.6)
    np.testing.assert_allclose(beside - centre, (0, 20 * 48 / 60), atol=0.6)
    hits = vector(pixels, "straight")
    assert (hits[cube == 0][:, 2] > 12).all()
    assert (hits[cube == 1] @ right > 17).all()


@pytest.mark.parametrize("lens", [None, *LENSES.values()], ids=["pinhole", *LENSES])
def test_any_lens_equals_the_numpy_camera(lens: Distortion | None) -> None:
    """Rays, and their projection to 1e-10 px; tests/camera has closed forms and OpenCV."""
    described = lens_camera(lens)
    distortion = {} if lens is None else lens.as_dict()
    by_hand = loaded(principal_point_x=1210.0, principal_point_y=1031.0, **distortion)
    pixels = np.random.default_rng(1).uniform(0, (2448, 2048), (5000, 2))
    pixels[: len(PIXELS)] = PIXELS
    for sensor in (by_hand, sensor_of(described)):
        assert Camera.from_dict(sensor.description()).distortion == lens
        origins, directions = rays(sensor, pixels)
        np.testing.assert_allclose(directions, described.rays(pixels - 0.5)[1], rtol=0, atol=1e-15)
        found, in_front = projected(sensor, origins + 200 * directions)
        assert in_front.all()
        np.testing.assert_allclose(found, pixels, rtol=0, atol=1e-10)


def test_zero_coefficients_are_a_pinhole_to_the_last_bit() -> None:
    zero = loaded(k1=0.0, k2=0.0, k3=0.0, k4=0.0, k5=0.0, k6=0.0, p1=0.0, p2=0.0)
    pinhole = loaded()
    assert zero.description() == pinhole.description()
    np.testing.assert_array_equal(rays(zero, PIXELS)[1], rays(pinhole, PIXELS)[1])


def test_lenses_that_fold_the_picture_are_refused() -> None:
    with pytest.raises(RuntimeError, match="turns back inside the picture"):
        loaded(k1=-3.0)
    with pytest.raises(RuntimeError, match="\"k6\" is '1', not a number"):
        loaded(k6="1")


def test_directions_beyond_the_fold_are_not_seen() -> None:
    """k1 = -1 turns back at 30 degrees: what lies at 45 would be seen at the centre once more."""
    narrow = {"sensor_width": 2.0, "sensor_height": 2.0, "film": film(200, 200)}
    sensor = loaded((0, 0, 0), (0, 1, 0), k1=-1.0, **narrow)
    position, in_front = projected(sensor, np.array([(0.0, 50.0, 0.0), (50.0, 50.0, 0.0)]))
    np.testing.assert_allclose(position, [(100, 100), (100, 100)], atol=1e-9)
    assert in_front.tolist() == [True, False]
    # 2 mm beside the axis nothing is seen by any ray (the radius reaches 3.85 mm at most).
    _, directions = rays(sensor, np.array([(199.5, 100.0), (100.0, 600.0)]))
    assert np.isfinite(directions[0]).all()
    assert np.isnan(directions[1]).all()
