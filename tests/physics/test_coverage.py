"""Coverage of bodies whose visible area is known, and its independence of the tessellation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from aov_by_hand import cast, image_of_hits, make_image, make_part, plate
from numpy.typing import NDArray

from iriftrace.camera import Camera, look_at
from iriftrace.errors import IriftraceWarning
from iriftrace.metrics import pose_metrics
from iriftrace.part import Part, read_part
from iriftrace.regions import Regions

CYLINDER = Path(__file__).parents[2] / "scenes" / "cylinder" / "part.ply"


def camera(width: int, height: int, origin: tuple[float, float, float]) -> Camera:
    return Camera(
        focal_length_mm=10,
        sensor_mm=(6.7, 5.6),
        resolution=(width, height),
        matrix=look_at(origin, (0, 0, 0)),
    )


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
    assert metrics["coverage"] == 1.0
    assert metrics["coverage_area"] == pytest.approx(1.0, abs=0.5 / 35)
    assert metrics["coverage_area"] <= 1.0 + 1e-12


def test_plate_that_leaves_the_picture_is_covered_in_part() -> None:
    """The picture of 6.7 x 5.6 mm at 10 mm focal length shows 40.2 x 33.6 mm at 60 mm distance.

    Footprints tile the picture without gap, so only float32 angles and hits limit the agreement.
    """
    part = plate((50, 0, 0), (0, 40, 0), (0, 0, 60))
    view = Camera(focal_length_mm=10, sensor_mm=(6.7, 5.6), resolution=(60, 50))
    metrics = pose_metrics(make_image(view, part), part)
    assert metrics["coverage_area"] == pytest.approx(40.2 * 33.6 / (100 * 80), rel=1e-3)
    assert metrics["coverage"] == 1.0, "both triangles are hit, which is what the paper counts"


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
    assert metrics["coverage"] == pytest.approx(0.5)
    assert metrics["coverage_area"] == pytest.approx(0.5, rel=0.01)
    assert metrics["regions"]["towards"]["coverage"] == pytest.approx(1.0)
    assert metrics["regions"]["towards"]["coverage_area"] == pytest.approx(1.0, rel=0.01)
    assert metrics["regions"]["away"]["coverage"] is None
    assert metrics["regions"]["away"]["rays"]["hit"] == 0


def test_convex_body_shows_every_face_whose_outer_side_the_camera_is_on() -> None:
    """The visible area of a convex polyhedron is the sum of those faces, exactly.

    Grazing footprints are long and few: at this resolution one pose's sum scatters by 3 %, so the
    mean of six poses is good to 2.5 % (two standard deviations). Cutting the footprints at each
    face's area instead of the patch's would lose 5 %.
    """
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=20)
    part = make_part(mesh.vertices, mesh.faces)
    towards = np.random.default_rng(11).normal(size=(6, 3))
    shares = []
    for origin in 95 * towards / np.linalg.norm(towards, axis=1, keepdims=True):
        metrics = pose_metrics(make_image(camera(110, 92, tuple(origin)), part), part)
        to_camera = origin - part.vertices[part.faces[:, 0]]
        visible = np.einsum("ij,ij->i", to_camera, part.face_normals) > 0
        shares.append(metrics["coverage_area"] * part.area / part.face_areas[visible].sum())
    assert np.mean(shares) == pytest.approx(1.0, abs=0.025)


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


@pytest.mark.filterwarnings("ignore:only .* rays fall:iriftrace.errors.IriftraceWarning")
def test_area_does_not_depend_on_the_tessellation() -> None:
    """The bundled cylinder with 2040, 8160 and 32640 triangles, seen by the same rays.

    The share of the faces hit, the paper's coverage, loses more than half meanwhile.
    """
    part = read_part(CYLINDER)
    view = camera(120, 100, (110, -90, 110))
    distance, face = cast(view, part)
    origins, directions = view.rays()
    points = origins + np.where(face >= 0, distance, 0)[:, None] * directions
    results = []
    for _ in range(3):
        results.append(pose_metrics(image_of_hits(view, part, distance, face), part))
        part, face = finer(part, face, points)
    areas = [metrics["coverage_area"] for metrics in results]
    assert 0.38 < areas[0] < 0.43
    np.testing.assert_allclose(areas[1:], areas[0], rtol=0.005)
    lateral = [metrics["regions"]["lateral"]["coverage_area"] for metrics in results]
    np.testing.assert_allclose(lateral[1:], lateral[0], rtol=0.005)
    assert results[2]["coverage"] < 0.5 * results[0]["coverage"]


def test_fewer_than_four_rays_for_each_face_are_reported() -> None:
    part = plate((10, 0, 0), (0, 10, 0), (0, 0, 60), cells=20)
    view = Camera(focal_length_mm=10, sensor_mm=(6.7, 5.6), resolution=(60, 50))
    with pytest.warns(IriftraceWarning, match="rays fall on each visible face"):
        pose_metrics(make_image(view, part), part)
