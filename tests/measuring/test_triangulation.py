"""Measured points against exact results: two bent lines to one point, two straight ones back.

Closed forms by Snell's law in plane layers and Bouguer's around a cylinder, symmetries, and lines
in space whose intersection is known.
"""

import json
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from attrs import evolve

from iriftrace.camera.distortion import Distortion
from iriftrace.cli.measure import _say_far_points
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.core.mesh.triangles import cross_rows, row_lengths
from iriftrace.measuring.two_devices.devices import nearest_point, on_plane
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.measuring.two_devices.scan import Scan, ScanStatus
from iriftrace.measuring.two_devices.two_points import MISS_MM, lines_of_sight
from iriftrace.scenes.analytic import slab
from iriftrace.scenes.closed_forms import cylinder_pair_error_um, slab_pair_error_um
from iriftrace.tracing.hot_air import AirState
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.rays import refracted_hits
from iriftrace.tracing.scene import Scene
from iriftrace.tracing.write import write_scene
from validation.inputs.scene_rays import loaded
from validation.inputs.shell_fields import AMBIENT, field_of
from validation.line import beyond
from validation.oracles.aov_by_hand import make_part
from validation.oracles.exact_layers import RoundAir
from validation.sections.two_devices import (
    AIRS,
    BOUNDS,
    SECTION,
    above,
    aside,
    cylinder_scene,
    plate_scene,
)

Scenes = tuple[str, Scene]
"""Name of what bends the rays (`AIRS`), and the scene."""


@pytest.fixture(scope="module", params=AIRS)
def plates(
    request: pytest.FixtureRequest, variant: str, tmp_path_factory: pytest.TempPathFactory
) -> Scenes:
    return request.param, plate_scene(tmp_path_factory.mktemp("slab"), request.param)


@pytest.fixture(scope="module")
def cylinder(variant: str, tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """The hot cylinder by the formula; the air around it is its own image in the plane z = 0."""
    return cylinder_scene(tmp_path_factory.mktemp("cylinder"), "cells engine")


def test_every_point_of_a_plate_is_measured_too_deep_by_fringes(plates: Scenes) -> None:
    """Depth and lateral error by quadrature of Snell's law; the page has the pictures' centres."""
    air, scene = plates
    camera, second = above(20), above(50)
    # The projector's columns must run across the plane of both devices.
    scan = measure(scene, camera, second, system="fringe", phase="both")
    assert len(scan.points) == 25
    slopes = [
        (scan.points - eye.origin)[:, 0] / (scan.points - eye.origin)[:, 2]
        for eye in (camera, second)
    ]
    depth, lateral = np.transpose([slab_pair_error_um(*pair) for pair in zip(*slopes, strict=True)])
    np.testing.assert_allclose(-1e3 * scan.error_normal, depth, rtol=BOUNDS[air] / 100)
    bound = BOUNDS[air] / 100 * depth.max()
    np.testing.assert_allclose(1e3 * scan.error[:, 0], lateral, rtol=0, atol=bound)
    # Rays beside the plane of both devices pass each other.
    assert 1e3 * np.abs(scan.gap).max() < 1e-3 * depth.max()


@pytest.mark.parametrize(
    ("form", "angles", "expected"),
    [
        (slab_pair_error_um, np.tan(np.radians((-15, 15))), (3.38397, 0.0)),
        (slab_pair_error_um, np.tan(np.radians((0, 30))), (4.21001, 0.0)),
        (slab_pair_error_um, np.tan(np.radians((20, 50))), (9.43317, -2.13198)),
        (slab_pair_error_um, np.tan(np.radians((30, 60))), (16.85334, -7.29963)),
        (cylinder_pair_error_um, np.radians((-30, 30)), (-1.959423, 0.0)),
        (cylinder_pair_error_um, np.radians((-60, 60)), (-2.300667, 0.0)),
        (cylinder_pair_error_um, np.radians((30, 60)), (-2.471288, -0.295525)),
    ],
)
def test_closed_forms_agree_with_quadrature_in_forty_digits(
    form: object, angles: np.ndarray, expected: tuple[float, float]
) -> None:
    """Both were derived twice, independently."""
    assert form(*angles) == pytest.approx(expected, abs=2e-5)


@pytest.mark.slow
@pytest.mark.usefixtures("variant")
def test_the_accuracy_page_holds(tmp_path: Path) -> None:
    """Also what a correction leaves of the error."""
    assert beyond(SECTION.compute(tmp_path)) == []


def test_lines_of_sight_pass_their_points_traced_or_foretold(cylinder: Scene) -> None:
    """The last correction of most lines is not traced again: here it is."""
    eye = aside(20)
    points = measure(cylinder, aside(-40), eye, system="stereo").true
    assert not lines_of_sight(cylinder, eye.origin, points, rounds=1).found.any()
    lines = lines_of_sight(cylinder, eye.origin, points, rounds=2)
    assert lines.found.all()
    last_point, along, *_ = refracted_hits(cylinder, eye.origin, lines.direction)
    assert row_lengths(cross_rows(points - last_point, along)).max() <= MISS_MM
    aims = cross_rows(points + lines.offset - eye.origin, lines.direction)
    np.testing.assert_allclose(aims, 0, atol=1e-9)


def test_devices_may_be_exchanged(cylinder: Scene) -> None:
    """Both see the same points, so that the errors at the pictures' centres are the same."""
    devices = aside(-40), aside(20)
    one, other = (measure(cylinder, *pair, system="stereo") for pair in (devices, devices[::-1]))
    np.testing.assert_allclose(one.true, other.true, rtol=0, atol=0.01)
    np.testing.assert_allclose(one.error, other.error, rtol=0, atol=1e-6)


def test_a_mirrored_pair_errs_mirrored(cylinder: Scene) -> None:
    one, other = (
        measure(cylinder, aside(-sign * 50), aside(sign * 20), system="stereo") for sign in (1, -1)
    )
    assert abs(one.error[0, 2]) > 5e-5
    np.testing.assert_allclose(other.error, one.error * (1, 1, -1), rtol=0, atol=2e-6)


def test_a_sideways_gradient_moves_points_by_the_parabolas_sagitta(
    variant: str, tmp_path: Path
) -> None:
    """Both lines bend into the same parabola, L^2 grad n / 2 beside their chords' tangents.

    The gradient lies across the plane of the two devices, and there n is that of the ambient air.
    """
    part, shells = slab(5, air=RoundAir(), size_mm=200.0)
    height, slope, aim = 20.0, 1e-5, 0.4
    cells = pv.RectilinearGrid(np.linspace(-50, 50, 21), np.linspace(-20, 20, 9), (0, 10, height))
    field = field_of(
        cells.cast_to_unstructured_grid().triangulate(),
        lambda points: AMBIENT + slope * (points[:, 1].astype(np.float64) - aim),
    )
    camera, second = above(-30), above(30)
    xml = write_scene(tmp_path, part, AirState(field, ready=shells), camera, paraview=False)
    scene = load_scene(xml, engine="cells")
    scan = measure(scene, camera, second, system="stereo")
    middle = len(scan.points) // 2
    length = height / np.cos(np.radians(30))
    expected = (0.0, -slope * length**2 / (2 * (1 + AMBIENT)), 0.0)
    np.testing.assert_allclose(scan.error[middle], expected, rtol=0, atol=2e-6)
    assert scan.gap[middle] < 2e-6


def test_half_the_contrast_is_half_the_error(variant: str, tmp_path: Path) -> None:
    part, shells = slab(13, air=RoundAir(), size_mm=400.0)
    ambient = shells.shells[0].ext
    half = [
        evolve(
            s,
            refractivity=(s.refractivity + ambient) / 2,
            ext=(s.ext + ambient) / 2,
            int_=(s.int_ + ambient) / 2,
        )
        for s in shells.shells
    ]
    found = [
        measure(loaded(tmp_path / name, part, stack, bending="shells"), above(-30), above(30))
        for name, stack in (("whole", shells), ("half", evolve(shells, shells=half)))
    ]
    whole, less = (np.median(scan.error_normal) for scan in found)
    assert 2 * less / whole == pytest.approx(1.0, abs=1e-3)


def test_a_laser_sheet_errs_as_its_fringe_would(plates: Scenes) -> None:
    """A sheet is one column of a projector, traced the other way round."""
    _, scene = plates
    camera = above(-20)
    fringe = measure(scene, camera, above(20), system="fringe", phase="rows")
    sheet = measure(scene, camera, above(20), system="laser")
    assert len(sheet.points) == 5
    np.testing.assert_allclose(sheet.gap, 0)
    np.testing.assert_allclose(
        np.median(sheet.error_normal), np.median(fringe.error_normal), rtol=5e-3
    )


def test_few_far_points_of_shells_are_stated(
    plates: Scenes, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two of 10,000 points that the shells refract wrongly; the engine's test is a percentile."""
    found = measure(plates[1], above(20), above(50), system="stereo")
    count = np.zeros(10_000, dtype=int)
    normal = found.normal[count]
    true, size = found.true[count], np.linspace(0.001, 0.01, len(count))
    far = np.where(np.arange(len(count)) < 2, 0.0568, size)
    for errors, engine, said in ((size, "shells", ""), (far, "cells", ""), (far, "shells", "2 p")):
        points = true - errors[:, None] * normal
        facts = {**found.provenance, "engine": engine}
        scan = evolve(found, points=points, true=true, normal=normal, provenance=facts)
        _say_far_points(scan)
        printed = " ".join(capsys.readouterr().out.split())
        assert printed.startswith(said)
        assert bool(printed) == bool(said)
    assert "errors of up to 56.8 um, while 99.9% have at most 9.99 um" in printed
    assert "compare with --engine cells" in printed


def test_air_of_one_index_leaves_no_error(
    variant: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    part, shells = slab(13, air=RoundAir())
    even = [evolve(s, ext=shells.shells[0].ext, int_=shells.shells[0].ext) for s in shells.shells]
    stack = evolve(shells, shells=even)
    scene = loaded(tmp_path_factory.mktemp("even"), part, stack, bending="shells")
    scan = measure(scene, above(-30), above(30), system="stereo")
    assert np.abs(scan.error).max() < 1e-6
    # The sheet of a laser whose lens distorts is not flat.
    laser = evolve(above(30), distortion=Distortion(p2=0.004))
    assert np.abs(measure(scene, above(-30), laser, system="laser").error).max() < 1e-6


@pytest.mark.filterwarnings("ignore:.*is not closed")
@pytest.mark.parametrize("towards", [1, -1])
def test_a_sheet_is_measured_from_either_side_but_not_through_it(
    variant: str, tmp_path_factory: pytest.TempPathFactory, towards: int
) -> None:
    """A part without thickness, as the inner side of an open mesh is."""
    _, shells = slab(5, air=RoundAir(), size_mm=400.0)
    corners = np.array([(-50, -50, 0), (50, -50, 0), (50, 50, 0), (-50, 50, 0)], dtype=float)
    faces = np.array([(0, 1, 2), (0, 2, 3)])[:, ::towards]
    scene = loaded(tmp_path_factory.mktemp("sheet"), make_part(corners, faces), shells)
    scan = measure(scene, above(-30), above(30), system="stereo")
    assert (scan.status == ScanStatus.MEASURED).all()
    with pytest.raises(InputError, match="no point of the part in common"):
        measure(scene, above(-30), above(150), system="stereo")


def test_a_step_puts_what_lies_behind_it_into_shadow(
    variant: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """The camera sees the floor, to which a wall hides the second device."""
    import trimesh

    from iriftrace.part.part import part_of_mesh

    _, shells = slab(5, air=RoundAir(), size_mm=400.0)
    floor = trimesh.creation.box((100, 100, 5))
    floor.apply_translation((0, 0, -2.5))
    wall = trimesh.creation.box((1, 100, 10))
    wall.apply_translation((2.0, 0, 5.0))
    both = trimesh.util.concatenate([floor, wall])
    part = part_of_mesh(both.vertices, both.faces, name="step")
    scene = loaded(tmp_path_factory.mktemp("step"), part, shells)
    camera, hidden, free = above(0.1), above(60), above(-60)
    scan = measure(scene, camera, free, system="stereo")
    assert (scan.status == ScanStatus.MEASURED).all()
    with pytest.raises(InputError, match="no point of the part in common"):
        measure(scene, camera, hidden, system="stereo")


def test_best_fit_takes_out_a_rigid_motion(plates: Scenes) -> None:
    """A plate that is measured too deep everywhere alike is a plate elsewhere."""
    _, scene = plates
    scan = measure(scene, above(-15), above(15), system="stereo")
    translation, rotation, left = scan.best_fit()
    assert translation[2] == pytest.approx(-scan.error_normal.mean(), rel=1e-3)
    assert np.abs(left).max() < 0.01 * np.abs(scan.error_normal).max()
    assert np.abs(rotation).max() < 1e-4


def test_lines_in_space_meet_where_they_should() -> None:
    random = np.random.default_rng(5)
    points = random.normal(size=(50, 3))
    eyes = np.array((10.0, 2.0, -3.0)), np.array((-4.0, 9.0, 5.0))
    lines = [(points - eye) / np.linalg.norm(points - eye, axis=1)[:, None] for eye in eyes]
    found, gap = nearest_point(eyes[0], lines[0], eyes[1], lines[1])
    np.testing.assert_allclose(found, points, rtol=0, atol=1e-12)
    np.testing.assert_allclose(gap, 0, atol=1e-12)
    normal = np.cross(lines[1], random.normal(size=(50, 3)))
    np.testing.assert_allclose(
        on_plane(eyes[0], lines[0], eyes[1], normal), points, rtol=0, atol=1e-10
    )
    apart, gap = nearest_point(
        np.zeros(3), np.array([[1.0, 0, 0]]), np.array((0.0, 0, 3.0)), np.array([[0, 1.0, 0]])
    )
    np.testing.assert_allclose(apart, [[0, 0, 1.5]])
    np.testing.assert_allclose(gap, 3)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"second": None}, "no second device"),
        ({"second": above(-20)}, "at one place"),
        ({"system": "radar"}, "no system 'radar'"),
    ],
)
def test_wrong_devices_are_one_sentence(
    plates: Scenes, change: dict[str, object], said: str
) -> None:
    _, scene = plates
    chosen = {"second": above(20), "system": "stereo", **change}
    with pytest.raises(InputError, match=said):
        measure(scene, above(-20), **chosen)


def test_a_small_angle_is_warned_of(plates: Scenes) -> None:
    _, scene = plates
    with pytest.warns(IriftraceWarning, match="farther apart"):
        measure(scene, above(0.0), above(0.5), system="stereo")


def test_a_saved_scan_is_what_was_measured(plates: Scenes, tmp_path: Path) -> None:
    _, scene = plates
    scan: Scan = measure(scene, above(-20), above(20), system="stereo")
    cloud, numbers = scan.save(tmp_path / "scan.vtp")
    read = pv.read(cloud)
    np.testing.assert_array_equal(read.points, scan.points)
    np.testing.assert_array_equal(read["error_normal"], scan.error_normal)
    table = json.loads(numbers.read_text())
    assert table["schema"] == "iriftrace.scan/2"
    assert table["points"]["measured"] == 25
    assert table["error_normal_mm"]["mean"] == pytest.approx(scan.error_normal.mean())
