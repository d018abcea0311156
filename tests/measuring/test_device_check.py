"""A cloud and the devices that should have measured it, against closed forms of pinhole cameras.

Both devices look along y at a cylinder about x, whose ends lie outside their pictures.
"""

import numpy as np
import pytest

from iriftrace.camera.camera import Camera
from iriftrace.camera.pose import look_at
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.measuring.two_devices.correct import correct
from iriftrace.measuring.two_devices.correction_status import CorrectionStatus
from iriftrace.measuring.two_devices.device_check import check_devices
from iriftrace.measuring.two_devices.devices import Sensor
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.scene import Scene

AWAY, APART, FOCAL, WIDTH = 220.0, 20.0, 12.0, 6.7  # mm
DEVICES = [
    Camera(
        matrix=look_at((x, -AWAY, 0.0), (x, 0.0, 0.0), (0.0, 0.0, 1.0)),
        focal_length_mm=FOCAL,
        sensor_mm=(WIDTH, 5.6),
        resolution=(1224, 1024),
    )
    for x in (-APART, APART)
]
SENSOR = Sensor.of(*DEVICES, "stereo")
ALONG = np.array((1.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def scene(variant: str) -> Scene:
    return load_scene(folder_of("cylinder") / "scene.xml", variant=variant, engine="shells")


@pytest.fixture(scope="module")
def cloud(scene: Scene) -> FloatArray:
    """Points of the part's side that both devices see."""
    surface = scene.part.surface
    places, face = surface.even_places(20_000)
    seen = surface.normals[face][:, 1] < -0.4
    return places[seen & ~_outside(places)]


def _outside(points: FloatArray) -> np.ndarray:
    """Mask of points beyond the left or right edge of a picture, by similar triangles."""
    reach = WIDTH / 2 / FOCAL * (points[:, 1] + AWAY)
    return np.any([np.abs(points[:, 0] - x) > reach for x in (-APART, APART)], axis=0)


def test_the_devices_own_cloud_is_not_warned_of(cloud: FloatArray, scene: Scene) -> None:
    """All warnings are errors in tests."""
    assert len(cloud) > 300
    found = correct(cloud, scene, *DEVICES, pixels=DEVICES[0].project(cloud))
    assert (found.status == CorrectionStatus.CORRECTED).mean() > 0.99


def test_30_mm_along_the_part_lie_outside_the_pictures(cloud: FloatArray, scene: Scene) -> None:
    moved = cloud + 30.0 * ALONG
    outside = _outside(moved).mean()
    assert outside > 0.3
    with pytest.warns(IriftraceWarning, match=f"^{outside:.0%} of .* or lie outside") as caught:
        correct(moved, scene, *DEVICES)
    assert len(caught) == 1
    assert "hit the part" in str(caught[0].message)
    status = np.full(len(moved), CorrectionStatus.CORRECTED)
    check = check_devices(moved, status, scene, SENSOR)
    assert check.unseen == pytest.approx(outside, abs=1e-12)
    # They still lie on the part.
    assert check.to_hit_mm == pytest.approx(0.0, abs=1e-3)


def test_hidden_points_are_as_far_from_the_hits_as_the_part_is_thick(
    cloud: FloatArray, scene: Scene
) -> None:
    """Of points on the back, by the quadratic equation of a line and a cylinder."""
    behind = cloud * (1.0, -1.0, 1.0)
    status = np.full(len(behind), CorrectionStatus.HIDDEN)
    status[: len(behind) // 10] = CorrectionStatus.CORRECTED
    check = check_devices(behind, status, scene, SENSOR)
    assert check.unseen == pytest.approx(0.9, abs=0.01)
    towards = DEVICES[0].origin - behind
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    across, place = towards[:, 1:], behind[:, 1:]
    chord = -2 * np.einsum("ij,ij->i", across, place) / np.einsum("ij,ij->i", across, across)
    assert check.to_hit_mm == pytest.approx(np.median(chord), abs=0.05)


def test_pixels_show_a_millimetre_along_the_part(cloud: FloatArray, scene: Scene) -> None:
    """It is f / z for each; without the pixels it stays unseen."""
    pixels = DEVICES[0].project(cloud)
    moved = cloud + ALONG
    focal_px = FOCAL / WIDTH * 1224
    off_px = np.median(focal_px / (moved[:, 1] + AWAY))
    correct(moved, scene, *DEVICES)
    with pytest.warns(IriftraceWarning, match=f"{off_px:.3g} px .1 mm, medians.* motion"):
        correct(moved, scene, *DEVICES, pixels=pixels)
    # Of the other points nothing is known.
    pixels[::3] = np.nan
    status = np.full(len(moved), CorrectionStatus.CORRECTED)
    check = check_devices(moved, status, scene, SENSOR, pixels)
    known = np.isfinite(pixels[:, 0])
    of_known = np.median(focal_px / (moved[known, 1] + AWAY))
    assert check.off == pytest.approx((of_known, 1.0), abs=1e-9)
    assert check_devices(moved, status, scene, SENSOR, np.full_like(pixels, np.nan)).off is None


def test_half_a_pixel_is_a_convention(cloud: FloatArray, scene: Scene) -> None:
    """Whole numbers at the corners of pixels instead of their centres."""
    correct(cloud, scene, *DEVICES, pixels=DEVICES[0].project(cloud) + 0.5)


@pytest.mark.parametrize("scale", [0.25, 0.5, 2.0])
def test_a_resized_picture_has_the_same_lines_of_sight(
    cloud: FloatArray, scene: Scene, scale: float
) -> None:
    """Pixel centres are whole numbers; a shift along the part is seen in it as well."""
    pixels = scale * (DEVICES[0].project(cloud) + 0.5) - 0.5
    correct(cloud, scene, *DEVICES, pixels=pixels)
    with pytest.warns(IriftraceWarning, match="from their pixels"):
        correct(cloud + 5.0 * ALONG, scene, *DEVICES, pixels=pixels)


def test_pixels_of_other_points_are_refused(cloud: FloatArray, scene: Scene) -> None:
    with pytest.raises(InputError, match=r"\(3, 2\), but there are"):
        correct(cloud, scene, *DEVICES, pixels=np.zeros((3, 2)))
