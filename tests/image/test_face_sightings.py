"""Sightings of faces against a count ray by ray, stored and read back."""

import numpy as np
import pytest
import xarray as xr

from iriftrace.camera.camera import Camera
from iriftrace.camera.orbit import Orbit, orbit_poses
from iriftrace.camera.pose_set import PoseSet
from iriftrace.core.errors import InputError
from iriftrace.image.aov_image import AovImage, Status
from iriftrace.image.sightings import COLUMNS, seen_by_pose, sight_faces, sightings_of
from iriftrace.scenes import folder_of
from iriftrace.sweep.sweep import run_sweep
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.render import render_scene
from iriftrace.tracing.scene import Scene
from validation.oracles.aov_by_hand import make_image, plate

# A pose from above changes without every second shell; what each pose sees is the question here.
pytestmark = pytest.mark.filterwarnings("ignore:.*every second shell")


@pytest.fixture(scope="module")
def scene(variant: str) -> Scene:
    """Of the shells in every pose, as the images below are."""
    xml = folder_of("cylinder") / "scene.xml"
    return load_scene(xml, {"scale": 0.15}, variant=variant, engine="shells")


@pytest.fixture(scope="module")
def poses(scene: Scene) -> PoseSet:
    """The last one stands in the part and sees nothing, the one before looks away."""
    orbit = Orbit(centre=scene.part.centre, semi_axes_mm=(310.0, 238.5, 238.5))
    matrices = np.array(orbit_poses(orbit, (0.0, 45.0, 90.0), (0.0, 40.0)).matrices)
    matrices[-2, :3, :3] = matrices[-2, :3, :3] @ np.diag((-1.0, 1.0, -1.0))
    matrices[-1, :3, 3] = scene.part.centre
    return PoseSet(matrices)


@pytest.fixture(scope="module")
def images(scene: Scene, poses: PoseSet) -> list[AovImage]:
    """Of all poses but the one in the part."""
    return [
        render_scene(scene, camera=scene.camera.at(matrix), empty=True).image
        for matrix in poses.matrices[:-1]
    ]


@pytest.fixture(scope="module")
def swept(scene: Scene, poses: PoseSet, tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    return run_sweep(scene, poses, tmp_path_factory.mktemp("sweep") / "sweep.nc")


def by_hand(image: AovImage, include: tuple[int, ...] = (0,)) -> dict[int, list[tuple[float, ...]]]:
    """(displacement, incidence) of every good ray, face by face."""
    rays: dict[int, list[tuple[float, ...]]] = {}
    names = ("part.face", "displacement.norm", "incidence.angle")
    good = np.isin(image.channels["status.code"], include)
    for face, *values in zip(*(image.channels[name][good].tolist() for name in names), strict=True):
        rays.setdefault(round(face) - 1, []).append(tuple(values))
    return rays


def test_rays_are_reduced_to_their_faces(images: list[AovImage], scene: Scene) -> None:
    for image in images:
        found = sight_faces(image, scene.part)
        rays = by_hand(image)
        hit = found.rays > 0
        assert (np.diff(found.face) > 0).all()
        assert found.face[hit].tolist() == sorted(rays)
        assert found.rays.tolist() == [len(rays.get(face, ())) for face in found.face.tolist()]
        for row, face in zip(np.flatnonzero(hit), found.face[hit].tolist(), strict=True):
            moved, angle = np.array(rays[face]).T
            # Both are rounded to float32 once.
            assert found.displacement[row] == pytest.approx(moved.mean(), rel=1e-6)
            assert found.incidence[row] == pytest.approx(np.degrees(angle.min()), rel=1e-6)
    assert len(sight_faces(images[0], scene.part)) > 100
    assert len(sight_faces(images[-1], scene.part)) == 0


def test_faces_between_the_rays_have_those_next_to_them() -> None:
    """A plate of 3,698 triangles under 400 rays, moved by (6, 0, 8) um, seen along z."""
    part = plate((5, 0, 0), (0, 5, 0), (0, 0, 60), cells=43)
    view = Camera(sensor_mm=(10, 10), resolution=(20, 20), projection="orthographic")
    found = sight_faces(make_image(view, part, displacement=(6e-3, 0, 8e-3)), part)
    assert found.rays.sum() == 400
    assert np.count_nonzero(found.rays == 0) >= 3298
    np.testing.assert_array_equal(found.face, np.arange(3698))
    np.testing.assert_array_equal(found.seen, 1.0)
    np.testing.assert_allclose(found.displacement, 1e-2, rtol=1e-6)
    np.testing.assert_allclose(found.incidence, 0.0, atol=1e-5)
    np.testing.assert_allclose(found.offset, np.broadcast_to((-6e-3, 0, 0), (3698, 3)), atol=1e-8)


def test_further_rays_are_included_on_request(images: list[AovImage], scene: Scene) -> None:
    status = np.array(images[0].channels["status.code"])
    rows, columns = np.nonzero(status == Status.GOOD)
    status[rows[:50], columns[:50]] = Status.INDEX_MISMATCH
    image = AovImage({**images[0].channels, "status.code": status}, images[0].header)
    fewer, all_of_them = (sight_faces(image, scene.part, codes) for codes in ((0,), (0, 5)))
    assert all_of_them.rays.sum() - fewer.rays.sum() == 50
    hit = all_of_them.face[all_of_them.rays > 0]
    assert hit.tolist() == sorted(by_hand(image, (0, 5)))


def test_sweep_keeps_what_each_pose_sees(
    swept: xr.Dataset, images: list[AovImage], scene: Scene
) -> None:
    assert swept["sightings"].attrs["sample_dimension"] == "sighting"
    assert int(swept["sightings"].sum()) == swept.sizes["sighting"]
    for pose, image in enumerate(images):
        found = sightings_of(swept, pose)
        expected = sight_faces(image, scene.part)
        for name in COLUMNS:
            np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
        assert int(found.rays.sum()) == int(swept["rays_good"].sel(region="part")[pose])
    assert len(sightings_of(swept, len(images))) == 0


def test_area_seen_of_the_faces_is_the_coverage(swept: xr.Dataset, scene: Scene) -> None:
    """By face numbers and areas of the file alone, whole part and region by region."""
    area, region = swept["face_area"].values, swept["face_region"].values
    assert area.sum() == pytest.approx(scene.part.area)
    names = np.array([str(name) for name in swept["region"].values])
    assert names[region].tolist() == [
        scene.part.region_names[number] for number in scene.part.region_of_face
    ]
    seen = seen_by_pose(swept)
    for number, name in enumerate(names):
        members = (region == number) | (name == "part")
        share = seen[:, members] @ area[members] / area[members].sum()
        expected = swept["coverage_area"].sel(region=name).values
        known = np.isfinite(expected)
        # No pose looks at the head that points to -x.
        assert known.any() == (name != "head -x")
        assert share[known] == pytest.approx(expected[known])


def test_maps_are_those_of_all_rays_of_all_poses(swept: xr.Dataset, images: list[AovImage]) -> None:
    """A pose also sees faces between its rays; where no pose has a ray, rays next to it count."""
    everything: dict[int, list[tuple[float, ...]]] = {}
    times: dict[int, int] = {}
    for image in images:
        for face, rays in by_hand(image).items():
            everything.setdefault(face, []).extend(rays)
    for pose in range(swept.sizes["pose"]):
        for face in sightings_of(swept, pose).face.tolist():
            times[face] = times.get(face, 0) + 1
    rows = [sightings_of(swept, pose) for pose in range(swept.sizes["pose"])]
    best = np.full(swept.sizes["face"], np.inf, dtype=np.float32)
    np.minimum.at(
        best, np.concatenate([r.face for r in rows]), np.hstack([r.incidence for r in rows])
    )
    np.testing.assert_array_equal(swept["face_incidence"], np.where(best < np.inf, best, np.nan))
    most = seen_by_pose(swept).max(axis=0)
    np.testing.assert_array_equal(swept["face_seen"], most)
    for face in range(swept.sizes["face"]):
        assert int(swept["face_times_seen"][face]) == times.get(face, 0)
        displacement, incidence = (
            float(swept[f"face_{name}"][face]) for name in ("displacement", "incidence")
        )
        if face in everything:
            moved, angle = np.array(everything[face]).T
            assert displacement == pytest.approx(moved.mean(), rel=1e-6)
            assert incidence <= np.degrees(angle.min()) * (1 + 1e-6)
        elif face not in times:
            assert np.isnan(displacement)
            assert np.isnan(incidence)
    assert 0 < len(everything) < len(times) < swept.sizes["face"]


def test_limits_leave_out_what_is_seen_badly(swept: xr.Dataset) -> None:
    limits = {"max_displacement_mm": 2e-3, "max_incidence_deg": 60.0}
    seen = seen_by_pose(swept, **limits)
    for pose in range(swept.sizes["pose"]):
        found = sightings_of(swept, pose)
        expected = [
            face
            for face, part, _, moved, angle, *_ in found.as_rows().tolist()
            if part > 0 and moved <= 2e-3 and angle <= 60
        ]
        assert np.flatnonzero(seen[pose]).tolist() == expected
    assert 0 < np.count_nonzero(seen) < np.count_nonzero(seen_by_pose(swept))


@pytest.mark.parametrize(
    ("limit", "words"),
    [
        ({"max_displacement_mm": 0.0}, "No face has"),
        ({"max_displacement_mm": float("nan")}, "No face has"),
        ({"max_incidence_deg": 91.0}, "91 degrees"),
        ({"max_incidence_deg": 0.0}, "0 degrees"),
    ],
)
def test_limits_that_make_no_sense(swept: xr.Dataset, limit: dict[str, float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        seen_by_pose(swept, **limit)


def test_a_pose_that_is_not_there_is_refused(swept: xr.Dataset) -> None:
    for pose in (-1, swept.sizes["pose"]):
        with pytest.raises(InputError, match=f"no pose {pose}"):
            sightings_of(swept, pose)


def test_only_the_rows_asked_for_are_read(swept: xr.Dataset) -> None:
    """Of a fine mesh and many poses they would not fit into memory."""
    again = xr.open_dataset(swept.encoding["source"], engine="h5netcdf")
    sightings_of(swept, 1)
    for dataset in (again, swept):
        assert not dataset["sighting_face"].variable._in_memory
    again.close()
