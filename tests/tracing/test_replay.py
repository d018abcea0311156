"""Lost rays: written with all digits, and traced again by both engines and the reference."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from attrs import evolve

import iriftrace
from iriftrace.camera.pose import look_at
from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.image.aov_image import Status
from iriftrace.image.lost_rays import LostRay, LostRays, lost_rays_of
from iriftrace.io.lost_rays import read_lost_rays, write_lost_rays
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.pose_image import pose_image
from iriftrace.tracing.rays import trace_rays
from iriftrace.tracing.replay import REFERENCE, Replay, replay_ray
from validation.inputs.cameras import camera_at
from validation.inputs.small_scenes import (
    AMBIENT,
    HOT,
    ball_in_shells,
    nested_spheres,
    part,
    scene,
    shell,
    sphere,
)

pytestmark = pytest.mark.usefixtures("variant")

BUNDLED = folder_of("cylinder") / "scene.xml"
ABOVE = [
    camera_at((x, 1.0, 250.0), sensor_mm=(6.7, 5.6), resolution=(122, 102)) for x in (-40.0, 40.0)
]
SIDE = [
    evolve(camera, matrix=look_at((x, -230.0, 0.0), (0.0, 0.0, 0.0)))
    for camera, x in zip(ABOVE, (-40.0, 40.0), strict=True)
]


def by_tracer(replay: Replay) -> dict[str, iriftrace.RayPath]:
    return {path.tracer: path for path in replay.paths}


@pytest.fixture
def giving_up() -> iriftrace.Scene:
    """Rays that cross more than 13 shells are given up: some that graze the plume."""
    loaded = load_scene(BUNDLED, engine="shells")
    loaded.compiled.integrator.max_crossings = 14
    return loaded


@pytest.fixture
def file_of_scene(tmp_path: Path) -> Path:
    """The bundled scene with the same limit in its file."""
    shutil.copytree(BUNDLED.parent, tmp_path / "scene")
    xml = tmp_path / "scene/scene.xml"
    limit = '<integrator type="first_hit"><integer name="max_crossings" value="14"/>'
    xml.write_text(xml.read_text().replace('<integrator type="first_hit">', limit))
    return xml


def test_a_pictures_first_lost_rays_are_those_of_its_pixels(giving_up: iriftrace.Scene) -> None:
    camera = ABOVE[0]
    image = pose_image(giving_up, camera)
    found = lost_rays_of(image)
    assert found is not None
    lost = np.argwhere(image.status == Status.GAVE_UP)
    assert found.lost == len(lost) > len(found.rays) == 20
    assert [ray.number for ray in found.rays] == list(range(1, 21))
    np.testing.assert_array_equal([ray.pixel for ray in found.rays], lost[:20, ::-1])
    origin, direction = camera.rays(lost[:20, ::-1])
    np.testing.assert_array_equal([ray.origin_mm for ray in found.rays], origin)
    np.testing.assert_array_equal([ray.direction for ray in found.rays], direction)
    assert found.engine == "shells"
    assert found.versions["iriftrace"] == iriftrace.__version__
    giving_up.compiled.integrator.max_crossings = 1000
    assert lost_rays_of(pose_image(giving_up, camera)) is None


def test_files_keep_all_digits(tmp_path: Path, giving_up: iriftrace.Scene) -> None:
    found = lost_rays_of(pose_image(giving_up, SIDE[0]))
    assert found is not None
    write_lost_rays(tmp_path / "a.rays.json", found)
    assert read_lost_rays(tmp_path / "a.rays.json") == found


@pytest.mark.parametrize(
    "change",
    [
        {"schema": "iriftrace.rays/2"},
        {"rays": [{"number": 1}]},
        {"engine": 3},
        {"rays": 0},
    ],
)
def test_other_files_are_refused(
    tmp_path: Path, giving_up: iriftrace.Scene, change: dict[str, object]
) -> None:
    path = tmp_path / "a.rays.json"
    found = lost_rays_of(pose_image(giving_up, SIDE[0]))
    assert found is not None
    write_lost_rays(path, found)
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(InputError) as error:
        read_lost_rays(path)
    assert error.value.code == "rays.no_file"


def test_a_ray_at_the_limit_ends_where_the_other_tracers_go_on(giving_up: iriftrace.Scene) -> None:
    found = lost_rays_of(pose_image(giving_up, SIDE[0]))
    assert found is not None
    paths = by_tracer(replay_ray(giving_up, found.rays[0]))
    shells, cells, reference = (paths[name] for name in ("shells", "cells", REFERENCE))
    assert (shells.status, shells.crossings) == (Status.GAVE_UP, 14)
    assert cells.status == reference.status == Status.GOOD
    assert reference.crossings >= 14
    # The replay leaves the limit as it was.
    assert giving_up.compiled.integrator.max_crossings == 14
    # Along the way the engine's path is the reference's, as far as facets represent the shells.
    count = len(shells.points)
    assert count == 15
    apart = np.linalg.norm(shells.points - reference.points[:count], axis=1)
    assert apart.max() < 0.05


def test_known_rays_end_alike_and_as_in_a_bundle() -> None:
    loaded = load_scene(BUNDLED, {"normals": "facet"}, engine="shells")
    origin, direction = SIDE[0].rays([[54.0, 45.0]])
    start, along = origin[0].tolist(), direction[0].tolist()
    replay = replay_ray(loaded, LostRay(1, "camera", (54.0, 45.0), start, along, 6))
    paths = by_tracer(replay)
    assert {path.status for path in replay.paths} == {Status.GOOD}
    hits = trace_rays(loaded, origin, direction)
    np.testing.assert_array_equal(paths["shells"].end, hits.refracted[0])
    np.testing.assert_array_equal(replay.straight, hits.straight[0])
    # At facets the engine's whole path is that of the reference.
    assert len(paths["shells"].points) == hits.crossings[0] + 2
    np.testing.assert_allclose(paths["shells"].points, paths[REFERENCE].points, atol=1e-6)
    # The field itself: by a hundredth of the displacement or so.
    displacement = np.linalg.norm(hits.displacement[0])
    assert np.linalg.norm(paths["cells"].end - paths["shells"].end) < 0.3 * displacement


def test_a_ray_through_a_hole_misses_one_step_in_the_reference_too(tmp_path: Path) -> None:
    """Status 5 of the shells: the ray enters through a hole of the inner shell."""
    middle = (AMBIENT + HOT) / 2
    inner = sphere(14.0, 4)
    towards = np.array((9.0, -np.sqrt(14.0**2 - 81), 0.0)) / 14.0
    centres = inner.triangles_center / np.linalg.norm(inner.triangles_center, axis=1)[:, None]
    kept = inner.faces[centres @ towards < np.cos(np.radians(4.0))]
    holed = trimesh.Trimesh(inner.vertices, kept, process=False)
    content = {
        "part": part(tmp_path, sphere(10.0, 4)),
        "outer": shell(tmp_path, "outer", sphere(20.0, 4), AMBIENT, middle),
        "inner": shell(tmp_path, "inner", holed, middle, HOT),
    }
    loaded = iriftrace.from_mitsuba(scene(content, normals="facet"))
    found = lost_rays_of(pose_image(loaded))
    assert found is not None
    assert {ray.status for ray in found.rays} == {Status.INDEX_MISMATCH}
    replay = replay_ray(loaded, found.rays[0])
    paths = by_tracer(replay)
    assert set(paths) == {"shells", REFERENCE}
    assert "cells" in replay.left_out
    assert paths["shells"].status == Status.INDEX_MISMATCH
    assert paths["shells"].crossings == paths[REFERENCE].crossings == 1
    np.testing.assert_allclose(paths["shells"].points, paths[REFERENCE].points, atol=1e-6)


@pytest.mark.parametrize(
    ("ratio", "impact", "expected"),
    [
        (1.2, 5.0, Status.GOOD),
        (1.2, 11.0, Status.ONLY_REFRACTED),
        (1.2, 15.0, Status.MISSED),
        (1 / 1.2, 9.0, Status.REFRACTED_MISSED),
    ],
)
def test_the_references_status_is_that_of_the_engine(
    tmp_path: Path, ratio: float, impact: float, expected: Status
) -> None:
    """A ball of index n makes the part look n times as large (Bouguer)."""
    glass = nested_spheres(tmp_path, (20.0,), (1.0, ratio), subdivisions=4)
    loaded = iriftrace.from_mitsuba(
        scene({"part": part(tmp_path, sphere(10.0)), **glass}, normals="facet")
    )
    ray = LostRay(1, "camera", (0.0, 0.0), (impact, -100.0, 0.1), (0.0, 1.0, 0.0), 6)
    paths = by_tracer(replay_ray(loaded, ray))
    assert paths[REFERENCE].status == paths["shells"].status == expected
    np.testing.assert_allclose(paths["shells"].end, paths[REFERENCE].end, atol=1e-6)


@pytest.mark.filterwarnings("ignore::iriftrace.core.errors.IriftraceWarning")
def test_a_measurement_keeps_the_rays_of_both_devices(giving_up: iriftrace.Scene) -> None:
    scan = measure(giving_up, *ABOVE, system="stereo")
    found = scan.lost_rays
    assert found is not None
    assert found.lost == scan.as_dict()["points"]["lost"] > len(found.rays)
    for ray in found.rays:
        hits = trace_rays(giving_up, [ray.origin_mm], [ray.direction])
        assert hits.status[0] == ray.status == Status.GAVE_UP
    scan = measure(giving_up, *SIDE, system="stereo")
    assert scan.lost_rays is not None
    assert {ray.device for ray in scan.lost_rays.rays} == {"camera", "second"}


@pytest.mark.slow
def test_an_ensembles_ray_is_replayed_in_its_member(tmp_path: Path) -> None:
    """Without a number, in the first member that loses it; in none: an error."""
    loaded = load_scene(BUNDLED, engine="shells")
    ray = LostRay(1, "camera", (0.0, 0.0), (0.0, -230.0, 0.0), (0.0, 1.0, 0.0), 6)
    states = [loaded.air.states[0]] * 2
    ensemble = evolve(loaded, air=loaded.air.with_states(states))
    with pytest.raises(InputError) as error:
        replay_ray(ensemble, ray)
    assert error.value.code == "rays.no_member"
    paths = by_tracer(replay_ray(ensemble, evolve(ray, member=2)))
    assert paths["shells"].status == Status.GOOD


def test_commands_write_and_replay(
    file_of_scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    exr, rays = tmp_path / "out.exr", tmp_path / "out.rays.json"
    words = ["render", str(file_of_scene), "-o", str(exr), "--no-figures", "-D", "scale=0.1"]
    assert main([*words, "--engine", "shells"]) == 0
    found = read_lost_rays(rays)
    said = capsys.readouterr().out
    assert f"{len(found.rays)} of {found.lost} lost rays are in {rays}" in said
    assert main(["ray", str(rays), "--number", "2"]) == 0
    said = capsys.readouterr().out
    assert re.search(r"shells .* 14 +6, lost", said)
    assert re.search(r"NumPy .* 0, good", said)
    assert (tmp_path / "out_ray_2.png").stat().st_size > 10_000
    assert main(["ray", str(rays), "--number", "99"]) == 2
    assert "no ray 99" in capsys.readouterr().err
    # Without lost rays those of the earlier run are gone.
    assert main([*words, "--engine", "cells"]) == 0
    assert not rays.exists()
    rays.write_text("{}")
    assert main([*words, "--engine", "cells"]) == 2
    assert rays.read_text() == "{}"


def test_a_changed_scene_is_warned_of(
    file_of_scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    loaded = load_scene(file_of_scene, {"scale": 0.1}, engine="shells")
    found = lost_rays_of(pose_image(loaded))
    assert isinstance(found, LostRays)
    write_lost_rays(tmp_path / "a.rays.json", found)
    file_of_scene.write_text(file_of_scene.read_text() + "\n")
    assert main(["ray", str(tmp_path / "a.rays.json"), "--no-figures"]) == 0
    assert "checksum differs" in capsys.readouterr().err


def test_no_ray_is_lost_where_the_limit_is_not_met(tmp_path: Path) -> None:
    loaded = iriftrace.from_mitsuba(scene(ball_in_shells(tmp_path)))
    assert lost_rays_of(pose_image(loaded)) is None
