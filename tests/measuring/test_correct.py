"""Correction of clouds: what a simulated measurement got wrong is taken out again.

Against the true points of the simulation, on the part and beside it.
"""

import json
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from attrs import evolve
from scipy.spatial.transform import Rotation

from iriftrace.camera.camera import Camera
from iriftrace.camera.distortion import Distortion
from iriftrace.camera.pose import look_at
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.image.aov_image import Status
from iriftrace.io.field import read_field
from iriftrace.io.part_files import read_part
from iriftrace.io.ply import read_ply
from iriftrace.measuring.features.fit import fit_feature
from iriftrace.measuring.two_devices.budget import feature_budget
from iriftrace.measuring.two_devices.correct import correct
from iriftrace.measuring.two_devices.correction_status import CorrectionStatus
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.measuring.two_devices.scan import Scan, ScanStatus
from iriftrace.measuring.uncertainty.air_groups import BEYOND
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.rays import trace_rays
from iriftrace.tracing.render import render_scene
from iriftrace.tracing.scene import Scene
from iriftrace.tracing.write import write_scene
from validation.inputs import hot_block
from validation.inputs.cameras import camera_at


def _devices(width: int, height: int) -> list[Camera]:
    return [
        camera_at((x, -190.0, -110.0), sensor_mm=(6.7, 5.6), resolution=(width, height))
        for x in (-35.0, 35.0)
    ]


DEVICES = _devices(122, 102)


@pytest.fixture(scope="module", params=["shells", "cells"])
def scene(request: pytest.FixtureRequest, variant: str) -> Scene:
    return load_scene(folder_of("cylinder") / "scene.xml", variant=variant, engine=request.param)


@pytest.fixture(scope="module")
def scan(scene: Scene) -> Scan:
    return measure(
        scene, *DEVICES, system="fringe" if scene.compiled.engine == "shells" else "stereo"
    )


ONCE = pytest.mark.parametrize("scene", ["shells"], indirect=True, scope="module")
"""For what does not depend on the engine and on the devices."""


def test_no_pixel_that_sees_the_part_is_left_out(scan: Scan, scene: Scene) -> None:
    """Rays outside the part's outline are not traced; here all of the picture's are."""
    camera = DEVICES[0]
    width, height = camera.resolution
    row, column = np.divmod(np.arange(width * height), width)
    hits = trace_rays(
        scene, *camera.rays(np.column_stack((column, row))), trace_all=False, coherent=True
    )
    seen = np.zeros(width * height, dtype=bool)
    seen[hits.ray[np.isin(hits.status, (Status.GOOD, Status.INDEX_MISMATCH))]] = True
    np.testing.assert_array_equal(scan.status.ravel() != ScanStatus.NOT_SEEN, seen)


def test_what_was_simulated_is_taken_out(scan: Scan, scene: Scene) -> None:
    """Within 10 nm for 99 % of the points."""
    assert (scan.status == ScanStatus.MEASURED).sum() > 1500
    found = correct(scan.points, scene, *DEVICES, system=scan.system)
    good = found.status == CorrectionStatus.CORRECTED
    assert good.mean() > 0.97
    before = np.linalg.norm(scan.error, axis=1)
    left = np.linalg.norm(found.points - scan.true, axis=1)[good]
    assert np.median(before) > 1e-3
    assert np.quantile(left, 0.99) < 1e-5
    np.testing.assert_array_equal(found.points[~good], scan.points[~good])


def _turned(laser: Camera, degrees: float) -> Camera:
    """The laser with its sheet turned about the axis through it that lies in the sheet."""
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_rotvec((0.0, degrees, 0.0), degrees=True).as_matrix()
    return laser.at(laser.matrix @ turn)


@pytest.fixture(scope="module")
def lines(scene: Scene) -> list[Scan]:
    """Lines across the part of a laser whose sheet is turned from line to line."""
    camera, laser = _devices(488, 408)
    laser = laser.at(look_at(laser.origin, (0.0, 0.0, 0.0), (1.0, 0.0, 1.0)))
    return [
        measure(scene, camera, _turned(laser, angle), system="laser") for angle in (0.0, -3.0, 5.0)
    ]


def test_a_laser_line_is_taken_out(lines: list[Scan], scene: Scene) -> None:
    """Within 10 nm; the sheet of light is bent too, so the points are not on the flat one."""
    line = lines[0]
    assert len(line.points) > 50
    with warnings.catch_warnings():
        warnings.simplefilter("error", IriftraceWarning)
        found = correct(line.points, scene, line.camera, line.second, system="laser")
    assert (found.status == CorrectionStatus.CORRECTED).all()
    flat = line.second.matrix[:3, 0]
    assert np.abs((line.points - line.second.origin) @ flat).max() < 1e-9
    assert np.abs((line.true - line.second.origin) @ flat).max() > 1e-3
    assert np.abs(found.points - line.true).max() < 1e-5
    assert "turned" in found.provenance["assumptions"]["sheet"]


def test_one_line_determines_no_surface(lines: list[Scan], scene: Scene) -> None:
    """With noise its points are not in a plane, and a cylinder of 800 m fits them."""
    line = lines[0]
    noise = np.random.default_rng(3).normal(0.0, 0.005, line.points.shape)
    found = correct(line.points + noise, scene, line.camera, line.second, system="laser")
    for cloud in (line, found):
        with pytest.warns(IriftraceWarning, match="cylinder:lateral is left out: one line"):
            assert cloud.features(scene.part, ["cylinder:lateral"]) == ()
        (circle,) = cloud.features(scene.part, ["circle:lateral"])
        assert circle.points > 50


def test_lines_of_a_turned_sheet_are_taken_out_together(lines: list[Scan], scene: Scene) -> None:
    """A whole scan is a cloud of all lines; that the laser stood still is an assumption."""
    points, true = (
        np.vstack([getattr(line, name) for line in lines]) for name in ("points", "true")
    )
    off = np.abs((points - lines[0].second.origin) @ lines[0].second.matrix[:3, 0]).max()
    with pytest.warns(
        IriftraceWarning, match=f"off the laser's sheet, by up to {off:.2g}.* turned"
    ):
        found = correct(points, scene, lines[0].camera, lines[0].second, system="laser")
    assert (found.status == CorrectionStatus.CORRECTED).all()
    assert np.abs(found.points - true).max() < 1e-5
    assert None not in [region.measured for region in found.regions(scene.part)]
    (feature,) = found.features(scene.part)
    cold = fit_feature(true, "cylinder").size_mm
    assert abs(feature.size.by_cloud["corrected"] - cold) < 1e-4
    assert abs(feature.size.by_cloud["measured"] - cold) > 2e-3


def test_down_a_plume_it_goes_on_until_points_stay(variant: str) -> None:
    """Errors of a tenth of a millimetre that change by a third of each step; within 10 nm again."""
    field = load_scene(folder_of("cylinder") / "scene.xml", variant=variant, engine="cells")
    above = [
        one.at(look_at((x, 0.1, 240.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
        for one, x in zip(DEVICES, (-40.0, 40.0), strict=True)
    ]
    scan = measure(field, *above, system="fringe")
    assert np.median(np.linalg.norm(scan.error, axis=1)) > 0.05
    found = correct(scan.points, field, *above, system="fringe")
    assert (found.status == CorrectionStatus.CORRECTED).mean() > 0.99
    assert np.quantile(np.linalg.norm(found.points - scan.true, axis=1), 0.99) < 1e-5


@ONCE
def test_order_and_number_of_the_points_do_not_matter(
    scan: Scan, scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Large clouds are corrected piece by piece. Nothing but rounding may differ."""
    order = np.random.default_rng(2).permutation(len(scan.points))
    one = correct(scan.points, scene, *DEVICES, system=scan.system)
    monkeypatch.setattr(sys.modules[correct.__module__], "PIECE", 700)
    other = correct(scan.points[order], scene, *DEVICES, system=scan.system)
    np.testing.assert_array_equal(other.measured, scan.points[order])
    np.testing.assert_array_equal(other.status, one.status[order])
    np.testing.assert_array_equal(other.face, one.face[order])
    np.testing.assert_allclose(other.error, one.error[order], rtol=0, atol=1e-9)


def test_where_the_field_does_not_reach_points_stay(variant: str, tmp_path: Path) -> None:
    """A file with the half y > 0 of the air around a block: lines to its other side meet none.

    A budget corrects the points that it simulates in this air as little.
    """
    camera, second = (camera_at((x, -60.0, 90.0), focal_length_mm=20.0) for x in (-25.0, 25.0))
    air, part_file = hot_block.save(tmp_path)
    part, whole = read_part(part_file), pv.read(air)
    behind = np.flatnonzero(np.asarray(whole.cell_centers().points)[:, 1] > 0)
    whole.extract_cells(behind).save(tmp_path / "half.vtu")
    scenes = [
        load_scene(
            write_scene(tmp_path / name, part, contour_shells(read_field(file), 4), camera),
            variant=variant,
        )
        for name, file in (("whole", air), ("half", tmp_path / "half.vtu"))
    ]
    scan = measure(scenes[0], camera, second, system="stereo")
    half = evolve(scenes[1], second=second, second_id="camera_2")
    budget = feature_budget(half, choices=["plane:"])
    for found in (correct(scan.points, half), budget.correction):
        front, top = found.normal[:, 1] < -0.5, found.points[:, 1] > 4.0
        assert front.sum() > 50
        assert top.sum() > 20
        assert (found.status[front] == CorrectionStatus.OUTSIDE_FIELD).all()
        assert (found.status[top] == CorrectionStatus.CORRECTED).mean() > 0.9
        np.testing.assert_array_equal(found.points[front], found.measured[front])
    (plane,) = budget.features
    assert plane.not_corrected > 50
    assert BEYOND in plane.doubts
    level = [camera_at((x, -90.0, 0.0), focal_length_mm=20.0) for x in (-25.0, 25.0)]
    with pytest.raises(InputError, match="seen through hot air"):
        feature_budget(evolve(half, camera=level[0], second=level[1]))


@ONCE
def test_a_cloud_of_the_other_side_is_refused(scene: Scene) -> None:
    """The devices look from -y."""
    part = scene.part
    behind = part.face_centres[part.face_normals[:, 1] > 0.7]
    with pytest.raises(InputError, match=f"None of the {len(behind)} points .* hidden"):
        correct(behind, scene, *DEVICES, system="stereo")


def test_points_beside_the_part_are_corrected_too(scan: Scan, scene: Scene) -> None:
    """The part is 0.2 mm thicker than its model; a layer some millimetres thick changes by 10 %."""
    thicker = scan.points + 0.2 * scan.normal
    # Of a cylinder's side alone that may be heat as well.
    with pytest.warns(IriftraceWarning, match="1.48 % larger than the part .* unless it was made"):
        found = correct(thicker, scene, *DEVICES, system=scan.system)
    good = found.status == CorrectionStatus.CORRECTED
    assert good.mean() > 0.9
    size = np.linalg.norm(scan.error, axis=1)
    off = np.linalg.norm(found.error - scan.error, axis=1)[good]
    assert np.median(off) < 0.1 * np.median(size)


@pytest.mark.parametrize("noise_mm", [-0.015, 0.015])
def test_noise_does_not_decide_which_points_are_corrected(
    scan: Scan, scene: Scene, noise_mm: float
) -> None:
    """At silhouettes rays to points out of the material miss the part, others meet it."""
    noisy = correct(scan.points + noise_mm * scan.normal, scene, *DEVICES, system=scan.system)
    assert (noisy.status == CorrectionStatus.CORRECTED).all()
    np.testing.assert_array_equal(
        scene.part.region_of_face[noisy.face], scene.part.region_of_face[scan.face]
    )


def test_the_diameter_comes_out_as_it_is(scan: Scan, scene: Scene) -> None:
    """Air makes the cylinder micrometres too small; the correction gives its own fit back."""
    found = correct(scan.points, scene, *DEVICES, system=scan.system)
    good = found.status == CorrectionStatus.CORRECTED
    cold, hot, corrected = (
        fit_feature(points[good], "cylinder").size_mm
        for points in (scan.true, scan.points, found.points)
    )
    assert 1.0 < 1e3 * (cold - hot) < 20.0
    assert 1e3 * abs(corrected - cold) < 0.02


@ONCE
@pytest.mark.parametrize("what", ["scan", "correction"])
def test_ply_and_vtp_hold_the_same_numbers(
    scan: Scan, scene: Scene, what: str, tmp_path: Path
) -> None:
    """In double precision, bit for bit, and whole numbers as such."""
    saved = scan if what == "scan" else correct(scan.points, scene, *DEVICES, system=scan.system)
    saved.save(tmp_path / "cloud.vtp")
    saved.save(tmp_path / "cloud.ply")
    vtp = pv.read(tmp_path / "cloud.vtp")
    ply = read_ply(tmp_path / "cloud.ply")
    np.testing.assert_array_equal(ply.vertices, vtp.points)
    assert set(ply.vertex_columns) == {"x", "y", "z", *vtp.point_data}
    for name, column in vtp.point_data.items():
        np.testing.assert_array_equal(ply.vertex_columns[name], column)
        assert ply.vertex_columns[name].dtype == column.dtype
    assert ply.vertex_columns["status"].dtype == np.int32
    field = f"field: {saved.provenance['assumptions']['field_origin']}"
    assert vtp.field_data["field"].tolist() == [field]
    assert f"comment {field}\n".encode() in (tmp_path / "cloud.ply").read_bytes()
    counts = json.loads((tmp_path / "cloud.json").read_text())["points"]
    status = saved.status
    assert counts["measured" if what == "scan" else "corrected"] == (status == 0).sum()


@ONCE
def test_other_devices_than_those_that_measured_are_noticed(scan: Scan, scene: Scene) -> None:
    """Part of what they would have measured is hidden from them."""
    turned = [
        one.at(look_at((x, 190.0, -110.0), (0.0, 0.0, 0.0)))
        for one, x in zip(DEVICES, (-35.0, 35.0), strict=True)
    ]
    both = np.concatenate((scan.points, measure(scene, *turned, system=scan.system).points))
    with pytest.warns(IriftraceWarning, match="of the points are hidden from one of the scene's"):
        correct(both, scene, *DEVICES, system=scan.system)


@ONCE
def test_a_table_under_the_part_is_left_as_it_is(scan: Scan, scene: Scene) -> None:
    """Nine of ten points; some below the part, where the devices cannot see them."""
    count, low = 9 * len(scan.points), scene.part.bounds[1, 2] + 3.0
    table = np.random.default_rng(1).uniform((-90, -90, low), (90, 90, low), (count, 3))
    points = np.vstack((scan.points, table))
    with pytest.warns(IriftraceWarning, match="90% of the points are far from the part"):
        found = correct(points, scene, *DEVICES, system=scan.system)
    alone = correct(scan.points, scene, *DEVICES, system=scan.system)
    assert (found.status[-count:] == CorrectionStatus.FAR_FROM_PART).all()
    np.testing.assert_array_equal(found.status[:-count], alone.status)
    np.testing.assert_allclose(found.error[:-count], alone.error, atol=1e-9)
    with pytest.raises(InputError, match="mm from the part"):
        correct(points + np.array((0.0, 9.0, 6.0)), scene, *DEVICES, system=scan.system)


@ONCE
def test_points_that_no_device_can_see_stay_as_measured(scan: Scan, scene: Scene) -> None:
    """Behind a device, or so far beside its picture that the lens distortion folds there."""
    lens = Distortion(k1=-0.2)
    camera, second = (evolve(device, distortion=lens) for device in DEVICES)
    outliers = [(0.0, -300.0, -200.0), (2000.0, 0.0, 0.0)]
    points = np.vstack((scan.points[::20], outliers))
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        found = correct(points, scene, camera, second, system=scan.system)
    assert (found.status[-2:] == CorrectionStatus.OUTSIDE_VIEW).all()
    assert (found.status[:-2] == CorrectionStatus.CORRECTED).mean() > 0.9
    np.testing.assert_array_equal(found.points[-2:], outliers)


@ONCE
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda points: points / 1e3, "another unit"),
        (lambda points: points[:0], "n > 0 points"),
        (lambda points: points[:, :2], "n > 0 points"),
        (lambda points: points * np.nan, "not finite"),
        (lambda points: points + 50.0, "mm from the part"),
    ],
)
def test_wrong_clouds_are_one_sentence(scan: Scan, scene: Scene, change: object, said: str) -> None:
    with pytest.raises(InputError, match=said):
        correct(change(scan.points), scene, *DEVICES, system=scan.system)


def test_devices_in_hot_air_are_refused_as_by_render(scene: Scene, scan: Scan) -> None:
    """Their lines of sight would begin with bending that is not known."""
    inside = DEVICES[0].at(look_at(scene.part.bounds[1] + (0.5, 0.0, 0.0), scene.part.centre))
    with pytest.raises(InputError) as of_render:
        render_scene(scene, camera=inside)
    for devices, name in (((inside, DEVICES[1]), "camera"), ((DEVICES[0], inside), "second")):
        with pytest.raises(InputError, match=f"The {name}.* stands in the hot air") as caught:
            correct(scan.points, scene, *devices, system="stereo")
        assert caught.value.code == of_render.value.code == "camera.inside"
        with pytest.raises(InputError, match=f"The {name}.* stands in the hot air"):
            measure(evolve(scene, camera=devices[0], second=devices[1]), system="stereo")
