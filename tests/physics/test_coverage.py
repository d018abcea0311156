"""Coverage of bodies whose visible area is known, and its independence of the tessellation."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from attrs import evolve
from numpy.typing import NDArray

from iriftrace.camera.camera import Camera
from iriftrace.core.errors import IriftraceWarning
from iriftrace.image.aov_image import AovImage, Status
from iriftrace.image.coverage import seen_areas
from iriftrace.image.metrics import pose_metrics
from iriftrace.io.part_files import read_part
from iriftrace.part.part import Part
from iriftrace.part.regions import Regions
from validation.inputs.cameras import camera_at
from validation.oracles.aov_by_hand import cast, image_of_hits, make_image, make_part, plate
from validation.oracles.rasterise import rasterise

FloatArray = NDArray[np.float64]
CYLINDER = Path(__file__).parents[2] / "scenes" / "cylinder" / "part.ply"


def camera(width: int, height: int, origin: tuple[float, float, float]) -> Camera:
    return camera_at(origin, sensor_mm=(6.7, 5.6), resolution=(width, height))


def ball(subdivisions: int) -> Part:
    """A closed ball of 20 mm radius."""
    mesh = trimesh.creation.icosphere(subdivisions, radius=20)
    return evolve(make_part(mesh.vertices, mesh.faces), closed=True)


def cube() -> Part:
    """A closed cube of 24 mm whose six sides are smooth patches of their own."""
    mesh = trimesh.creation.box(extents=(24, 24, 24))
    side = np.unique(np.round(mesh.face_normals), axis=0, return_inverse=True)[1].ravel()
    return evolve(make_part(mesh.vertices, mesh.faces, groups=side), closed=True)


def look(view: Camera, part: Part) -> AovImage:
    return image_of_hits(view, part, *rasterise(view, part))


def area_facing(part: Part, origin: FloatArray) -> float:
    """Visible area of a convex polyhedron, exactly: its faces whose outer side is towards us."""
    to_camera = origin - part.vertices[part.faces[:, 0]]
    facing = np.einsum("ij,ij->i", to_camera, part.face_normals) > 0
    return float(part.face_areas[facing].sum())


@pytest.mark.parametrize("angle", [0, 45, 75, 85])
@pytest.mark.parametrize("projection", ["pinhole", "orthographic"])
def test_tilted_plate_is_covered_once(angle: float, projection: str) -> None:
    """The footprints of a plate that is wholly in view add up to its area.

    Error: half a pixel's row of footprints at each edge, with random sign; the plate spans at
    least 35 rows and 120 columns.
    """
    lean = np.radians(angle)
    part = plate((10, 0, 0), (0, 10 * np.cos(lean), 10 * np.sin(lean)), (0.13, 0.07, 60))
    view = Camera(
        focal_length_mm=10, sensor_mm=(6.7, 5.6), resolution=(240, 200), projection=projection
    )
    if projection == "orthographic":
        view = Camera(sensor_mm=(24, 24), resolution=(240, 480), projection=projection)
    metrics = pose_metrics(make_image(view, part), part)
    assert metrics.coverage == 1.0
    assert metrics.coverage_area == pytest.approx(1.0, abs=0.5 / 35)
    assert metrics.coverage_area <= 1.0 + 1e-12


def test_plate_that_leaves_the_picture_is_covered_in_part() -> None:
    """The picture of 6.7 x 5.6 mm at 10 mm focal length shows 40.2 x 33.6 mm at 60 mm distance.

    Footprints tile the picture without gap, so only float32 angles and hits limit the agreement.
    """
    part = plate((50, 0, 0), (0, 40, 0), (0, 0, 60))
    view = Camera(focal_length_mm=10, sensor_mm=(6.7, 5.6), resolution=(60, 50))
    metrics = pose_metrics(make_image(view, part), part)
    assert metrics.coverage_area == pytest.approx(40.2 * 33.6 / (100 * 80), rel=1e-3)
    assert metrics.coverage == 1.0, "both triangles are hit, which is what the paper counts"


def test_box_shows_three_sides_and_each_region_its_own_share() -> None:
    mesh = trimesh.creation.box(extents=(20, 16, 12))
    side = [(0 if n.max() > 0.5 else 1) for n in mesh.face_normals]
    part = make_part(
        mesh.vertices,
        mesh.faces,
        regions=Regions(np.array(side), ("towards", "away")),
        groups=np.unique(np.round(mesh.face_normals), axis=0, return_inverse=True)[1].ravel(),
    )
    metrics = pose_metrics(make_image(camera(200, 170, (60, 50, 45)), part), part)
    assert metrics.coverage == pytest.approx(0.5)
    assert metrics.coverage_area == pytest.approx(0.5, rel=0.01)
    assert metrics.regions["towards"].coverage == pytest.approx(1.0)
    assert metrics.regions["towards"].coverage_area == pytest.approx(1.0, rel=0.01)
    assert metrics.regions["away"].coverage is None
    assert metrics.regions["away"].rays.hit == 0


def test_filling_pixels_hits_what_brute_force_hits() -> None:
    """Pixels within rounding of an edge may go to either triangle; the distance is the same."""
    view, part = camera(60, 50, (60, 50, 45)), ball(2)
    distance, face = rasterise(view, part)
    expected, expected_face = cast(view, part)
    np.testing.assert_array_equal(np.isfinite(distance), np.isfinite(expected))
    assert np.isfinite(distance).sum() > 500
    np.testing.assert_allclose(distance, expected, rtol=1e-12)
    assert np.mean(face != expected_face) < 0.001


@pytest.mark.parametrize(("distance", "error"), [(80.0, 0.01), (150.0, 0.05)])
def test_ball_shows_the_cap_below_its_horizon(distance: float, error: float) -> None:
    """Visible area of a sphere of radius R from distance d: 2 pi R^2 (1 - R / d).

    Grazing footprints are long and few, and what is too much is cut, so the sum is rather too small
    than too large: up to 4 % for the far ball of 123 px. The 5,120 facets show 0 to 0.3 % more or
    less than the smooth sphere.
    """
    part = ball(4)
    towards = np.random.default_rng(11).normal(size=(2, 3))
    shares = []
    for origin in distance * towards / np.linalg.norm(towards, axis=1, keepdims=True):
        image = look(camera(306, 256, tuple(origin)), part)
        share = pose_metrics(image, part).coverage_area
        assert share * part.area <= area_facing(part, origin) * (1 + 1e-12)
        shares.append(share / ((1 - 20 / distance) / 2))
    assert min(shares) > 1 - error
    assert max(shares) < 1.003


@pytest.mark.parametrize("origin", [(80, 60, 45), (150, 3, 2), (100, 0.1, 60)])
def test_cube_shows_every_side_that_faces_the_camera(origin: tuple[float, float, float]) -> None:
    """Sides hit by few grazing rays count for what is seen of them: footprints do not spill over.

    At (150, 3, 2) only one side is seen: the others' planes have the camera on their inner side. It
    is 73 px wide, so half a row of pixels at either edge is 1.4 %.
    """
    part = cube()
    image = look(camera(306, 256, origin), part)
    share = pose_metrics(image, part).coverage_area
    assert share == pytest.approx(area_facing(part, np.array(origin)) / part.area, rel=0.014)


def finer(
    part: Part, face: NDArray[np.int64], points: NDArray[np.float64]
) -> tuple[Part, NDArray[np.int64]]:
    """Each triangle cut into four at the middles of its edges, and the new faces of the points."""
    corners = part.vertices[part.faces]
    a, b, c = corners.transpose(1, 0, 2)
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    four = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    vertices = np.stack([np.stack(child, axis=1) for child in four], axis=1).reshape(-1, 3)
    new = make_part(
        vertices,
        np.arange(len(vertices)).reshape(-1, 3),
        regions=Regions(np.repeat(part.region_of_face, 4), part.region_names),
        groups=np.repeat(part.smooth_group, 4),
    )
    new = evolve(new, closed=part.closed)
    hit = face >= 0
    own = corners[face[hit]]
    edges = own[:, 1:] - own[:, :1]
    offset = points[hit] - own[:, 0]
    gram = np.einsum("nik,njk->nij", edges, edges)
    uv = np.linalg.solve(gram, np.einsum("nik,nk->ni", edges, offset)[..., None])[..., 0]
    weights = np.column_stack((1 - uv.sum(axis=1), uv))
    child = np.where(weights.max(axis=1) > 0.5, weights.argmax(axis=1), 3)
    new_face = np.full(len(face), -1)
    new_face[hit] = 4 * face[hit] + child
    return new, new_face


def cylinder() -> Part:
    return read_part(CYLINDER)


@pytest.mark.filterwarnings("ignore:fewer than .* rays fall:iriftrace.core.errors.IriftraceWarning")
@pytest.mark.parametrize(
    ("body", "origin"),
    [
        (cylinder, (110, -90, 110)),
        (cylinder, (0, -230, 10)),
        (cylinder, (230, 0, 0)),
        (cylinder, (200, -80, 20)),
        (lambda: ball(3), (60, -50, 45)),
        (cube, (80, 60, 45)),
    ],
)
def test_area_does_not_depend_on_the_tessellation(
    body: Callable[[], Part], origin: tuple[float, float, float]
) -> None:
    """Meshes cut into 4 and 16 times as many triangles, seen by the same rays.

    The sum hardly changes, because what is too much on one face finds room on others; no face gets
    more than its area.
    """
    part = body()
    view = camera(120, 100, origin)
    distance, face = rasterise(view, part)
    origins, directions = view.rays()
    points = origins + np.where(face >= 0, distance, 0)[:, None] * directions
    results = []
    for _ in range(3):
        image = image_of_hits(view, part, distance, face)
        seen = seen_areas(image, part)
        assert (seen <= part.face_areas).all()
        results.append(pose_metrics(image, part))
        assert seen.sum() == pytest.approx(results[-1].coverage_area * part.area, rel=1e-12)
        part, face = finer(part, face, points)
    areas = [metrics.coverage_area for metrics in results]
    np.testing.assert_allclose(areas[1:], areas[0], rtol=0.002)
    if origin == (110, -90, 110):
        # The paper's number does depend on it, which is why there are two.
        assert results[2].coverage < 0.5 * results[0].coverage
    for name in results[0].regions:
        region = [metrics.regions[name].coverage_area for metrics in results]
        if region[0] is not None:
            np.testing.assert_allclose(region[1:], region[0], rtol=0.002)


def test_faces_between_the_rows_of_pixels_are_seen_too() -> None:
    """A plate in strips of 1.4 and 0.2 pixels: no ray meets most of the thin ones."""
    heights = np.cumsum(np.tile([1.4, 0.2], 50)) * 0.1
    edges = np.concatenate(([0], heights)) - heights[-1] / 2
    corners = np.array([(x, y, 60.0) for y in edges for x in (-5.0, 5.0)])
    first = 2 * np.arange(len(edges) - 1)
    faces = np.concatenate(
        [
            np.stack((first, first + 3, first + 1), axis=1),
            np.stack((first, first + 2, first + 3), 1),
        ]
    )
    part = make_part(corners, faces)
    view = Camera(sensor_mm=(20, 20), resolution=(200, 200), projection="orthographic")
    image = look(view, part)
    hit = np.isin(np.arange(len(faces)), image.channels["part.face"] - 1)
    thin = part.face_areas < part.face_areas.max() / 2
    assert (~hit & thin).sum() > 60
    seen = seen_areas(image, part)
    assert seen.sum() == pytest.approx(part.area, rel=0.01)
    assert seen[~hit & thin].sum() == pytest.approx(part.face_areas[~hit & thin].sum(), rel=0.15)


@pytest.mark.parametrize("projection", ["pinhole", "orthographic"])
def test_far_side_gets_nothing_of_what_is_too_much(projection: str) -> None:
    """All footprints trebled: the side towards the camera is full then, the other one empty."""
    part = ball(3)
    view = camera(120, 100, (80, 30, 10))
    if projection == "orthographic":
        view = evolve(view, projection=projection, sensor_mm=(67, 56))
    image = look(view, part)
    hit = np.isin(np.arange(len(part.faces)), image.channels["part.face"] - 1)
    sight = -view.forward if projection == "orthographic" else view.origin - part.face_centres
    facing = np.sum(part.face_normals * sight, axis=1) > 0
    assert (facing & ~hit).any()
    assert not (hit & ~facing).any()
    angle = image.channels["incidence.angle"]
    angle[:] = np.arccos(np.cos(angle) / 3)
    np.testing.assert_array_equal(seen_areas(image, part), np.where(facing, part.face_areas, 0))


def test_open_surface_is_seen_from_its_back() -> None:
    """Its inner side may be what the camera sees, so its normals tell nothing."""
    part = evolve(ball(3), faces=ball(3).faces[:, ::-1], closed=False)
    image = look(camera(120, 100, (80, 30, 10)), part)
    whole = ball(3)
    np.testing.assert_allclose(
        seen_areas(image, part).sum(), seen_areas(image, whole).sum(), rtol=0.03
    )


def test_seen_areas_of_two_poses_add_up() -> None:
    """Opposite poses share no face of a ball; two equal ones see nothing new."""
    part = ball(3)
    one, other = (
        seen_areas(look(camera(153, 128, o), part), part) for o in [(80, 0, 0), (-80, 0, 0)]
    )
    assert np.minimum(one, other).sum() == 0
    together = np.maximum(one, other).sum()
    assert together == pytest.approx(2 * (1 - 20 / 80) / 2 * 4 * np.pi * 20**2, rel=0.05)


def level_cylinder(sections: int) -> Part:
    """A closed cylinder, 27 mm x 60 mm, along y."""
    mesh = trimesh.creation.cylinder(radius=13.5, height=60, sections=sections)
    corners = mesh.vertices[:, [0, 2, 1]]
    side = np.round(mesh.face_normals[:, 2]).astype(np.int64) + 1
    return evolve(make_part(corners, mesh.faces[:, ::-1], groups=side), closed=True)


SCALES = (0.1, 0.3, 1.0)


@pytest.mark.filterwarnings("ignore:fewer than .* rays fall:iriftrace.core.errors.IriftraceWarning")
@pytest.mark.parametrize(
    "part", [ball(2), ball(4), level_cylinder(24), level_cylinder(720)], ids=lambda p: len(p.faces)
)
@pytest.mark.parametrize("origin", [(160, 0, 0), (150, 3, 2), (140, 90, 60)])
def test_area_does_not_depend_on_the_scale(part: Part, origin: tuple[float, float, float]) -> None:
    """A tenth to all of the pixels, coarse and fine faces, convex bodies in closed form.

    The edges of a level cylinder run along the rows of pixels. All of it is in the picture.
    """
    expected = area_facing(part, np.array(origin)) / part.area
    for scale in SCALES:
        image = look(camera(612, 512, origin).scaled(scale), part)
        assert pose_metrics(image, part).coverage_area == pytest.approx(expected, rel=2e-3)


def test_hidden_area_does_not_depend_on_the_scale() -> None:
    """A plate of 40 x 40 mm at 100 mm behind one of 10 x 10 mm at 80 mm: hidden 12.5 x 12.5."""
    behind, before = (
        plate((size, 0, 0), (0, size, 0), (0.3, 0.2, z)) for size, z in ((20, 100), (5, 80))
    )
    part = make_part(
        np.concatenate((behind.vertices, before.vertices)),
        np.concatenate((behind.faces, before.faces + 4)),
    )
    view = Camera(focal_length_mm=10, sensor_mm=(6.7, 5.6), resolution=(918, 768))
    for scale in SCALES:
        seen = seen_areas(look(view.scaled(scale), part), part)
        assert seen[:2].sum() == pytest.approx(1600 - 12.5**2, rel=0.01)
        assert seen[2:].sum() == pytest.approx(100, rel=1e-12)


def test_part_beyond_the_focus_is_not_seen() -> None:
    """Half of a plate leans from 50 to 150 mm, and the focus ends at its middle."""
    part = plate((10, 0, 0), (0, 1, 50), (0, 2, 100))
    view = Camera(
        sensor_mm=(40, 40), resolution=(60, 60), projection="orthographic", focus_mm=(0, 100)
    )
    image = look(view, part)
    far = image.channels["straight.Z"] > 100
    image.channels["status.code"][far] = Status.OUT_OF_FOCUS
    assert seen_areas(image, part).sum() == pytest.approx(part.area / 2, rel=1e-3)


def test_fewer_than_four_rays_for_each_face_are_reported() -> None:
    part = plate((10, 0, 0), (0, 10, 0), (0, 0, 60), cells=20)
    view = Camera(focal_length_mm=10, sensor_mm=(6.7, 5.6), resolution=(60, 50))
    with pytest.warns(IriftraceWarning, match="rays fall on each visible face"):
        pose_metrics(make_image(view, part), part)
