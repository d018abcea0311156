"""Prints in photographs: what OpenCV finds in them, against the truth."""

import runpy
from pathlib import Path

import attrs
import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.spatial import cKDTree

import iriftrace
from iriftrace.part.standards import plate
from validation.inputs.leaning_air import (
    BOARD,
    BOARD_CAMERA,
    UPRIGHT,
    hot_block_part,
    leaning,
    measured_shifts,
)

pytestmark = [
    pytest.mark.usefixtures("variant"),
    pytest.mark.filterwarnings("ignore:Hits of this view"),
]

SCRIPT = Path(__file__).parents[2] / "docs" / "examples" / "board_shifts.py"


@pytest.fixture(scope="module")
def scene(variant: str, tmp_path_factory: pytest.TempPathFactory) -> iriftrace.Scene:
    """A board behind a hot block, 720 x 600 px."""
    return iriftrace.Scene(
        BOARD.part.transformed(UPRIGHT),
        iriftrace.HotAir(leaning(0.3, tmp_path_factory.mktemp("air")), layers=9),
        BOARD_CAMERA.scaled(0.3),
        blockers=[hot_block_part()],
        engine="shells",
    )


def test_flow_finds_the_shift(scene: iriftrace.Scene) -> None:
    """DIS optical flow (Kroeger, 2016) of a random pattern, with the noise of the sensor."""
    white = np.random.default_rng(1).random((140, 140))
    taken = iriftrace.photograph(
        attrs.evolve(scene, camera=BOARD_CAMERA.scaled(0.2)),
        air="both",
        part=iriftrace.Appearance(0.1, printed=iriftrace.Bitmap(white, 70.0), to_world=UPRIGHT),
        samples=2,
    )
    hot, cold = ((taken.pictures[name] >> 8).astype(np.uint8) for name in ("hot", "cold"))
    flow = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    flow.setFinestScale(0)
    true = np.stack([taken.truth.channels[f"shift.px.{axis}"] for axis in "XY"], axis=-1)
    # From the hot picture to the place of the same point in the cold one.
    off = np.linalg.norm(flow.calc(hot, cold, None) + true, axis=-1)
    good = taken.truth.channels["status.code"] == 0
    large = np.linalg.norm(true, axis=-1) > 0.15
    assert np.median(off[good]) < 0.03
    assert (good & large).sum() > 5000
    assert np.median(off[good & large]) < 0.03


def test_dots_lie_where_they_are_printed(scene: iriftrace.Scene) -> None:
    taken = iriftrace.photograph(
        scene,
        air="both",
        part=iriftrace.Appearance(0.1, printed=iriftrace.Dots.of_board(BOARD), to_world=UPRIGHT),
        blockers=iriftrace.Appearance(temperature="1100 degC"),
        ambient=1.0,
        samples=2,
        seed=None,
    )
    script = runpy.run_path(str(SCRIPT))
    places, shifts = script["pair"](
        *(script["find_dots"](taken.pictures[name]) for name in ("cold", "hot"))
    )
    exact = measured_shifts(scene, 0.0)
    distance, number = cKDTree(places).query(exact.places)
    there = distance < 1.0
    assert there.mean() > 0.9
    off = places[number[there]] - exact.places[there]
    assert np.linalg.norm(off, axis=1).max() < 0.02
    # A dot's hot picture is the mean of many rays, its exact shift that of one ray.
    moved = shifts[number[there]] - exact.shifts[there]
    assert np.median(np.linalg.norm(moved, axis=1)) < 0.02
    assert np.abs(exact.shifts).max() > 0.4


def test_a_block_casts_its_shadow_on_the_board(scene: iriftrace.Scene) -> None:
    """Points whose straight line to the light runs through the block are dark; others are not."""
    light = BOARD_CAMERA.at(iriftrace.look_at((60.0, -120.0, 20.0), (0.0, 60.0, 10.0)))
    lit = attrs.evolve(scene, camera=BOARD_CAMERA.scaled(0.1), second=light)
    taken = iriftrace.photograph(
        lit, air="cold", light=iriftrace.Light(), ambient=0.0, samples=1, seed=None
    )
    channels = taken.truth.channels
    on_board = (channels["part.face"] > 0) & (channels["status.code"] == 0)
    points = np.stack([channels[f"straight.{axis}"] for axis in "XYZ"], axis=-1)[on_board]
    low, high = hot_block_part().bounds
    along = light.origin - points
    ends = np.sort((np.stack((low, high)) - points[:, None]) / along[:, None], axis=1)
    hidden = ends[:, 0].max(axis=1) < ends[:, 1].min(axis=1)
    bright = taken.electrons["cold"][on_board] > 0.0
    assert 200 < hidden.sum() < 0.9 * len(hidden)
    assert (bright == ~hidden).mean() > 0.98
    place = np.stack([channels[f"second.cold.px.{axis}"] for axis in "XY"], axis=-1)[on_board]
    np.testing.assert_allclose(place[bright], light.project(points[bright]), atol=1e-2)


def saddles(picture: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Saddle points (n, 2), px, of a picture that is blurred by 2 px, by Newton's method."""
    orders = ((0, 1), (1, 0), (0, 2), (2, 0), (1, 1))
    slopes = [gaussian_filter(picture, 2.0, order=order) for order in orders]
    for _ in range(6):
        x, y, xx, yy, xy = (map_coordinates(one, places[:, ::-1].T) for one in slopes)
        step = np.stack((yy * x - xy * y, xx * y - xy * x), axis=1)
        places = places - step / (xx * yy - xy**2)[:, None]
    return places


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The part does not fill")
def test_checkerboards_give_the_camera_back(scene: iriftrace.Scene, tmp_path: Path) -> None:
    """Found by OpenCV, refined to the saddle points, and calibrated by OpenCV."""
    board = iriftrace.Checkerboard((10, 7), 8.0)
    camera = iriftrace.Camera(
        focal_length_mm=12.0,
        sensor_mm=(6.4, 4.8),
        resolution=(640, 480),
        principal_point_px=(325.3, 236.1),
        matrix=iriftrace.look_at((0.0, 0.0, 250.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    )
    scene = iriftrace.Scene(
        plate(90.0, 65.0, 2.0, cells=1), scene.air, camera, engine="shells"
    ).ready
    column, row = np.meshgrid(np.arange(9.0), np.arange(6.0))
    corners = np.stack((column - 4.0, 2.5 - row, 0.0 * row), axis=-1).reshape(-1, 3) * 8.0
    found = []
    for number in range(8):
        turn = 0.75 * np.pi * number
        place = (141.0 * np.cos(turn), 141.0 * np.sin(turn), 206.0)
        target = (10.0 * np.cos(2.0 * number), 8.0 * np.sin(2.0 * number), 0.0)
        up = (np.sin(0.5 * np.pi * number), np.cos(0.5 * np.pi * number), 0.0)
        posed = attrs.evolve(scene, camera=camera.at(iriftrace.look_at(place, target, up)))
        taken = iriftrace.photograph(
            posed,
            air="cold",
            part=iriftrace.Appearance(0.1, printed=board),
            samples=2,
            seed=number,
        )
        picture = taken.pictures["cold"]
        seen, rough = cv2.findChessboardCornersSB((picture >> 8).astype(np.uint8), (9, 6))
        assert seen
        places = saddles(picture.astype(np.float64), rough.reshape(-1, 2).astype(np.float64))
        # OpenCV may begin at the opposite corner.
        true = posed.camera.project(corners)
        places = min((places, places[::-1]), key=lambda one: np.abs(one - true).max())
        assert np.sqrt(np.mean((places - true) ** 2)) < 0.015
        found.append(places.astype(np.float32)[:, None])
    objects = [corners.astype(np.float32)] * len(found)
    start = cv2.initCameraMatrix2D(objects, found, camera.resolution)
    fixed = cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3 | cv2.CALIB_ZERO_TANGENT_DIST
    fixed |= cv2.CALIB_USE_INTRINSIC_GUESS | cv2.CALIB_FIX_ASPECT_RATIO
    _, matrix, *_ = cv2.calibrateCamera(objects, found, camera.resolution, start, None, flags=fixed)
    assert matrix[0, 0] == pytest.approx(camera.focal_px[0], rel=2e-4)
    np.testing.assert_allclose(matrix[:2, 2], camera.principal_point_px, atol=0.1)


def test_an_exposure_is_the_mean_over_the_members(scene: iriftrace.Scene, tmp_path: Path) -> None:
    """By weight, with the exposure time given; so is the place of the truth."""
    fields = [leaning(lean, tmp_path) for lean in (0.1, 0.5)]
    camera = BOARD_CAMERA.scaled(0.05)
    options = {
        "part": iriftrace.Appearance(0.1, printed=iriftrace.Dots.of_board(BOARD), to_world=UPRIGHT),
        "sensor": iriftrace.ImageSensor(exposure="1 ms"),
        "samples": 2,
        "seed": None,
    }

    def electrons(air: iriftrace.HotAir) -> np.ndarray:
        one = attrs.evolve(scene, air=air, camera=camera)
        return iriftrace.photograph(one, **options).electrons["hot"]

    both = electrons(iriftrace.HotAir(fields, layers=9, weights=(1.0, 3.0)))
    first, second = (electrons(iriftrace.HotAir(one, layers=9)) for one in fields)
    assert np.abs(first - second).max() > 0.01 * first.max()
    np.testing.assert_allclose(both, 0.25 * first + 0.75 * second, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    "printed",
    [
        iriftrace.Checkerboard((3, 2), 10.0),
        iriftrace.Dots([(0.0, 0.0), (12.0, 3.0)], [6.0, 4.0]),
        iriftrace.Bitmap(np.arange(12.0).reshape(3, 4) / 11.0, 40.0),
    ],
)
def test_blur_keeps_the_ink(printed: object) -> None:
    """The mean over the print is the same for samples of any size."""
    axis = np.arange(-30.0, 30.0, 0.25) + 0.125
    places = np.stack([each.ravel() for each in np.meshgrid(axis, axis)], axis=1)
    sharp, blurred = (
        printed.ink(places, np.full((len(places), 2), width)).mean()  # type: ignore[attr-defined]
        for width in (0.01, 0.5)
    )
    assert 0.01 < sharp < 0.3
    assert blurred == pytest.approx(sharp, rel=0.02)
