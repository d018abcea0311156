"""Poses and free bundles of rays, against each other and Snell's law; input that is refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from attrs import evolve

from iriftrace.camera.pose import look_at
from iriftrace.core.errors import InputError
from iriftrace.image.aov_image import CHANNELS, Status
from iriftrace.io.exr import read_exr
from iriftrace.medium.shells.stack import Shell, ShellStack
from iriftrace.part.part import part_of_mesh
from iriftrace.scenes import folder_of
from iriftrace.scenes.analytic import slab
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.rays import trace_rays
from iriftrace.tracing.render import render_scene
from iriftrace.tracing.scene import Scene
from iriftrace.tracing.write import write_scene
from validation.inputs.cameras import camera_at
from validation.inputs.small_scenes import sphere

pytestmark = pytest.mark.usefixtures("variant")

CAMERA = camera_at(
    (0.0, -120.0, 60.0), sensor_mm=(6.7, 5.6), resolution=(152, 128), focus_mm=(50.0, 250.0)
)
INDICES = (2.72e-4, 2.4e-4, 2.1e-4, 1.8e-4)


@pytest.fixture
def xml(tmp_path: Path) -> Path:
    """A ball of 12 mm in closed shells of 24, 20 and 16 mm."""
    ball = sphere(12.0, 2)
    part = part_of_mesh(ball.vertices, ball.faces, name="ball")
    air = slab(1)[1].air
    shells = [
        Shell(
            layer=k + 1,
            refractivity=(INDICES[k] + INDICES[k + 1]) / 2,
            ext=INDICES[k],
            int_=INDICES[k + 1],
            vertices=sphere(radius).vertices,
            faces=sphere(radius).faces,
            normals=sphere(1.0).vertices,
        )
        for k, radius in enumerate((24.0, 20.0, 16.0))
    ]
    stack = ShellStack(shells, air, "custom")
    return write_scene(tmp_path / "scene", part, stack, CAMERA, paraview=False)


@pytest.fixture
def scene(xml: Path) -> Scene:
    return load_scene(xml)


def test_camera_of_the_scene_and_a_camera_given_agree(scene: Scene) -> None:
    """The same pose through the XML and as a Camera: the same picture but for the last digit of
    the lookat in the file."""
    own = render_scene(scene)
    given = render_scene(scene, camera=CAMERA)
    assert own.metrics.rays == given.metrics.rays
    for name in CHANNELS:
        np.testing.assert_allclose(
            given.image.channels[name], own.image.channels[name], rtol=1e-5, atol=1e-6
        )


def test_two_runs_are_identical(xml: Path, tmp_path: Path) -> None:
    """Bit for bit, files included, apart from the times in them."""

    def run(name: str) -> tuple[Any, dict[str, Any]]:
        exr, report = render_scene(load_scene(xml)).save(tmp_path / f"{name}.exr")
        assert (exr, report) == (tmp_path / f"{name}.exr", tmp_path / f"{name}.json")
        metrics = json.loads(report.read_text())
        assert metrics["schema"] == "iriftrace.pose/2"
        assert metrics.pop("time_s")["write"] > 0
        return read_exr(exr), metrics

    (first, first_metrics), (second, second_metrics) = run("a"), run("b")
    for name in CHANNELS:
        np.testing.assert_array_equal(first.channels[name], second.channels[name])
    del first.header["time_s"], second.header["time_s"]
    assert first.header == second.header
    assert first_metrics == second_metrics


def test_header_says_where_the_picture_comes_from(scene: Scene, xml: Path) -> None:
    header = render_scene(scene).image.header
    assert header["schema"] == "iriftrace.aov/1"
    assert header["normals"] == "gradient"
    assert header["index_rule"] == "custom"
    assert Path(header["part"]["path"]) == xml.parent / "part.ply"
    assert header["part"]["sha256"] == scene.part.sha256
    np.testing.assert_array_equal(header["pose"]["matrix"], header["camera"]["matrix"])
    np.testing.assert_allclose(header["pose"]["origin_mm"], (0, -120, 60))
    assert header["counts"] == {"open_boundary": 0, "triangles_in_view": 3 * 1280}
    assert header["assumptions"]["engine"]
    assert header.keys() >= {
        *("version", "bending", "wavelength_nm", "field", "variant", "length_unit", "time_s")
    }
    json.dumps(header, allow_nan=False)


@pytest.mark.parametrize(
    ("origin", "target", "message"),
    [
        ((1, 2, 3), (50, 0, 0), "inside the part"),
        ((0, -18, 0), (0, 0, 0), "inside the hot air"),
        ((0, -120, 60), (0, -200, 60), "No ray of the camera hits the part; point the camera"),
        (
            (0, -300, 0),
            (0, 0, 0),
            r"focus: the hits are 28\d\.\d to 29\d\.\d mm away, the focus interval is 50 to 250 mm",
        ),
    ],
)
def test_poses_without_a_result_are_refused(
    scene: Scene, origin: tuple[float, ...], target: tuple[float, ...], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        render_scene(scene, camera=evolve(CAMERA, matrix=look_at(origin, target)))


def test_picture_of_a_hidden_part_is_refused(xml: Path) -> None:
    wall = """<shape type="rectangle" id="wall"><transform name="to_world">
        <scale value="200"/><rotate x="1" angle="90"/><translate y="-60"/></transform>
        <bsdf type="diffuse"/></shape></scene>"""
    xml.write_text(xml.read_text().replace("</scene>", wall))
    with pytest.raises(InputError, match="Another object hides the part"):
        render_scene(load_scene(xml))


def test_bundle_of_a_cameras_rays_gives_the_cameras_picture(scene: Scene) -> None:
    """The projector, laser or pencil of rays is the same call: the same hits, faces, crossings."""
    image = render_scene(scene, camera=CAMERA).image
    hits = trace_rays(scene, *CAMERA.rays(), focus_mm=CAMERA.focus_mm, coherent=True)
    good = image.status.ravel() == Status.GOOD
    np.testing.assert_array_equal(hits.status[good], Status.GOOD)
    np.testing.assert_array_equal(
        hits.face[good], image.channels["part.face"].ravel()[good].astype(int) - 1
    )
    np.testing.assert_array_equal(
        hits.crossings[good], image.channels["path.crossings"].ravel()[good]
    )
    for name in ("straight", "refracted", "displacement"):
        np.testing.assert_allclose(
            getattr(hits, name)[good], image.vector(name).reshape(-1, 3)[good], atol=2e-6
        )
    np.testing.assert_allclose(
        hits.path_length[good], image.channels["path.length"].ravel()[good], rtol=1e-6
    )


def test_bundle_in_detail(scene: Scene) -> None:
    """Through the centre, past everything, and through the air only; starting in any distance."""
    hits = trace_rays(
        scene,
        [(0.01, 0.02, 100.0), (0, 50.0, 100.0), (20.5, 0.3, 90.0)],
        [(0, 0, -7.0), (0, 0, -1.0), (0, 0, -0.1)],
    )
    assert hits.status.tolist() == [Status.GOOD, Status.MISSED, Status.MISSED]
    assert hits.crossings.tolist() == [3, 0, 2]
    assert (hits.face >= 0).tolist() == (hits.refracted_face >= 0).tolist() == [True, False, False]
    assert np.isnan(hits.straight[1:]).all()
    assert np.isnan(hits.refracted[1:]).all()
    assert np.isnan(hits.displacement[1:]).all()
    assert np.isnan(hits.path_length[1:]).all()
    np.testing.assert_allclose(hits.straight[0], (0.01, 0.02, 12), atol=0.1)
    assert hits.path_length[0] == pytest.approx(100 - hits.refracted[0, 2], rel=1e-9)
    # A ray that meets nothing keeps its direction; one through thinner air is bent towards outside.
    np.testing.assert_array_equal(hits.direction[1], (0, 0, -1))
    np.testing.assert_allclose(np.linalg.norm(hits.direction, axis=1), 1, atol=1e-14)
    assert 1e-6 < hits.direction[2, 0] < 1e-3
    assert repr(hits) == "RayHits(3 rays: 1 good, 2 missed)"


def test_bundle_does_not_depend_on_its_order_or_size(scene: Scene) -> None:
    random = np.random.default_rng(3)
    origins = random.normal(size=(500, 3))
    origins *= 100 / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = random.uniform(-8, 8, size=(500, 3)) - origins
    whole = trace_rays(scene, origins, directions)
    order = random.permutation(500)
    shuffled = trace_rays(scene, origins[order], directions[order])
    np.testing.assert_array_equal(shuffled.refracted, whole.refracted[order])
    single = trace_rays(scene, origins[7:8], directions[7:8])
    np.testing.assert_array_equal(single.refracted[0], whole.refracted[7])
    assert (whole.status == Status.GOOD).mean() > 0.9


def test_bundle_honours_a_focus_interval(scene: Scene) -> None:
    ray = ([(0.01, 0.02, 100.0)], [(0, 0, -1)])
    assert trace_rays(scene, *ray, focus_mm=(80, 90)).status[0] == Status.GOOD
    assert trace_rays(scene, *ray, focus_mm=(0, 80)).status[0] == Status.OUT_OF_FOCUS
    assert trace_rays(scene, *ray, focus_mm=(90, 100)).status[0] == Status.OUT_OF_FOCUS


@pytest.mark.parametrize(
    ("origins", "directions", "message"),
    [
        (np.zeros((2, 3)), np.ones((3, 3)), r"given are \(2, 3\) and \(3, 3\)"),
        (np.zeros(3), np.ones(3), r"one shape \(n, 3\)"),
        (np.zeros((4, 2)), np.ones((4, 2)), r"one shape \(n, 3\)"),
        (np.zeros((0, 3)), np.ones((0, 3)), "n > 0"),
        ([(0, 0, np.nan)], [(0, 0, 1)], "not finite"),
        ([(0, 0, 0)], [(0, np.inf, 1)], "not finite"),
        ([(0, 0, 0)], [(0, 0, 0)], "direction of length zero"),
    ],
)
def test_bundles_that_are_none_are_refused(
    scene: Scene, origins: Any, directions: Any, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        trace_rays(scene, origins, directions)


def test_loaded_scene_serves_many_poses(scene: Scene) -> None:
    """The first pose again after another one, and a scene changed to it: equal to the last bit."""
    other = evolve(CAMERA, matrix=look_at((90.0, 90.0, 10.0), (0.0, 0.0, 0.0)))
    first = render_scene(scene, camera=CAMERA).image
    between = render_scene(scene, camera=other).image
    again = render_scene(scene, camera=CAMERA).image
    changed = render_scene(evolve(scene, camera=other)).image
    assert (between.vector("straight") != first.vector("straight")).any()
    for name in CHANNELS:
        np.testing.assert_array_equal(again.channels[name], first.channels[name])
        np.testing.assert_array_equal(changed.channels[name], between.channels[name])


def test_a_scaled_picture_states_shifts_and_steps_of_the_full_camera() -> None:
    """Computed from a quarter of the pixels across, and measured with all of them."""
    xml = folder_of("cylinder") / "scene.xml"
    small, large = (render_scene(load_scene(xml, {"scale": scale})).metrics for scale in (0.1, 0.4))
    stated = evolve(small, full_resolution=large.camera.resolution).full_camera
    assert stated["resolution"] == list(large.camera.resolution)
    assert stated["shift_px"]["median"] == pytest.approx(large.shift_px.median, rel=0.03)
    assert stated["lateral_resolution_mm"] == pytest.approx(large.lateral_resolution_mm, rel=0.05)
    assert (
        large.as_dict()["full_camera"]["resolution"] == small.as_dict()["full_camera"]["resolution"]
    )
    assert evolve(large, full_resolution=large.camera.resolution).full_camera is None
